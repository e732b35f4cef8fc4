//! What can be wrong with a file.

use crate::source::SourceError;

/// A file that cannot be read, and why.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
}
