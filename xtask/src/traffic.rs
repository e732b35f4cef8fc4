//! Measurements of the server under load, on this machine and its loopback interface alone.

pub(crate) mod bench;
pub(crate) mod soak;

mod client;
mod crowd;
mod nginx;
mod origin;
mod process_of;
mod scans;

use crate::{ensure, project::Project};
use anyhow::{Context, Result};
use process_of::Process;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A server of one made-up scan, called `scan`.
///
/// # Errors
/// When the binary is not built, or does not start.
pub(crate) fn serve_for_checks(project: &Project) -> Result<Process> {
    ensure(project.binary().is_file(), || {
        "the binary is not built: cargo build --release".to_owned()
    })?;
    let folder = project.target.join("conformance");
    let site = folder.join("site");
    std::fs::create_dir_all(&site).context("cannot make a folder")?;
    let scan = scans::marq(project, &folder, 1)?;
    std::fs::copy(scan, site.join("scan.marq")).context("cannot copy the file to serve")?;
    Process::marquetry(
        Command::new(project.binary())
            .arg("serve")
            .arg(site)
            .args(["--listen", "127.0.0.1:0"]),
    )
}

/// Numbers that look random and are the same in every run (xorshift64*).
#[derive(Debug)]
pub(crate) struct Random(AtomicU64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(AtomicU64::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1))
    }

    /// Less than `end`, which is not 0.
    pub(crate) fn below(&self, end: u64) -> u64 {
        let mut state = self.0.load(Relaxed);
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        self.0.store(state, Relaxed);
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 16) % end
    }
}

/// The middle one of `values`.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
