//! One open file.

use super::Facts;
use marquetry_format::{ByteSource, Document, Error, Limits, PageId, SourceError};
use std::fs::{File, Metadata};
use std::io;
use std::ops::{Range, RangeInclusive};
use std::path::Path;
use std::sync::{PoisonError, RwLock};
use std::time::SystemTime;

/// What tells one version of a file from the next. Two versions written within the resolution of the
/// file system's clock, in place and to the same length, cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Version {
    length: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl Version {
    /// The version now under `path`.
    pub(crate) fn of_path(path: &Path) -> io::Result<Self> {
        std::fs::metadata(path).map(|metadata| Self::of(&metadata))
    }

    fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let inode = std::os::unix::fs::MetadataExt::ino(metadata);
        #[cfg(not(unix))]
        let inode = 0;
        Self {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            inode,
        }
    }
}

/// A handle on one version of a file: a read fails once the file was changed in place.
#[derive(Debug)]
struct Handle {
    file: File,
    version: Version,
}

impl ByteSource for Handle {
    fn length(&self) -> Result<u64, SourceError> {
        Ok(self.version.length)
    }

    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        let Range { start, end } = range;
        let length = self.version.length;
        if start > end || end > length {
            return Err(SourceError::OutOfRange { start, end, length });
        }
        let size =
            usize::try_from(end - start).map_err(|error| SourceError::Other(error.to_string()))?;
        let mut bytes = vec![0; size];
        read_exact_at(&self.file, &mut bytes, start)?;
        if Version::of(&self.file.metadata()?) != self.version {
            return Err(SourceError::Other(
                "the file was changed while it was read".into(),
            ));
        }
        Ok(bytes)
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        offset += read as u64;
        bytes = &mut bytes[read..];
    }
    Ok(())
}

/// A `.marq` file, opened: one version of it. Its methods block on the disk.
#[derive(Debug)]
pub(crate) struct OpenFile {
    handle: Handle,
    /// Grows by index blocks as pages are asked for.
    document: RwLock<Document>,
    content_id: String,
}

/// Pages cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PagesError {
    #[error("page {page} of {count}")]
    Beyond { page: u32, count: u32 },
    #[error("more than {limit} bytes")]
    TooLong { limit: u64 },
    #[error(transparent)]
    Unreadable(#[from] Error),
}

impl OpenFile {
    /// Opens `path` and reads its front.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(SourceError::from)?;
        let metadata = file.metadata().map_err(SourceError::from)?;
        if !metadata.is_file() {
            return Err(SourceError::Other("not a regular file".into()).into());
        }
        let version = Version::of(&metadata);
        let handle = Handle { file, version };
        let document = Document::open(&handle, Limits::default())?;
        let content_id = document.content_id_hex();
        Ok(Self {
            handle,
            document: RwLock::new(document),
            content_id,
        })
    }

    /// Length in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.handle.version.length
    }

    /// Which version this is.
    pub(crate) fn version(&self) -> Version {
        self.handle.version
    }

    /// Content id, lower-case hexadecimal.
    pub(crate) fn content_id(&self) -> &str {
        &self.content_id
    }

    /// Exactly the bytes of `range`, or an error when the file has changed.
    pub(crate) fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        self.handle.read(range)
    }

    /// The stored bytes of `pages`, one page after the other.
    ///
    /// Index blocks are read on the way and kept. At most `limit_bytes` are read.
    pub(crate) fn read_pages(
        &self,
        pages: RangeInclusive<u32>,
        limit_bytes: u64,
    ) -> Result<Vec<u8>, PagesError> {
        let count = self.read_document(Document::page_count);
        let last = *pages.end();
        if last >= count {
            return Err(PagesError::Beyond { page: last, count });
        }
        // Pages that lie side by side in the file are read at once.
        let mut runs: Vec<Range<u64>> = Vec::new();
        let mut total = 0;
        for page in pages {
            let range = self.page_range(PageId(page))?;
            total += range.end - range.start;
            if total > limit_bytes {
                return Err(PagesError::TooLong { limit: limit_bytes });
            }
            match runs.last_mut() {
                Some(run) if run.end == range.start => run.end = range.end,
                _ if range.is_empty() => {}
                _ => runs.push(range),
            }
        }
        let mut bytes = Vec::new();
        for run in runs {
            let part = self.read(run).map_err(Error::from)?;
            if bytes.is_empty() {
                bytes = part;
            } else {
                bytes.extend_from_slice(&part);
            }
        }
        Ok(bytes)
    }

    /// Where `page`, which exists, lies in the file.
    fn page_range(&self, page: PageId) -> Result<Range<u64>, Error> {
        let block = self.read_document(|document| document.index_block_of(page));
        if !self.read_document(|document| document.has_index_block(block)) {
            let range = self.read_document(|document| document.index_block_range(block));
            let bytes = self.read(range)?;
            self.document
                .write()
                .unwrap_or_else(PoisonError::into_inner)
                .load_index_block(block, &bytes)?;
        }
        let range = self.read_document(|document| {
            let entry = document.page(page)?;
            Some(entry.offset..entry.offset.checked_add(u64::from(entry.length))?)
        });
        // A file whose index does not cover its own pages.
        range
            .ok_or_else(|| SourceError::Other(format!("page {} has no valid place", page.0)).into())
    }

    /// What the catalogue says of it.
    pub(crate) fn facts(&self) -> Facts {
        Facts {
            bytes: self.length(),
            content_id: self.content_id.clone(),
            metadata: self.read_document(|document| document.metadata.clone()),
        }
    }

    fn read_document<T>(&self, look: impl FnOnce(&Document) -> T) -> T {
        look(&self.document.read().unwrap_or_else(PoisonError::into_inner))
    }
}
