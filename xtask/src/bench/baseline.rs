//! The revision that is compared with, and its binary.

use super::git;
use crate::{process, project::Project};
use anyhow::{Context, Result};
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// A revision that is built.
#[derive(Debug)]
pub(super) struct Baseline {
    /// Short hash and subject.
    pub name: String,
    /// Its `marquetry`.
    pub binary: PathBuf,
}

/// The last tag before this revision; without one, where this branch left `main`; on `main` itself, the revision before.
///
/// # Errors
/// When git does not know.
pub(super) fn default(project: &Project) -> Result<String> {
    let ask = |arguments: &[&str]| {
        let output = Command::new("git")
            .current_dir(&project.root)
            .args(arguments)
            .stderr(Stdio::null())
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
        (output.status.success() && !text.is_empty()).then_some(text)
    };
    let head = git(project, &["rev-parse", "HEAD"])?;
    let candidates = [
        ask(&["describe", "--tags", "--abbrev=0", "HEAD~1"]),
        ask(&["merge-base", "HEAD", "main"]),
    ];
    let other = candidates.into_iter().flatten().find(|text| *text != head);
    Ok(other.unwrap_or_else(|| "HEAD~1".to_owned()))
}

/// Hash and subject of what is built here, and whether there is more in the working tree.
///
/// # Errors
/// When git does not know.
pub(super) fn present(project: &Project) -> Result<String> {
    let name = described(project, "HEAD")?;
    let changes = git(project, &["status", "--porcelain", "--untracked-files=no"])?;
    let is_clean = changes
        .lines()
        .all(|line| line.ends_with("docs/measurements.md"));
    Ok(if is_clean {
        name
    } else {
        format!("{name}, with changes")
    })
}

fn described(project: &Project, revision: &str) -> Result<String> {
    git(project, &["log", "-1", "--format=%h (%s)", revision])
}

/// Builds `revision` in a worktree of its own, unless its binary is there. All baselines share a target folder, so that dependencies are
/// built once.
///
/// # Errors
/// When there is no such revision, or it cannot be built.
pub(super) fn build(project: &Project, revision: &str) -> Result<Baseline> {
    let commit = format!("{revision}^{{commit}}");
    let hash = git(project, &["rev-parse", "--verify", &commit])
        .with_context(|| format!("there is no revision {revision}"))?;
    let bench = project.target.join("bench");
    let binary = bench.join("binaries").join(&hash);
    let name = described(project, &hash)?;
    if binary.is_file() {
        println!("  {name} is built");
        return Ok(Baseline { name, binary });
    }
    println!("  building {name}: about 10 minutes the first time, 3 for another revision");
    let tree = bench.join(&hash);
    let tree_text = tree.display().to_string();
    if !tree.is_dir() {
        git(project, &["worktree", "prune"])?;
        git(project, &["worktree", "add", "--detach", &tree_text, &hash])?;
    }
    let target = bench.join("build");
    process::run(
        process::cargo(&tree)
            .args(["build", "--release", "--locked", "--bins"])
            .arg("--target-dir")
            .arg(&target),
    )?;
    std::fs::create_dir_all(bench.join("binaries")).context("cannot make a folder")?;
    std::fs::copy(target.join("release/marquetry"), &binary).context("cannot keep the binary")?;
    git(project, &["worktree", "remove", "--force", &tree_text])?;
    Ok(Baseline { name, binary })
}
