//! The browser test: the real page from the real server in headless Chromium.

use crate::setup::{self, Need};
use crate::{ensure, process, project::Project};
use anyhow::{Context, Result};
use std::process::Command;

/// Runs the page's unit tests, then `tests/browser/run.mjs` on the release binary.
///
/// # Errors
/// When something is missing, or the test fails.
pub(crate) fn run(project: &Project) -> Result<()> {
    setup::ensure(&[Need::Node, Need::Vulkan, Need::Chromium])?;
    let binary = project.binary();
    ensure(binary.is_file(), || {
        format!("{} is not built: cargo build --release", binary.display())
    })?;
    let folder = project.browser_test();
    setup::npm(&folder)?;
    process::run(
        Command::new("node")
            .current_dir(&folder)
            .args(["--test", "--test-reporter=dot"]),
    )?;
    let chromium = setup::chromium().context("no Chromium")?;
    process::run(
        Command::new("node")
            .current_dir(&project.root)
            .arg(folder.join("run.mjs"))
            .arg("--marquetry")
            .arg(binary)
            .arg("--chromium")
            .arg(chromium)
            .arg("--out")
            .arg(project.target.join("browser")),
    )
}
