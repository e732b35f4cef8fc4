//! `cargo xtask conformance`: the server judged by programs that others wrote.
//!
//! No registry within reach has h2spec. In its place `tests/http/http2.py` speaks HTTP/2 through the Python package
//! `h2`, which ends a connection on every violation of RFC 9113 that it sees, and sends frames that are wrong, byte by
//! byte, to see the errors that the RFC demands. `REDbot`, an HTTP linter, judges the headers of every kind of response.

use crate::setup::{self, Need};
use crate::traffic::serve_for_checks;
use crate::{process, project::Project, tools};
use anyhow::Result;
use std::process::Command;

/// Runs both.
///
/// # Errors
/// When something is missing, or a check fails.
pub(crate) fn run(project: &Project) -> Result<()> {
    setup::ensure(&[Need::Python, Need::Node])?;
    tools::install(project)?;
    let python = tools::python(project).join("bin/python");
    let server = serve_for_checks(project)?;
    for script in ["http2.py", "linter.py"] {
        process::run(
            Command::new(&python)
                .arg(project.root.join("tests/http").join(script))
                .arg(server.address.to_string()),
        )?;
    }
    Ok(())
}
