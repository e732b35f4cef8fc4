//! Checks everything a reader relies on.

use crate::{ByteSource, Error};

/// One check and how it went.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Check {
    /// What was checked.
    pub name: String,
    /// Whether nothing failed.
    pub ok: bool,
    /// How many things were checked.
    pub count: u64,
    /// The first failures, in words (at most 20).
    pub failures: Vec<String>,
}

/// All checks of a file.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Report {
    /// Whether all checks passed.
    pub ok: bool,
    /// The checks.
    pub checks: Vec<Check>,
}

/// Verifies a whole file: structure, checksums, glue both ways, shared borders bit-equal, errors monotone, balance.
///
/// # Errors
/// When the file cannot be opened at all; every later fault is in the report.
pub fn verify(source: &dyn ByteSource) -> Result<Report, Error> {
    let _ = source;
    unimplemented!()
}
