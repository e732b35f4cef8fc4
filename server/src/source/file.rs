//! One open file.

use super::Facts;
use marquetry_format::{
    ByteSource, ColourIndex, Document, Error, Limits, PageId, SourceError, TileId,
};
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
    /// The same of colour tiles, where the file has them.
    tiles: Option<RwLock<ColourIndex>>,
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
        let tiles = ColourIndex::of(&document, Limits::default())?;
        Ok(Self {
            handle,
            document: RwLock::new(document),
            tiles: tiles.map(RwLock::new),
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

    /// The stored bytes of `pages`, one page after the other; numbers after the last page are those of colour tiles.
    ///
    /// Index blocks are read on the way and kept. At most `limit_bytes` are read.
    pub(crate) fn read_pages(
        &self,
        pages: RangeInclusive<u32>,
        limit_bytes: u64,
    ) -> Result<Vec<u8>, PagesError> {
        let (first, last) = (PageId(*pages.start()), PageId(*pages.end()));
        let count = self.read_document(Document::stored_page_count);
        let range = if last.0 < count {
            self.load_index_of(first, last)?;
            self.read_document(|document| document.page_range_bytes(first, last))
        } else {
            self.tile_range(first, last, count)?
        };
        let range = range.ok_or_else(|| {
            let what = format!("pages {} to {} have no valid place", first.0, last.0);
            Error::from(SourceError::Other(what))
        })?;
        if range.end.saturating_sub(range.start) > limit_bytes {
            return Err(PagesError::TooLong { limit: limit_bytes });
        }
        Ok(self.read(range).map_err(Error::from)?)
    }

    /// Where the tiles lie that have the page numbers `first` to `last`, of which the last is beyond the `pages` of the
    /// geometry.
    fn tile_range(
        &self,
        first: PageId,
        last: PageId,
        pages: u32,
    ) -> Result<Option<Range<u64>>, PagesError> {
        let beyond = |count| PagesError::Beyond {
            page: last.0,
            count,
        };
        let tiles = self.tiles.as_ref().ok_or_else(|| beyond(pages))?;
        let read = || tiles.read().unwrap_or_else(PoisonError::into_inner);
        let write = || tiles.write().unwrap_or_else(PoisonError::into_inner);
        if !read().has_directory() {
            let range = read().directory_range();
            let bytes = self.read(range).map_err(Error::from)?;
            write().load_directory(&bytes)?;
        }
        let count = pages.saturating_add(read().tile_count());
        let (Some(first), Some(end)) = (first.0.checked_sub(pages), last.0.checked_sub(pages))
        else {
            // Pages and tiles do not lie side by side.
            return Err(beyond(pages));
        };
        if last.0 >= count {
            return Err(beyond(count));
        }
        let (first, last) = (TileId(first), TileId(end));
        let blocks = read().block_of(first)..=read().block_of(last);
        for block in blocks {
            if !read().has_block(block) {
                let range = read().block_range(block);
                let bytes = self.read(range).map_err(Error::from)?;
                write().load_block(block, &bytes)?;
            }
        }
        let index = read();
        let range = index.tile_range(first).zip(index.tile_range(last));
        Ok(range.map(|(first, last)| first.start..last.end))
    }

    /// Loads the index blocks of pages `first` to `last`, which exist.
    fn load_index_of(&self, first: PageId, last: PageId) -> Result<(), Error> {
        // Clusters have no index blocks: the front says where they are.
        let blocks = self.read_document(|document| {
            let end = document.index_block_count();
            let last = document.index_block_of(last).saturating_add(1);
            document.index_block_of(first).min(end)..last.min(end)
        });
        for block in blocks {
            if self.read_document(|document| document.has_index_block(block)) {
                continue;
            }
            let range = self.read_document(|document| document.index_block_range(block));
            let bytes = self.read(range)?;
            self.document
                .write()
                .unwrap_or_else(PoisonError::into_inner)
                .load_index_block(block, &bytes)?;
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn handle(path: &Path) -> Handle {
        let file = File::open(path).unwrap();
        let version = Version::of(&file.metadata().unwrap());
        Handle { file, version }
    }

    #[test]
    fn a_replaced_file_is_read_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let [path, new] = ["a", "b"].map(|name| folder.path().join(name));
        std::fs::write(&path, b"old").unwrap();
        std::fs::write(&new, b"new").unwrap();
        let handle = handle(&path);
        std::fs::rename(&new, &path).unwrap();
        assert_eq!(handle.read(0..3).unwrap(), b"old");
        assert_ne!(Version::of_path(&path).unwrap(), handle.version);
    }

    #[test]
    fn a_file_changed_in_place_is_not_read_any_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123456789").unwrap();
        let longer = handle(&path);
        std::fs::write(&path, b"01234567890").unwrap();
        assert!(longer.read(0..3).is_err());
        let shorter = handle(&path);
        std::fs::write(&path, b"0").unwrap();
        assert!(shorter.read(0..3).is_err());
    }

    #[test]
    fn ranges_outside_the_file_are_refused_before_memory_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123").unwrap();
        let handle = handle(&path);
        assert_eq!(handle.read(1..4).unwrap(), b"123");
        assert!(handle.read(4..4).unwrap().is_empty());
        #[expect(
            clippy::reversed_empty_ranges,
            reason = "what a broken index might say"
        )]
        for range in [0..5, 5..6, 3..2, 0..u64::MAX] {
            assert!(matches!(
                handle.read(range),
                Err(SourceError::OutOfRange { .. })
            ));
        }
    }
}
