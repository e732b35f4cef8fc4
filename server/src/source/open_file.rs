//! One open file: one version of it, wherever it lies, and what its front says.

use super::ReadError;
use super::hot::HotBlocks;
use super::local::LocalFile;
use super::remote::{RemoteObject, RemoteVersion, Store};
use crate::conditional::whole_seconds;
use axum::http::HeaderValue;
use hyper::body::Bytes;
use marquetry_format::{ColourIndex, Document, Error, Limits, Opening, PageId, Step, TileId};
use std::ops::{Range, RangeInclusive};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::SystemTime;

/// Section that holds a thumbnail.
const THUMBNAIL: u32 = marquetry_format::header::SectionKind::Thumbnail as u32;

/// Where the bytes of one version are.
#[derive(Debug)]
pub(super) enum Handle {
    Local(Arc<LocalFile>, Arc<HotBlocks>),
    Remote(Arc<RemoteObject>),
}

impl Drop for Handle {
    fn drop(&mut self) {
        if let Self::Local(file, hot) = self {
            hot.forget(file);
        }
    }
}

impl Handle {
    fn length(&self) -> u64 {
        match self {
            Self::Local(file, _) => file.length(),
            Self::Remote(object) => object.version().length(),
        }
    }

    fn modified(&self) -> Option<SystemTime> {
        match self {
            Self::Local(file, _) => file.modified(),
            Self::Remote(object) => object.version().modified(),
        }
    }
}

/// A `.marq` file, opened.
#[derive(Debug)]
pub(crate) struct OpenFile {
    handle: Handle,
    /// Grows by index blocks as pages are asked for.
    document: RwLock<Document>,
    /// The same of colour tiles, where the file has them.
    tiles: Option<RwLock<ColourIndex>>,
    content_id: String,
    etag: HeaderValue,
    modified: Option<(SystemTime, HeaderValue)>,
}

/// Pages cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PagesError {
    #[error("page {page} of {count}")]
    Beyond { page: u32, count: u32 },
    #[error("more than {limit} bytes")]
    TooLong { limit: u64 },
    #[error(transparent)]
    Unreadable(#[from] ReadError),
}

impl OpenFile {
    /// Opens a file on disk, and makes sure that it was written to its end.
    pub(super) async fn local(file: LocalFile, hot: &Arc<HotBlocks>) -> Result<Self, ReadError> {
        let file = Self::open(Handle::Local(Arc::new(file), Arc::clone(hot))).await?;
        file.check_end().await?;
        Ok(file)
    }

    /// Opens `version` of the object at `relative`.
    pub(super) async fn remote(
        store: &Arc<Store>,
        relative: &str,
        version: RemoteVersion,
    ) -> Result<Self, ReadError> {
        let object = RemoteObject::new(store, relative, version)?;
        let file = Self::open(Handle::Remote(Arc::new(object))).await?;
        file.check_end().await?;
        Ok(file)
    }

    async fn open(handle: Handle) -> Result<Self, ReadError> {
        let length = handle.length();
        let (mut opening, mut range) = Opening::new(Limits::default());
        range.end = range.end.min(length);
        let document = loop {
            let bytes = read(&handle, range.clone()).await?;
            // A base of many megabytes takes a while to decode.
            let step = tokio::task::spawn_blocking(move || opening.feed(&bytes))
                .await
                .map_err(|_interrupted| ReadError::Interrupted)?;
            match step.map_err(|error| corrupt(&handle, &range, error))? {
                Step::Need(next, more) => {
                    let found = next.file_length().unwrap_or(more.end);
                    check_length(found, length)?;
                    (opening, range) = (next, more);
                }
                Step::Done(document) => {
                    check_length(document.file_length(), length)?;
                    break *document;
                }
            }
        };
        let content_id = document.content_id_hex();
        let tiles = ColourIndex::of(&document, Limits::default())
            .map_err(|error| corrupt(&handle, &(0..document.front_bytes()), error))?;
        let etag = HeaderValue::try_from(format!("\"{content_id}\""))
            .map_err(|_interrupted| ReadError::Interrupted)?;
        let modified = handle.modified().and_then(|time| {
            let text = httpdate::fmt_http_date(whole_seconds(time));
            Some((time, HeaderValue::try_from(text).ok()?))
        });
        Ok(Self {
            handle,
            document: RwLock::new(document),
            tiles: tiles.map(RwLock::new),
            content_id,
            etag,
            modified,
        })
    }

