//! Which compiler builds for wasm32.
//!
//! rustup's target where it is or can be had. Where its server is out of reach: Debian's `rustc-web`, whose
//! standard library is built from source along with us. Limit: Debian's has no clippy for wasm32.

use crate::process;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// The target's name.
pub(crate) const TARGET: &str = "wasm32-unknown-unknown";

/// What Debian calls its compiler and the source of its standard library.
pub(crate) const PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];

/// Longest wait for rustup's server.
const RUSTUP_LIMIT: Duration = Duration::from_secs(90);

const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";

/// Oldest minor version of Debian's compiler that builds us; the workspace's `rust-version`.
const OLDEST_MINOR: u32 = 95;

/// A compiler for wasm32.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Toolchain {
    /// The one that runs us, with its target installed.
    Rustup,
    /// Debian's, with this linker.
    Debian {
        /// `rust-lld`, or a `wasm-ld`.
        linker: PathBuf,
    },
}

impl Toolchain {
    /// The compiler to use; `MARQUETRY_WASM=debian` or `rustup` asks for one of the two.
    pub(crate) fn find() -> Option<Self> {
        let wanted = std::env::var("MARQUETRY_WASM").unwrap_or_default();
        let rustup = || (wanted != "debian" && rustup_has_target()).then_some(Self::Rustup);
        let debian = || (wanted != "rustup").then(debian).flatten();
        rustup().or_else(debian)
    }

    /// A cargo command that compiles with it, `arguments` after the subcommand's name.
    pub(crate) fn cargo(&self, root: &Path, subcommand: &str) -> Command {
        match self {
            Self::Rustup => {
                let mut command = process::cargo(root);
                command.args([subcommand, "--target", TARGET]);
                command
            }
            Self::Debian { linker } => {
                let mut command = Command::new(DEBIAN_CARGO);
                // What rustup's cargo sets for us would lead Debian's astray.
                for name in ["CARGO", "RUSTUP_TOOLCHAIN", "RUSTDOC", "RUSTC_WRAPPER"] {
                    command.env_remove(name);
                }
                command
                    .current_dir(root)
                    .env("RUSTC", DEBIAN_RUSTC)
                    // The standard library needs unstable features to be built at all.
                    .env("RUSTC_BOOTSTRAP", "1")
                    .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker)
                    .args([
                        subcommand,
                        "-Zbuild-std=std,panic_abort",
                        "--target",
                        TARGET,
                    ]);
                command
            }
        }
    }

    /// In words, with the time a first build takes.
    pub(crate) fn describe(&self) -> &'static str {
        match self {
            Self::Rustup => "rustup's wasm32 target (two to four minutes the first time)",
            Self::Debian { .. } => {
                "Debian's rustc-web and std from source (four to eight minutes the first time)"
            }
        }
    }
}

/// Asks rustup for the target, for a limited time. A refusal is no error: Debian's compiler is next.
///
/// # Errors
/// When rustup is there but cannot be started.
pub(crate) fn try_rustup() -> Result<()> {
    if process::find("rustup").is_none()
        || std::env::var("MARQUETRY_WASM").is_ok_and(|wanted| wanted == "debian")
    {
        return Ok(());
    }
    let added = process::run_within(
        Command::new("rustup").args(["target", "add", TARGET]),
        RUSTUP_LIMIT,
    )?;
    if !added {
        println!("  rustup cannot fetch the target here; using Debian's compiler");
    }
    Ok(())
}

fn rustup_has_target() -> bool {
    process::output(Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]))
        .is_ok_and(|folder| holds_core(Path::new(folder.trim())))
}

fn holds_core(folder: &Path) -> bool {
    std::fs::read_dir(folder).is_ok_and(|entries| {
        entries.flatten().any(|entry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            name.starts_with("libcore-") && name.ends_with(".rlib")
        })
    })
}

fn debian() -> Option<Toolchain> {
    if !Path::new(DEBIAN_CARGO).is_file() || !Path::new(DEBIAN_RUSTC).is_file() {
        return None;
    }
    let version = process::output(Command::new(DEBIAN_RUSTC).arg("--version")).ok()?;
    if minor(&version)? < OLDEST_MINOR {
        return None;
    }
    let sysroot = process::output(Command::new(DEBIAN_RUSTC).args(["--print", "sysroot"])).ok()?;
    let source = Path::new(sysroot.trim()).join("lib/rustlib/src/rust/library/std/Cargo.toml");
    if !source.is_file() {
        return None;
    }
    Some(Toolchain::Debian {
        linker: linker().ok()?,
    })
}

/// The minor version in `rustc 1.96.0 (…)`.
fn minor(version: &str) -> Option<u32> {
    version
        .split_whitespace()
        .nth(1)?
        .split('.')
        .nth(1)?
        .parse()
        .ok()
}

fn linker() -> Result<PathBuf> {
    let sysroot = process::output(Command::new("rustc").args(["--print", "sysroot"]))?;
    let version = process::output(Command::new("rustc").arg("-vV"))?;
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .context("rustc names no host")?;
    let own = Path::new(sysroot.trim())
        .join("lib/rustlib")
        .join(host)
        .join("bin/rust-lld");
    if own.is_file() {
        return Ok(own);
    }
    ["wasm-ld", "wasm-ld-19", "wasm-ld-16", "wasm-ld-14"]
        .iter()
        .find_map(|name| process::find(name))
        .context("no linker for wasm32: install lld")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minor_version_is_read() {
        assert_eq!(
            minor("rustc 1.96.0 (ac68faa20 2026-05-25) (built from a source tarball)"),
            Some(96)
        );
        assert_eq!(minor("rustc"), None);
        assert_eq!(minor(""), None);
    }

    #[test]
    fn the_oldest_version_is_the_workspaces() {
        let wanted = env!("CARGO_PKG_RUST_VERSION");
        assert_eq!(
            wanted.split('.').nth(1),
            Some(OLDEST_MINOR.to_string().as_str())
        );
    }

    #[test]
    fn an_empty_folder_holds_no_target() {
        assert!(!holds_core(Path::new("/no/such/folder")));
    }
}
