//! Where bytes come from.

use std::ops::Range;

/// A range of bytes could not be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The source ends before the range does.
    #[error("bytes {start}..{end} asked for, but the source ends at {length}")]
    OutOfRange {
        /// First byte asked for.
        start: u64,
        /// One past the last byte asked for.
        end: u64,
        /// Length of the source.
        length: u64,
    },
    /// Reading failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Anything else, in words (HTTP status, …).
    #[error("{0}")]
    Other(String),
}

/// Random access to bytes, blocking. Async callers drive [`Opening`](crate::Opening) themselves.
pub trait ByteSource: Send + Sync {
    /// Total length in bytes.
    ///
    /// # Errors
    /// When the source cannot be asked.
    fn length(&self) -> Result<u64, SourceError>;

    /// Exactly the bytes of `range`.
    ///
    /// # Errors
    /// When the range cannot be read whole.
    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError>;
}
