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
use marquetry_evaluation::distance::{self, Mesh, NormalDeviation, OneWay};
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
    let distances =
        distance::measure(measured, input.mesh(), arguments.samples).with_context(|| {
            format!(
                "{} and {} cannot be compared",
                arguments.file,
                arguments.against.display()
            )
        })?;
    let rel = |length: f64| input.rel(length);
    let one_way = |way: OneWay| OneWayRel {
        max_rel: rel(way.max),
        rms_rel: rel(way.rms),
    };
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
    };
    output.say(&describe(&report));
    output.report(&report)?;
    Ok(Verdict::Good)
}

fn describe(report: &Report) -> String {
    format!(
        "{} triangles, {}, {} samples each way; lengths relative to the diagonal\n\
         hausdorff  {:.3e} (bound {:.3e})\n\
         rms        {:.3e}\n\
         forward    {:.3e} max, {:.3e} rms (file to input)\n\
         backward   {:.3e} max, {:.3e} rms (input to file)\n\
         normals    {:.2} degrees mean, {:.2} at the 95th percentile",
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
    )
}
