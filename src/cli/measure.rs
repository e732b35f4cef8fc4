//! `marquetry measure`: how far a file's surface is from the input.
//!
//! *Forward* is from the file's surface to the input, *backward* from the input to the file's surface.
//! The symmetric numbers are the larger of the two. Maxima are over samples and all vertices, so they are
//! lower bounds of the true ones; the file's own bound (`info`) is an upper one.

use super::output::{self, Output};
use super::reference::Reference;
use super::surface::{self, Wanted};
use super::{Verdict, open};
use anyhow::Context;
use marquetry_evaluation::distance::{self, Borders, Mesh, NormalDeviation, OneWay};
use serde::Serialize;
use std::path::PathBuf;

/// Measure the geometric accuracy of a file against its input
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
    /// The scan to compare with
    #[arg(long, value_name = "INPUT")]
    against: PathBuf,
    /// Samples each way, beside all vertices
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,
    /// Measure the finest uniform cut of at most N triangles
    #[arg(long, value_name = "N", conflicts_with = "bytes")]
    triangles: Option<u64>,
    /// Measure the finest uniform cut that takes at most N bytes to read
    #[arg(long, value_name = "N", value_parser = super::args::bytes)]
    bytes: Option<u64>,
}

/// Distances are relative to the diagonal of the input's bounds.
#[derive(Debug, Serialize)]
struct Report {
    hausdorff_rel: f64,
    rms_rel: f64,
    forward: OneWayRel,
    backward: OneWayRel,
    normal_deviation_deg: NormalDeviation,
    triangles: u64,
    bytes: u64,
    samples: u64,
    /// What the file guarantees for this cut.
    bound_rel: f64,
    borders: BordersReport,
}

/// Open borders: edges that one triangle alone has.
#[derive(Debug, Serialize)]
struct BordersReport {
    /// Length of all of them, in the file and in the input.
    file_length_rel: f64,
    input_length_rel: f64,
    /// Distances between them; none where either has no borders.
    #[serde(flatten)]
    distances: Option<BorderDistances>,
}

#[derive(Debug, Serialize)]
struct BorderDistances {
    hausdorff_rel: f64,
    rms_rel: f64,
    forward: OneWayRel,
    backward: OneWayRel,
}

#[derive(Debug, Serialize)]
struct OneWayRel {
    max_rel: f64,
    rms_rel: f64,
}

pub(super) fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<Verdict> {
    let wanted = match (arguments.triangles, arguments.bytes) {
        (Some(most), _) => Wanted::Triangles(most),
        (None, Some(most)) => Wanted::Bytes(most),
        (None, None) => Wanted::Finest,
    };
    let opened = open::open_indexed(&arguments.file)?;
    let surface = surface::extract(&arguments.file, &opened, wanted)?;
    let input = Reference::load(&arguments.against)?;
    let measured = Mesh {
        positions: &surface.positions,
        triangles: &surface.triangles,
    };
    let not_comparable = || {
        format!(
            "{} and {} cannot be compared",
            arguments.file,
            arguments.against.display()
        )
    };
    let distances = distance::measure(measured, input.mesh(), arguments.samples)
        .with_context(not_comparable)?;
    let rel = |length: f64| input.rel(length);
    let one_way = |way: OneWay| OneWayRel::of(way, &input);
    let borders = borders(measured, &input, arguments.samples).with_context(not_comparable)?;
    let report = Report {
        hausdorff_rel: rel(distances.hausdorff()),
        rms_rel: rel(distances.rms()),
        forward: one_way(distances.forward),
        backward: one_way(distances.backward),
        normal_deviation_deg: distances.normal_deviation_deg,
        triangles: surface.triangles.len() as u64,
        bytes: surface.bytes,
        samples: distances.samples,
        bound_rel: surface.error_rel,
        borders,
    };
    output.say(&describe(&report));
    output.report(&report)?;
    Ok(Verdict::Good)
}

impl OneWayRel {
    fn of(way: OneWay, input: &Reference) -> Self {
        Self {
            max_rel: input.rel(way.max),
            rms_rel: input.rel(way.rms),
        }
    }
}

fn borders(measured: Mesh<'_>, input: &Reference, samples: u64) -> anyhow::Result<BordersReport> {
    let (ours, theirs) = (Borders::of(measured)?, Borders::of(input.mesh())?);
    let distances = ours.measure(&theirs, samples)?;
    Ok(BordersReport {
        file_length_rel: input.rel(ours.length()),
        input_length_rel: input.rel(theirs.length()),
        distances: distances.map(|[forward, backward]| BorderDistances {
            hausdorff_rel: input.rel(forward.max.max(backward.max)),
            rms_rel: input.rel(forward.rms.max(backward.rms)),
            forward: OneWayRel::of(forward, input),
            backward: OneWayRel::of(backward, input),
        }),
    })
}

fn describe_borders(borders: &BordersReport) -> String {
    let lengths = format!(
        "{:.3} long in the file, {:.3} in the input",
        borders.file_length_rel, borders.input_length_rel
    );
    match &borders.distances {
        Some(distances) => format!(
            "{:.3e} max, {:.3e} rms; {lengths}",
            distances.hausdorff_rel, distances.rms_rel
        ),
        None if borders.file_length_rel == 0.0 && borders.input_length_rel == 0.0 => {
            "none in either".to_owned()
        }
        None => lengths,
    }
}

fn describe(report: &Report) -> String {
    format!(
        "{} triangles, {}, {} samples each way; lengths relative to the diagonal\n\
         hausdorff  {:.3e} (bound {:.3e})\n\
         rms        {:.3e}\n\
         forward    {:.3e} max, {:.3e} rms (file to input)\n\
         backward   {:.3e} max, {:.3e} rms (input to file)\n\
         normals    {:.2} degrees mean, {:.2} at the 95th percentile\n\
         borders    {}",
        report.triangles,
        output::bytes(report.bytes),
        report.samples,
        report.hausdorff_rel,
        report.bound_rel,
        report.rms_rel,
        report.forward.max_rel,
        report.forward.rms_rel,
        report.backward.max_rel,
        report.backward.rms_rel,
        report.normal_deviation_deg.mean,
        report.normal_deviation_deg.p95,
        describe_borders(&report.borders),
    )
}
