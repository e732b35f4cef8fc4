//! Scans made up for the server to serve, and their `.marq` files.

use crate::{ensure, process, project::Project};
use anyhow::{Context, Result};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Quads along one side of the made-up scan.
const SIDE: usize = 220;

/// A `.marq` file of a made-up bumpy sheet; another one for every `seed`.
pub(crate) fn marq(project: &Project, folder: &Path, seed: u32) -> Result<PathBuf> {
    let output = folder.join(format!("{seed}.marq"));
    let input = folder.join(format!("{seed}.ply"));
    std::fs::write(&input, ply(seed)).context("cannot write a scan")?;
    process::run(
        Command::new(project.binary())
            .arg("convert")
            .arg(&input)
            .arg("-o")
            .arg(&output)
            .args([
                "--error-rel",
                "2e-5",
                "--allow-worse",
                "--progress",
                "never",
            ]),
    )?;
    let length = output.metadata().map_or(0, |metadata| metadata.len());
    ensure(length > 310_000, || {
        format!("{} has only {length} bytes", output.display())
    })?;
    Ok(output)
}

fn ply(seed: u32) -> String {
    let across = SIDE + 1;
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        across * across,
        2 * SIDE * SIDE
    );
    let phase = f64::from(seed);
    for j in 0..across {
        for i in 0..across {
            let (x, y) = (i as f64 / SIDE as f64, j as f64 / SIDE as f64);
            let mut z = 0.0;
            for octave in 1..6 {
                let f = f64::from(1 << octave);
                z += ((x * f * 3.1 + phase).sin() * (y * f * 2.7 - phase).cos()) / f;
            }
            // Writing to a string does not fail.
            let _ = writeln!(text, "{x:.6} {y:.6} {:.6}", z * 0.2);
        }
    }
    for j in 0..SIDE {
        for i in 0..SIDE {
            let a = j * across + i;
            let (b, c, d) = (a + 1, a + across + 1, a + across);
            let _ = writeln!(text, "3 {a} {b} {c}\n3 {a} {c} {d}");
        }
    }
    text
}
