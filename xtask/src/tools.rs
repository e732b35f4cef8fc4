//! Programs from `PyPI` and npm: object stores and checkers of HTTP, which tests of the server talk to, a spelling checker, and
//! distances between meshes that ours are compared with.

use crate::{process, project::Project};
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is installed, at the versions that the tests were made with.
const PACKAGES: [&str; 5] = [
    "moto[server]==5.2.5",
    "h2==4.4.1",
    "redbot==2.7.1",
    "typos==1.52.0",
    "point-cloud-utils==0.34.0",
];

/// Azure's object store, of npm.
const AZURITE: &str = "azurite@3.37.0";

/// Where: tests look there.
pub(crate) fn python(project: &Project) -> PathBuf {
    project.target.join("tools/python")
}

/// Installs them unless they are there (about two minutes).
///
/// # Errors
/// When Python, npm, `PyPI` or npm's registry fails.
pub(crate) fn install(project: &Project) -> Result<()> {
    let folder = python(project);
    if !is_installed(&folder, &PACKAGES) {
        process::run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        process::run(
            Command::new(folder.join("bin/pip"))
                .args(["install", "--quiet", "--disable-pip-version-check"])
                .args(PACKAGES),
        )?;
        mark(&folder, &PACKAGES)?;
    }
    let folder = project.target.join("tools/node");
    if !is_installed(&folder, &[AZURITE]) {
        std::fs::create_dir_all(&folder)?;
        process::run(
            Command::new("npm")
                .args(["install", "--no-audit", "--no-fund", "--prefix"])
                .arg(&folder)
                .arg(AZURITE),
        )?;
        mark(&folder, &[AZURITE])?;
    }
    println!("  {} and {AZURITE} are installed", PACKAGES.join(", "));
    Ok(())
}

/// The file that says what is installed in a folder.
fn stamp(folder: &Path) -> PathBuf {
    folder.join("installed.txt")
}

fn is_installed(folder: &Path, packages: &[&str]) -> bool {
    std::fs::read_to_string(stamp(folder)).is_ok_and(|found| found == packages.join("\n"))
}

fn mark(folder: &Path, packages: &[&str]) -> Result<()> {
    Ok(std::fs::write(stamp(folder), packages.join("\n"))?)
}
