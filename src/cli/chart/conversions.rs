//! Converting the input again: time and bytes against error.

use super::data::ConversionPoint;
use anyhow::Context;
use marquetry_converter::pipeline::{self, Charts, Options, Progress, Up};
use marquetry_evaluation::pareto;
use std::path::Path;

/// Progress of one conversion as a part of all.
struct Part<'a> {
    done: f64,
    all: f64,
    tell: &'a (dyn Fn(f64) + Sync),
}

impl Progress for Part<'_> {
    fn stage(&self, _: &'static str) {
        (self.tell)(self.done / self.all);
    }

    fn fraction(&self, _: f64) {}
}

/// Converts `input` at every RMS error of `errors_rel`, into files in `folder` that are gone afterwards. Files above the
/// target are counted with what they have.
///
/// # Errors
/// When a conversion fails.
pub(super) fn points(
    input: &Path,
    errors_rel: &[f64],
    charts: Charts,
    up: Up,
    threads: Option<usize>,
    folder: &Path,
    tell: &(dyn Fn(f64) + Sync),
) -> anyhow::Result<Vec<ConversionPoint>> {
    let mut points = Vec::new();
    for (number, &error_rel) in errors_rel.iter().enumerate() {
        let options = Options {
            error_rel,
            allow_worse: true,
            charts,
            up,
            threads,
            ..Options::default()
        };
        let output = folder.join("again.marq");
        let progress = Part {
            done: number as f64,
            all: errors_rel.len() as f64,
            tell,
        };
        let report = pipeline::convert(input, &output, &options, &progress)
            .with_context(|| format!("converting again at an error of {error_rel:e}"))?;
        std::fs::remove_file(&output).context("a converted file cannot be removed")?;
        points.push(ConversionPoint {
            error_rel,
            seconds: report.seconds,
            // The report's own sum counts from the start of the process.
            cpu_seconds: report.stages.iter().map(|stage| stage.cpu_seconds).sum(),
            bytes: report.output.bytes,
            rms_rel: report.error.rms_rel,
            max_rel: report.error.max_rel,
            on_front: false,
        });
    }
    let pairs: Vec<_> = points.iter().map(|p| (p.seconds, p.rms_rel)).collect();
    for (point, on_front) in points.iter_mut().zip(pareto::front(&pairs)) {
        point.on_front = on_front;
    }
    Ok(points)
}