    /// Reads and checks the last page that is not empty. A file that is written from front to back, into a place of
    /// its full length, has its beginning before its end.
    async fn check_end(&self) -> Result<(), ReadError> {
        let mut last = self.look(Document::stored_page_count);
        // Root pages that the base has all of are empty, and there may be many; one block of them is enough to see.
        for _ in 0..1024 {
            let Some(page) = last.checked_sub(1) else {
                return Ok(());
            };
            last = page;
            match self.pages(page..=page, u64::MAX).await {
                Ok(bytes) if bytes.is_empty() => {}
                Ok(_) => return Ok(()),
                Err(PagesError::Unreadable(error)) => return Err(error),
                Err(_) => return Err(ReadError::Interrupted),
            }
        }
        Ok(())
    }

    /// Length in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.handle.length()
    }

    /// Content id, lower-case hexadecimal.
    pub(crate) fn content_id(&self) -> &str {
        &self.content_id
    }

    /// Strong entity tag of the whole file, quotes included.
    pub(crate) fn etag(&self) -> &HeaderValue {
        &self.etag
    }

    /// Date of the last change.
    pub(crate) fn modified(&self) -> Option<SystemTime> {
        self.modified.as_ref().map(|(time, _)| *time)
    }

    /// The same as a field of a header.
    pub(crate) fn last_modified(&self) -> Option<&HeaderValue> {
        self.modified.as_ref().map(|(_, value)| value)
    }

    /// The file on disk, if it is one.
    pub(super) fn as_local(&self) -> Option<&LocalFile> {
        match &self.handle {
            Handle::Local(file, _) => Some(file),
            Handle::Remote(_) => None,
        }
    }

    /// The version of the object, if it is one.
    pub(super) fn remote_version(&self) -> Option<&RemoteVersion> {
        match &self.handle {
            Handle::Local(..) => None,
            Handle::Remote(object) => Some(object.version()),
        }
    }

    /// Where a read from `start` should end at the latest, so that it copies nothing.
    pub(crate) fn convenient_end(&self, start: u64) -> u64 {
        match &self.handle {
            Handle::Local(..) => HotBlocks::end_of_block(start),
            Handle::Remote(_) => RemoteObject::end_of_block(start),
        }
    }

    /// Exactly the bytes of `range`, or an error when the file has changed.
    pub(crate) async fn read(&self, range: Range<u64>) -> Result<Bytes, ReadError> {
        read(&self.handle, range).await
    }

    /// As [`OpenFile::read`], where that does not have to wait.
    pub(crate) fn read_now(&self, range: &Range<u64>) -> Option<Result<Bytes, ReadError>> {
        match &self.handle {
            Handle::Local(file, hot) => hot.read_now(file, range),
            Handle::Remote(object) => object.read_now(range).map(Ok),
        }
    }

    /// The stored bytes of `pages`, one page after the other, each equal to its checksum.
    ///
    /// Index blocks are read on the way and kept. At most `limit_bytes` are read.
    pub(crate) async fn pages(
        &self,
        pages: RangeInclusive<u32>,
        limit_bytes: u64,
    ) -> Result<Bytes, PagesError> {
        let (first, last) = (PageId(*pages.start()), PageId(*pages.end()));
        let count = self.look(Document::stored_page_count);
        if last.0 >= count {
            return self.tiles(first, last, count, limit_bytes).await;
        }
        let range = if let Some(range) = self.range_of(first, last) {
            range
        } else {
            self.load_index_of(first, last).await?;
            let block = self.look(|document| document.index_block_of(first));
            self.range_of(first, last)
                .ok_or_else(|| ReadError::Corrupt(Arc::new(Error::IndexNotLoaded { block })))?
        };
        if range.end.saturating_sub(range.start) > limit_bytes {
            return Err(PagesError::TooLong { limit: limit_bytes });
        }
        let mut again = matches!(self.handle, Handle::Remote(_));
        loop {
            let bytes = match self.read_now(&range) {
                Some(result) => result?,
                None => self.read(range.clone()).await?,
            };
            match self.check_pages(first, last, range.start, &bytes) {
                Ok(()) => return Ok(bytes),
                Err(error) => {
                    let error = corrupt(&self.handle, &range, error);
                    // Something on the way may have spoilt what was right upstream.
                    if !std::mem::take(&mut again) {
                        return Err(error.into());
                    }
                }
            }
        }
    }

    /// The stored bytes of the colour tiles that have the page numbers `first` to `last`, of which the last is beyond the
    /// `pages` of the geometry.
    async fn tiles(
        &self,
        first: PageId,
        last: PageId,
        pages: u32,
        limit_bytes: u64,
    ) -> Result<Bytes, PagesError> {
        let beyond = |count| PagesError::Beyond {
            page: last.0,
            count,
        };
        let tiles = self.tiles.as_ref().ok_or_else(|| beyond(pages))?;
        let read = || tiles.read().unwrap_or_else(PoisonError::into_inner);
        let write = || tiles.write().unwrap_or_else(PoisonError::into_inner);
        if !read().has_directory() {
            let range = read().directory_range();
            let bytes = self.read(range.clone()).await?;
            let loaded = write().load_directory(&bytes);
            loaded.map_err(|error| corrupt(&self.handle, &range, error))?;
        }
        let count = pages.saturating_add(read().tile_count());
        // Pages and tiles do not lie side by side.
        let first = first.0.checked_sub(pages).ok_or_else(|| beyond(pages))?;
        if last.0 >= count {
            return Err(beyond(count));
        }
        let (first, last) = (TileId(first), TileId(last.0 - pages));
        let (from, to) = (read().block_of(first), read().block_of(last));
        for block in from..=to {
            if !read().has_block(block) {
                let range = read().block_range(block);
                let bytes = self.read(range.clone()).await?;
                let loaded = write().load_block(block, &bytes);
                loaded.map_err(|error| corrupt(&self.handle, &range, error))?;
            }
        }
        let range = {
            let index = read();
            index.tile_range(first).zip(index.tile_range(last))
        };
        let (start, end) = range
            .map(|(first, last)| (first.start, last.end))
            .ok_or(ReadError::Interrupted)?;
        if end.saturating_sub(start) > limit_bytes {
            return Err(PagesError::TooLong { limit: limit_bytes });
        }
        Ok(self.read(start..end).await?)
    }

    fn range_of(&self, first: PageId, last: PageId) -> Option<Range<u64>> {
        self.look(|document| document.page_range_bytes(first, last))
    }

    fn check_pages(
        &self,
        first: PageId,
        last: PageId,
        start: u64,
        bytes: &Bytes,
    ) -> Result<(), Error> {
        let document = self.document.read().unwrap_or_else(PoisonError::into_inner);
        for page in first.0..=last.0 {
            let place = document.page_range(PageId(page)).and_then(|range| {
                let at = |byte: u64| usize::try_from(byte.checked_sub(start)?).ok();
                bytes.get(at(range.start)?..at(range.end)?)
            });
            // An empty page has nothing to be wrong.
            match place {
                Some([]) => {}
                place => document.check_page(PageId(page), place.unwrap_or_default())?,
            }
        }
        Ok(())
    }

    /// Loads the index blocks of pages `first` to `last`, which exist.
    async fn load_index_of(&self, first: PageId, last: PageId) -> Result<(), ReadError> {
        // Clusters have no index blocks: the front says where they are.
        let blocks = self.look(|document| {
            let end = document.index_block_count();
            let last = document.index_block_of(last).saturating_add(1);
            document.index_block_of(first).min(end)..last.min(end)
        });
        for block in blocks {
            if self.look(|document| document.has_index_block(block)) {
                continue;
            }
            let range = self.look(|document| document.index_block_range(block));
            let bytes = self.read(range.clone()).await?;
            self.document
                .write()
                .unwrap_or_else(PoisonError::into_inner)
                .load_index_block(block, &bytes)
                .map_err(|error| corrupt(&self.handle, &range, error))?;
        }
        Ok(())
    }

    /// The picture stored in the file, a WebP file; `None` when there is none.
    pub(crate) async fn thumbnail(&self) -> Result<Option<Bytes>, ReadError> {
        let section = self.look(|document| {
            let sections = &document.header().sections;
            (sections.iter())
                .find(|section| section.kind == THUMBNAIL)
                .map(|section| (section.range.clone(), section.checksum))
        });
        let Some((range, checksum)) = section else {
            return Ok(None);
        };
        if range.end.saturating_sub(range.start) > marquetry_format::thumbnail::MAX_BYTES {
            return Ok(None);
        }
        let bytes = self.read(range.clone()).await?;
        let id = self.look(|document| document.content_id);
        let [a, b, c, d, e, f, g, h, ..] = id;
        let seed = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        let computed = xxhash_rust::xxh3::xxh3_64_with_seed(&bytes, seed);
        if computed != checksum {
            let error = Error::Checksum {
                what: "thumbnail",
                offset: range.start,
                stored: checksum,
                computed,
            };
            return Err(corrupt(&self.handle, &range, error));
        }
        Ok(Some(bytes))
    }

    /// What the catalogue says of it.
    pub(crate) fn facts(&self) -> Facts {
        self.look(|document| Facts {
            bytes: self.length(),
            content_id: self.content_id.clone(),
            modified: self.modified(),
            version: document.version(),
            charts: document.chart_count(),
            pages: document.stored_page_count(),
            front_bytes: document.front_bytes(),
            has_thumbnail: (document.header().sections.iter())
                .any(|section| section.kind == THUMBNAIL),
            metadata: document.metadata.clone(),
        })
    }

    fn look<T>(&self, look: impl FnOnce(&Document) -> T) -> T {
        look(&self.document.read().unwrap_or_else(PoisonError::into_inner))
    }
}

