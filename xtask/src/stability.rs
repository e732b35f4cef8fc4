//! `cargo xtask stability`: the design's list of cases that methods fail on.

use crate::setup::{self, Need};
use crate::{process, project::Project, test};
use anyhow::Result;
use std::process::Command;

/// Runs the cases whose part and name have all `words`; all of them are written to `docs/stability.md`.
///
/// # Errors
/// When something cannot be built, or a case misses what is required of it.
pub(crate) fn run(project: &Project, words: &[&str]) -> Result<()> {
    setup::ensure(&[Need::Compiler, Need::Vulkan])?;
    test::build_native(project, &["--bins", "--examples"])?;
    let mut command = Command::new(project.target.join("release/examples/stability"));
    command
        .current_dir(&project.root)
        .env("MARQUETRY_BINARY", project.binary());
    if words.is_empty() {
        command
            .arg("--write")
            .arg(project.root.join("docs/stability.md"));
    }
    process::run(command.args(words))
}
