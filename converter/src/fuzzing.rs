//! Entry points for the fuzz targets: any bytes as a mesh file, as far as the manifold, and all the way to a file.
#![allow(
    clippy::expect_used,
    clippy::missing_panics_doc,
    clippy::panic,
    reason = "a panic is what a fuzz target looks for"
)]

use crate::import::import_bytes;
use crate::mesh;
use crate::pipeline::{self, Charts, Options, Progress};
use marquetry_format::source::FileSource;
use marquetry_format::verify::verify;
use std::path::Path;

/// Imports `data` under a name with the extension `extension`, and makes a manifold of what was read.
pub fn import(data: &[u8], extension: &str) {
    let name = format!("fuzz.{extension}");
    let Ok((imported, report)) = import_bytes(data.to_vec(), Path::new(&name)) else {
        return;
    };
    assert_eq!(report.triangles, imported.triangles.len() as u64);
    let vertices = imported.positions.len();
    assert!(
        imported
            .triangles
            .iter()
            .flatten()
            .all(|&v| (v as usize) < vertices)
    );
    let Ok((manifold, account)) = mesh::prepare(imported) else {
        return;
    };
    manifold.check().expect("the manifold keeps its promises");
    account.check().expect("every triangle is accounted for");
}

struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str) {}
    fn fraction(&self, _: f64) {}
}

/// Converts `data`, coarsely, and verifies what was written.
pub fn convert(data: &[u8], extension: &str) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let input = folder.path().join(format!("fuzz.{extension}"));
    let output = folder.path().join("fuzz.marq");
    std::fs::write(&input, data).expect("room for temporary files");
    let options = Options {
        error_rel: 2e-2,
        allow_worse: true,
        // Both ways get their turn.
        charts: if data.len().is_multiple_of(2) {
            Charts::Always
        } else {
            Charts::Auto
        },
        threads: Some(1),
        ..Options::default()
    };
    if pipeline::convert(&input, &output, &options, &Silent).is_err() {
        assert!(!output.exists(), "a conversion that failed leaves no file");
        return;
    }
    let source = FileSource::open(&output).expect("the file is there");
    let report = verify(&source).expect("the file opens");
    let failed: Vec<_> = report.checks.iter().filter(|check| !check.ok).collect();
    assert!(report.ok, "the file does not verify: {failed:?}");
}

#[cfg(test)]
mod tests;