/// What the catalogue says of a file.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) bytes: u64,
    pub(crate) content_id: String,
    pub(crate) modified: Option<SystemTime>,
    pub(crate) version: (u16, u16),
    pub(crate) charts: u32,
    pub(crate) pages: u32,
    pub(crate) front_bytes: u64,
    pub(crate) has_thumbnail: bool,
    pub(crate) metadata: marquetry_format::Metadata,
}

async fn read(handle: &Handle, range: Range<u64>) -> Result<Bytes, ReadError> {
    match handle {
        Handle::Local(file, hot) => match hot.read_now(file, &range) {
            Some(result) => result,
            None => file.read_later(range).await,
        },
        Handle::Remote(object) => object.read(range).await,
    }
}

/// The error for bytes of `range` that are not what they should be.
fn corrupt(handle: &Handle, range: &Range<u64>, error: Error) -> ReadError {
    if let Handle::Remote(object) = handle {
        object.forget(range);
    }
    ReadError::Corrupt(Arc::new(error))
}

fn check_length(expected: u64, found: u64) -> Result<(), ReadError> {
    if expected == found {
        return Ok(());
    }
    let what = "file";
    Err(ReadError::Corrupt(Arc::new(if found < expected {
        Error::Truncated {
            what,
            expected,
            found,
        }
    } else {
        Error::TrailingBytes {
            what,
            expected,
            found,
        }
    })))
}
