//! Programs from `PyPI`: an S3 server and checkers of HTTP, which tests of the server talk to, a spelling checker, and distances
//! between meshes that ours are compared with.

use crate::{process, project::Project};
use anyhow::Result;
use std::path::PathBuf;
use std::process::Command;

/// What is installed, at the versions that the tests were made with.
const PACKAGES: [&str; 5] = [
    "moto[server]==5.2.5",
    "h2==4.4.1",
    "redbot==2.7.1",
    "typos==1.52.0",
    "point-cloud-utils==0.34.0",
];

/// Where: tests look there.
pub(crate) fn python(project: &Project) -> PathBuf {
    project.target.join("tools/python")
}

/// Installs them unless they are there (about one minute).
///
/// # Errors
/// When Python or `PyPI` fails.
pub(crate) fn install(project: &Project) -> Result<()> {
    let folder = python(project);
    let stamp = folder.join("installed.txt");
    let wanted = PACKAGES.join("\n");
    if std::fs::read_to_string(&stamp).is_ok_and(|found| found == wanted) {
        println!("  {} are installed", PACKAGES.join(", "));
        return Ok(());
    }
    process::run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    process::run(
        Command::new(folder.join("bin/pip"))
            .args(["install", "--quiet", "--disable-pip-version-check"])
            .args(PACKAGES),
    )?;
    std::fs::write(stamp, wanted)?;
    Ok(())
}
