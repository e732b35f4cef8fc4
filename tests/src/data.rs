//! Scans that are too large, or not ours, to be in the repository.

use std::path::{Path, PathBuf};

/// The folder of shared data beside the checkout; it need not exist.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data")
}

/// A file of the shared data, if it is there. Says so on standard error where not: the test that asked is then ignored.
pub fn find(name: &str) -> Option<PathBuf> {
    let path = folder().join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("ignored: needs ../shared/data/{name}, which is not on this machine");
    None
}
