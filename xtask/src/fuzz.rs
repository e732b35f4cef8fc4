//! The fuzz targets, which search for what the mutants of `cargo test` do not find.

use crate::process;
use crate::project::Project;
use anyhow::{Context, Result, bail};

/// Seconds that each target runs unless told otherwise.
pub(crate) const SECONDS: u32 = 60;

/// Runs every fuzz target for so many seconds; stops at the first that fails.
///
/// They want flags of a nightly compiler, which the stable one takes with `RUSTC_BOOTSTRAP`; without a sanitizer they need
/// no other standard library.
///
/// # Errors
/// When libFuzzer or cargo-fuzz cannot be had, and when a target fails.
pub(crate) fn run(project: &Project, seconds: u32) -> Result<()> {
    if process::find("c++").is_none() {
        bail!("there is no C++ compiler for libFuzzer");
    }
    if process::find("cargo-fuzz").is_none() {
        process::run(process::cargo(&project.root).args(["install", "--locked", "cargo-fuzz"]))
            .context("cargo-fuzz cannot be installed")?;
    }
    println!(
        "Fuzzing: {seconds} s for each of a dozen targets, after ten minutes of building the first time."
    );
    let limit = format!("-max_total_time={seconds}");
    for package in ["format", "converter", "server"] {
        let fuzz = |arguments: &[&str]| {
            let mut command = process::cargo(&project.root.join(package));
            command
                .arg("fuzz")
                .args(arguments)
                .env("RUSTC_BOOTSTRAP", "1");
            command
        };
        let targets = process::output(&mut fuzz(&["list"]))?;
        for target in targets.lines().filter(|target| !target.is_empty()) {
            process::run(&mut fuzz(&[
                "run",
                "--sanitizer",
                "none",
                target,
                "--",
                &limit,
                "-timeout=60",
                "-max_len=16384",
            ]))?;
        }
    }
    Ok(())
}
