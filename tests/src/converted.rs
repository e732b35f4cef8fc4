//! Conversions that several tests share.
//!
//! A scan takes up to a minute to convert, and every test binary is a process of its own. So results are kept in the
//! target folder under a name made of the binary's bytes, the input's bytes and the options: a new binary never sees an
//! old result.

use crate::{arguments, binary};
use anyhow::{Context, Result};
use serde_json::Value;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use xxhash_rust::xxh3::xxh3_128;

/// A converted file and the converter's report on it.
#[derive(Debug, Clone)]
pub struct Converted {
    /// The `.marq` file.
    pub path: PathBuf,
    /// As `convert --json` wrote it.
    pub report: Value,
}

impl Converted {
    /// Length of the file.
    ///
    /// # Errors
    /// When it cannot be asked.
    pub fn bytes(&self) -> Result<u64> {
        Ok(self
            .path
            .metadata()
            .with_context(|| self.path.display().to_string())?
            .len())
    }
}

/// Options of `convert`: its defaults, which make clusters of scans without colours, and charts of all that is fit for them.
pub const BOTH_WAYS: [&[&str]; 2] = [&[], WITH_CHARTS];

/// Options of `convert` that make charts.
pub const WITH_CHARTS: &[&str] = &["--charts", "always"];

/// Converts `input` with the real binary, or finds what an equal conversion has left.
///
/// # Errors
/// When the conversion fails, with what it said.
pub fn convert(input: &Path, options: &[&str]) -> Result<Converted> {
    // One at a time: conversions use every core anyway, and two tests may want the same one.
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = folder()?;
    let mut key = binary_hash()?.to_le_bytes().to_vec();
    key.extend(std::fs::read(input).with_context(|| input.display().to_string())?);
    key.extend(options.join("\0").as_bytes());
    let name = input
        .file_name()
        .and_then(|name| name.to_str())
        .context("the input has no name")?;
    let stem = name.split('.').next().unwrap_or(name);
    let path = folder.join(format!("{stem}-{:032x}.marq", xxh3_128(&key)));
    let report_path = path.with_extension("json");
    // The report is written last, so where it is, both are whole.
    if !report_path.exists() {
        let partial = path.with_extension("partial.json");
        let mut arguments = arguments!["convert", input, "-o", &path, "--json", &partial];
        arguments.extend(options.iter().map(OsString::from));
        binary::marquetry(&arguments)?
            .succeeded()
            .with_context(|| format!("converting {name}"))?;
        std::fs::rename(&partial, &report_path).context("no report was written")?;
    }
    drop(turn);
    let report = std::fs::read(&report_path).with_context(|| report_path.display().to_string())?;
    let report = serde_json::from_slice(&report).context("the report is no JSON")?;
    Ok(Converted { path, report })
}

fn folder() -> Result<PathBuf> {
    let test = std::env::current_exe().context("cannot find the running test")?;
    // target/PROFILE/deps/TEST; cargo keeps target/tmp for its tests.
    let target = test
        .ancestors()
        .nth(3)
        .context("the test lies in no target folder")?;
    let folder = target.join("tmp").join("converted");
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

fn binary_hash() -> Result<u128> {
    static HASH: OnceLock<u128> = OnceLock::new();
    if let Some(&hash) = HASH.get() {
        return Ok(hash);
    }
    let path = binary::path()?;
    let bytes = std::fs::read(&path).with_context(|| path.display().to_string())?;
    Ok(*HASH.get_or_init(|| xxh3_128(&bytes)))
}
