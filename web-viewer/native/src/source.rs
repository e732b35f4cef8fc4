//! Where a `.marq` file comes from: the disk, or an HTTP server that answers range requests.

mod http;

pub use http::HttpSource;

use marquetry_format::{ByteSource, FileSource, SourceError};
use std::path::Path;
use std::sync::Arc;

/// Opens a path, or a URL that starts with `http://` or `https://`.
///
/// # Errors
/// When the file cannot be opened, or the server does not have it or does not serve ranges of it.
pub fn open(path_or_url: &str) -> Result<Box<dyn ByteSource>, SourceError> {
    let scheme = path_or_url
        .split_once("://")
        .map(|(scheme, _)| scheme.to_ascii_lowercase());
    if matches!(scheme.as_deref(), Some("http" | "https")) {
        Ok(Box::new(HttpSource::open(path_or_url)?))
    } else {
        Ok(Box::new(FileSource::open(Path::new(path_or_url))?))
    }
}

/// The same, to be shared between threads.
///
/// # Errors
/// As [`open`].
pub fn open_shared(path_or_url: &str) -> Result<Arc<dyn ByteSource>, SourceError> {
    open(path_or_url).map(Arc::from)
}
