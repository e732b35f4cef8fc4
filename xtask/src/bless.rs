//! Writes golden files anew.

use crate::{process, project::Project};
use anyhow::Result;

/// Runs the golden tests with `MARQUETRY_BLESS=1`, which makes them write instead of compare.
///
/// Goldens of a released format version stay as they are: their tests know no blessing.
///
/// # Errors
/// When a test fails in spite of it.
pub(crate) fn run(project: &Project) -> Result<()> {
    println!("  writing golden files anew; read the difference before you commit it");
    process::run(
        process::cargo(&project.root)
            .args(["test", "--release", "--workspace", "golden"])
            .env("MARQUETRY_BLESS", "1"),
    )
}
