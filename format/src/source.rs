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

/// Bytes in memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SliceSource<T>(pub T);

impl<T: AsRef<[u8]> + Send + Sync> ByteSource for SliceSource<T> {
    fn length(&self) -> Result<u64, SourceError> {
        Ok(self.0.as_ref().len() as u64)
    }

    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        let bytes = self.0.as_ref();
        let ends = (
            usize::try_from(range.start).ok(),
            usize::try_from(range.end).ok(),
        );
        let slice = match ends {
            (Some(start), Some(end)) => bytes.get(start..end),
            _ => None,
        };
        slice.map(<[u8]>::to_vec).ok_or(SourceError::OutOfRange {
            start: range.start,
            end: range.end,
            length: bytes.len() as u64,
        })
    }
}

impl ByteSource for Vec<u8> {
    fn length(&self) -> Result<u64, SourceError> {
        Ok(self.len() as u64)
    }

    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        SliceSource(self.as_slice()).read(range)
    }
}

/// A file, read at offsets, by any number of threads at once.
#[cfg(any(unix, windows))]
#[derive(Debug)]
pub struct FileSource {
    file: std::fs::File,
    length: u64,
}

#[cfg(any(unix, windows))]
impl FileSource {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &std::path::Path) -> Result<Self, SourceError> {
        let file = std::fs::File::open(path)?;
        let metadata = file.metadata()?;
        if metadata.is_dir() {
            return Err(SourceError::Other("is a folder, not a file".to_owned()));
        }
        Ok(Self {
            file,
            length: metadata.len(),
        })
    }
}

#[cfg(any(unix, windows))]
impl ByteSource for FileSource {
    fn length(&self) -> Result<u64, SourceError> {
        Ok(self.length)
    }

    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        let Range { start, end } = range;
        let outside = SourceError::OutOfRange {
            start,
            end,
            length: self.length,
        };
        if start > end || end > self.length {
            return Err(outside);
        }
        let Ok(count) = usize::try_from(end.saturating_sub(start)) else {
            return Err(outside);
        };
        let mut bytes = vec![0; count];
        read_exact_at(&self.file, &mut bytes, start)?;
        Ok(bytes)
    }
}

#[cfg(unix)]
fn read_exact_at(file: &std::fs::File, bytes: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(
    file: &std::fs::File,
    mut bytes: &mut [u8],
    mut offset: u64,
) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[read..];
        offset += read as u64;
    }
    Ok(())
}
