//! `marquetry convert`: a scan to a `.marq` file.

use super::output::{self, Output};
use super::progress::Display;
use super::{Common, Verdict, args};
use anyhow::bail;
use marquetry_converter::pipeline::{self, Charts, Options, Up};
use marquetry_converter::report::Report;
use std::path::PathBuf;

/// Convert a scan (PLY, OBJ, STL, OFF, GLB; gzip of any of them) to a .marq file
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The input
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// The file to write
    #[arg(short, long, value_name = "OUT.marq")]
    output: PathBuf,
    /// What the input is
    #[arg(long, value_enum, default_value_t)]
    kind: Kind,
    /// Target geometric error, relative to the diagonal of the input's bounds
    #[arg(long, value_name = "E", default_value_t = 1e-4, value_parser = args::relative)]
    error_rel: f64,
    /// When objects come and go (scenes)
    #[arg(long, value_name = "CSV")]
    schedule: Option<PathBuf>,
    /// Ceiling for working memory, with suffix K, M or G; what needs more is refused
    #[arg(long, value_name = "BYTES", default_value = "4GiB", value_parser = args::bytes)]
    memory: u64,
    /// Which axis of the input points up
    #[arg(long, value_enum, default_value_t)]
    up: Axis,
    /// Write the file even if its error is above the target
    #[arg(long)]
    allow_worse: bool,
    /// What becomes charts, that is nested grids of samples, and not clusters of its own triangles, simplified within the target
    #[arg(long, value_enum, default_value_t)]
    charts: WithCharts,
    /// Put no picture of the model into the file, which the catalogue of `serve` would show
    #[arg(long)]
    no_thumbnail: bool,
}

/// Kinds of content.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    #[default]
    Auto,
    Scan,
    Terrain,
    Scene,
}

/// What becomes charts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum WithCharts {
    /// Scans with colours of vertices, unless they have images
    #[default]
    Auto,
    /// All scans, as far as they are fit for it
    Always,
    /// Nothing that clusters can hold
    Never,
}

/// Axes of the input.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum Axis {
    X,
    #[default]
    Y,
    Z,
}

pub(super) fn run(
    arguments: &Arguments,
    common: &Common,
    output: &Output,
) -> anyhow::Result<Verdict> {
    if matches!(arguments.kind, Kind::Terrain | Kind::Scene) || arguments.schedule.is_some() {
        bail!("this version converts scans only; leave out --kind and --schedule");
    }
    let [input] = arguments.inputs.as_slice() else {
        bail!(
            "{} inputs given, but a scan is made of one; merge them first",
            arguments.inputs.len()
        );
    };
    let options = Options {
        error_rel: arguments.error_rel,
        allow_worse: arguments.allow_worse,
        charts: match arguments.charts {
            WithCharts::Auto => Charts::Auto,
            WithCharts::Always => Charts::Always,
            WithCharts::Never => Charts::Never,
        },
        up: match arguments.up {
            Axis::X => Up::X,
            Axis::Y => Up::Y,
            Axis::Z => Up::Z,
        },
        memory_bytes: arguments.memory,
        thumbnail: !arguments.no_thumbnail,
        threads: common.threads.map(std::num::NonZeroUsize::get),
        ..Options::default()
    };
    let progress = Display::new(common.progress);
    let result = pipeline::convert(input, &arguments.output, &options, &progress);
    progress.finish();
    let report = result?;
    output.say(&summary(&report));
    output.report(&report)?;
    Ok(Verdict::Good)
}

fn summary(report: &Report) -> String {
    let (input, out, error) = (&report.input, &report.output, &report.error);
    let mut text = format!(
        "{}: {} triangles in {} components, {} holes\n\
         {}: {} charts, {} clusters, {} pages, {} ({:.2} bytes a triangle)\n\
         error: {:.2e} rms, at most {:.2e} of the diagonal (target {:.2e})\n\
         {:.1} s, {:.1} s of processor time, {} of memory",
        input.path,
        input.triangles,
        input.components,
        input.boundary_loops,
        out.path,
        out.charts,
        out.clusters.nodes,
        out.pages,
        output::bytes(out.bytes),
        out.bytes as f64 / input.triangles.max(1) as f64,
        error.rms_rel,
        error.max_rel,
        error.target_rel,
        report.seconds,
        report.cpu_seconds,
        output::bytes(report.peak_rss_bytes),
    );
    for reason in &report.lost.reason {
        text.push_str("\nleft out: ");
        text.push_str(reason);
    }
    text
}
