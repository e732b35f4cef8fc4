//! Where things are.

use crate::process;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};

/// Folders of this checkout.
#[derive(Debug)]
pub(crate) struct Project {
    /// Root of the workspace.
    pub root: PathBuf,
    /// Cargo's target folder; honours `CARGO_TARGET_DIR`.
    pub target: PathBuf,
}

impl Project {
    /// Finds the project that this program was built from.
    ///
    /// # Errors
    /// When cargo cannot say where it builds.
    pub(crate) fn locate() -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .context("xtask lies in no workspace")?
            .to_path_buf();
        let text = process::output(process::cargo(&root).args([
            "metadata",
            "--no-deps",
            "--format-version=1",
            "--color=never",
        ]))?;
        let metadata: serde_json::Value =
            serde_json::from_str(&text).context("cargo metadata is no JSON")?;
        let target = metadata["target_directory"]
            .as_str()
            .context("cargo metadata names no target folder")?;
        Ok(Self {
            root,
            target: PathBuf::from(target),
        })
    }

    /// The release build of the `marquetry` binary, or what `MARQUETRY_BINARY` names.
    pub(crate) fn binary(&self) -> PathBuf {
        match std::env::var_os("MARQUETRY_BINARY") {
            Some(path) => PathBuf::from(path),
            None => self.target.join("release").join("marquetry"),
        }
    }

    /// Where the browser build is put.
    pub(crate) fn dist(&self) -> PathBuf {
        self.root.join("web-viewer/web/dist")
    }

    /// Where the browser test lives.
    pub(crate) fn browser_test(&self) -> PathBuf {
        self.root.join("tests/browser")
    }

    /// What the demo downloads and converts; ignored by git.
    pub(crate) fn demo(&self) -> PathBuf {
        self.root.join("demo")
    }
}
