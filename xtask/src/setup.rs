//! Installs what the machine misses: Debian packages with apt, JavaScript packages with npm.
//!
//! Limit: only Debian-like systems are set up; elsewhere the missing things are named.

use crate::{process, wasm};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Names that Chromium goes by.
const CHROMIUM: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];

/// What one command needs of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Need {
    /// A C compiler, for zstd.
    Compiler,
    /// Node and npm.
    Node,
    /// A Vulkan driver; the software one will do.
    Vulkan,
    /// A browser with WebGPU.
    Chromium,
    /// A compiler for wasm32.
    Wasm,
    /// A web server to compare with.
    Nginx,
    /// Python with its environments.
    Python,
}

impl Need {
    fn is_met(self) -> bool {
        match self {
            Self::Compiler => process::find("cc").is_some(),
            Self::Node => process::find("node").is_some() && process::find("npm").is_some(),
            Self::Vulkan => has_vulkan(),
            Self::Chromium => chromium().is_some(),
            Self::Wasm => wasm::Toolchain::find().is_some(),
            Self::Nginx => {
                process::find("nginx").is_some() || Path::new("/usr/sbin/nginx").is_file()
            }
            Self::Python => {
                process::succeeds(Command::new("python3").args(["-c", "import venv, ensurepip"]))
            }
        }
    }

    fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Compiler => &["build-essential"],
            Self::Node => &["nodejs", "npm"],
            Self::Vulkan => &["libvulkan1", "mesa-vulkan-drivers"],
            Self::Chromium => &["chromium"],
            Self::Wasm => &wasm::PACKAGES,
            Self::Nginx => &["nginx"],
            Self::Python => &["python3", "python3-venv"],
        }
    }
}

/// Installs what of `needs` is missing.
///
/// # Errors
/// When something is missing and cannot be installed here; the message says how to.
pub(crate) fn ensure(needs: &[Need]) -> Result<()> {
    if needs.contains(&Need::Wasm) && !Need::Wasm.is_met() {
        wasm::try_rustup()?;
    }
    let missing = || {
        needs
            .iter()
            .copied()
            .filter(|need| !need.is_met())
            .collect::<Vec<_>>()
    };
    let before = missing();
    if before.is_empty() {
        println!("  nothing is missing");
        return Ok(());
    }
    let packages: Vec<&str> = before
        .iter()
        .flat_map(|need| need.packages())
        .copied()
        .collect();
    println!(
        "  missing: {before:?}; installing {} (one to three minutes)",
        packages.join(" ")
    );
    install(&packages)?;
    let after = missing();
    if !after.is_empty() {
        bail!(
            "{after:?} still missing after installing {}",
            packages.join(" ")
        );
    }
    Ok(())
}

/// The browser to test with; `CHROMIUM` names another.
pub(crate) fn chromium() -> Option<PathBuf> {
    match std::env::var_os("CHROMIUM") {
        Some(path) => Some(PathBuf::from(path)).filter(|path| path.is_file()),
        None => CHROMIUM.iter().find_map(|name| process::find(name)),
    }
}

/// Installs the locked packages of `folder` unless they are there.
///
/// # Errors
/// When npm fails.
pub(crate) fn npm(folder: &Path) -> Result<()> {
    let lock = folder.join("package-lock.json");
    // npm leaves a copy of the lock in node_modules, written last.
    let installed = folder.join("node_modules/.package-lock.json");
    if newer(&installed, &lock) {
        return Ok(());
    }
    process::run(Command::new("npm").current_dir(folder).args([
        "ci",
        "--no-audit",
        "--no-fund",
        "--loglevel=error",
    ]))
}

/// Whether `output` exists and is not older than `input`.
pub(crate) fn newer(output: &Path, input: &Path) -> bool {
    let time = |path: &Path| path.metadata().and_then(|metadata| metadata.modified());
    matches!((time(output), time(input)), (Ok(output), Ok(input)) if output >= input)
}

fn install(packages: &[&str]) -> Result<()> {
    let line = format!(
        "apt-get install -y --no-install-recommends {}",
        packages.join(" ")
    );
    let Some(apt) = process::find("apt-get") else {
        bail!(
            "this is no Debian-like system: install what Debian calls {} and run again",
            packages.join(" ")
        );
    };
    let prefix: &[&str] = if is_root() {
        &[]
    } else if process::find("sudo").is_some()
        && process::succeeds(Command::new("sudo").args(["-n", "true"]))
    {
        &["sudo", "-n"]
    } else {
        bail!("no right to install packages; run this and then again:\n  sudo {line}");
    };
    let apt = |arguments: &[&str]| {
        let words: Vec<_> = prefix
            .iter()
            .map(AsRef::as_ref)
            .chain([apt.as_os_str()])
            .collect();
        let (program, rest) = words.split_first().context("no program to run")?;
        process::run(
            Command::new(program)
                .args(rest)
                .args(arguments)
                .env("DEBIAN_FRONTEND", "noninteractive"),
        )
    };
    let install: Vec<&str> = ["install", "-y", "-qq", "--no-install-recommends"]
        .into_iter()
        .chain(packages.iter().copied())
        .collect();
    // The package lists of a fresh machine are empty or old; reading them anew costs time on every other.
    if apt(&install).is_err() {
        apt(&["update", "-qq"])?;
        apt(&install).with_context(|| format!("cannot install; try by hand:\n  {line}"))?;
    }
    Ok(())
}

fn is_root() -> bool {
    process::output(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

fn has_vulkan() -> bool {
    let folder_holds = |folder: &str, end: &str| {
        std::fs::read_dir(folder).is_ok_and(|entries| {
            entries
                .flatten()
                .any(|entry| entry.file_name().to_string_lossy().ends_with(end))
        })
    };
    let driver = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .any(|folder| folder_holds(folder, ".json"));
    let loader =
        process::output(Command::new("sh").args(["-c", "PATH=$PATH:/sbin:/usr/sbin ldconfig -p"]))
            .is_ok_and(|list| list.contains("libvulkan.so.1"));
    driver && loader
}
