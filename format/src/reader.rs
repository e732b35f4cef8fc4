//! Opening a file and decoding its pages.
//!
//! [`Opening`] is a state machine without I/O, for async callers; [`Document::open`] drives it over a
//! blocking [`ByteSource`](crate::ByteSource).

use crate::{
    ByteSource, Chart, ChartId, Error, Limits, Metadata, NodeId, PageEntry, PageId, PageSamples, Quadrant,
};
use std::ops::Range;

/// Bytes of the first read of a file.
pub const FIRST_READ_BYTES: u64 = 64 * 1024;

/// A file being opened.
#[derive(Debug)]
pub struct Opening {}

/// What an [`Opening`] wants next.
#[derive(Debug)]
pub enum Step {
    /// Feed these bytes.
    Need(Opening, Range<u64>),
    /// Open.
    Done(Box<Document>),
}

impl Opening {
    /// Starts; the first read is bytes `0..min(FIRST_READ_BYTES, length)`; a shorter answer means a short file.
    pub fn new(limits: Limits) -> (Self, Range<u64>) {
        let _ = limits;
        (Self {}, 0..FIRST_READ_BYTES)
    }

    /// Takes the bytes asked for. At most two reads in all.
    ///
    /// # Errors
    /// When the bytes are no valid front of a `.marq` file.
    pub fn feed(self, bytes: &[u8]) -> Result<Step, Error> {
        let _ = bytes;
        unimplemented!()
    }
}

/// An open file: everything at its front, and the index blocks read so far. Holds no source.
#[derive(Debug)]
pub struct Document {
    /// Content id: names this content, and seeds every checksum.
    pub content_id: [u8; 16],
    /// Metadata.
    pub metadata: Metadata,
    /// Charts with their glue.
    pub charts: Vec<Chart>,
    /// Resolution that the base holds every chart at (or its own, where that is less).
    pub base_resolution: u8,
    /// The base: per chart its samples at `min(chart.resolution, base_resolution)`.
    pub base: Vec<PageSamples>,
}

impl Document {
    /// Opens from a blocking source, with at most two reads.
    ///
    /// # Errors
    /// When the source fails or the front of the file is not valid.
    pub fn open(source: &dyn ByteSource, limits: Limits) -> Result<Self, Error> {
        let _ = (source, limits);
        unimplemented!()
    }

    /// Content id as lower-case hexadecimal.
    pub fn content_id_hex(&self) -> String {
        unimplemented!()
    }

    /// Pages of the file.
    pub fn page_count(&self) -> u32 {
        unimplemented!()
    }

    /// Index blocks of the file.
    pub fn index_block_count(&self) -> u32 {
        unimplemented!()
    }

    /// The index block that holds `page`.
    pub fn index_block_of(&self, page: PageId) -> u32 {
        let _ = page;
        unimplemented!()
    }

    /// Where index block `block` lies in the file.
    pub fn index_block_range(&self, block: u32) -> Range<u64> {
        let _ = block;
        unimplemented!()
    }

    /// Whether index block `block` was loaded.
    pub fn has_index_block(&self, block: u32) -> bool {
        let _ = block;
        unimplemented!()
    }

    /// Checks and takes an index block.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode.
    pub fn load_index_block(&mut self, block: u32, bytes: &[u8]) -> Result<(), Error> {
        let _ = (block, bytes);
        unimplemented!()
    }

    /// Loads every index block not yet loaded.
    ///
    /// # Errors
    /// When the source fails or a block is not valid.
    pub fn load_index(&mut self, source: &dyn ByteSource) -> Result<(), Error> {
        let _ = source;
        unimplemented!()
    }

    /// The entry of `page`; `None` while its index block is not loaded, or beyond the last page.
    pub fn page(&self, page: PageId) -> Option<&PageEntry> {
        let _ = page;
        unimplemented!()
    }

    /// First of the four children of `page`; `None` without children or while its block is not loaded.
    pub fn first_child(&self, page: PageId) -> Option<PageId> {
        let _ = page;
        unimplemented!()
    }

    /// The page of `node`, found from its chart's root; `None` where the tree or the loaded index ends before.
    pub fn page_of_node(&self, node: NodeId) -> Option<PageId> {
        let _ = node;
        unimplemented!()
    }

    /// Checks and decodes a root page; needs nothing but the base.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode to the exact size.
    pub fn decode_root(&self, chart: ChartId, bytes: &[u8]) -> Result<PageSamples, Error> {
        let _ = (chart, bytes);
        unimplemented!()
    }

    /// Checks and decodes a page below the root from its parent's samples.
    ///
    /// # Errors
    /// As [`Document::decode_root`].
    pub fn decode_child(
        &self,
        page: PageId,
        quadrant: Quadrant,
        parent: &PageSamples,
        bytes: &[u8],
    ) -> Result<PageSamples, Error> {
        let _ = (page, quadrant, parent, bytes);
        unimplemented!()
    }
}
