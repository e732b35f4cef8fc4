//! The directory: where the index blocks are, and what of each must be known before it is read.

use crate::bytes::Cursor;
use crate::header::Section;
use crate::index::BLOCK_PAGES;
use crate::{Error, Limits};
use std::ops::Range;

const WHAT: &str = "directory";
/// Bytes of one record.
const RECORD_BYTES: u64 = 24;

/// What the directory says of one index block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BlockRecord {
    /// Bytes of the file.
    pub(crate) range: Range<u64>,
    /// xxh3-64 of the block.
    pub(crate) checksum: u64,
    /// Where the block's first page lies in the file.
    pub(crate) first_page_offset: u64,
    /// The first child of the block's first page that has children, as a page id.
    pub(crate) first_child: u32,
}

/// The directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Directory {
    pub(crate) page_count: u32,
    /// Bytes of all pages: geometry, normals, colours.
    pub(crate) part_bytes: [u64; 3],
    pub(crate) blocks: Vec<BlockRecord>,
}

impl Directory {
    /// Reads the directory of a file with these sections and `chart_count` charts.
    pub(crate) fn parse(
        bytes: &[u8],
        index: &Section,
        pages: &Section,
        chart_count: u32,
        limits: &Limits,
    ) -> Result<Self, Error> {
        let mut cursor = Cursor::new(WHAT, bytes);
        let page_count = cursor.u32()?;
        let block_count = cursor.u32()?;
        let part_bytes = [cursor.u64()?, cursor.u64()?, cursor.u64()?];
        if page_count > limits.pages {
            let (limit, found) = (u64::from(limits.pages), u64::from(page_count));
            return Err(Error::Limit {
                what: "pages",
                limit,
                found,
            });
        }
        if page_count < chart_count || page_count.saturating_sub(chart_count) % 4 != 0 {
            return Err(Error::Value {
                what: "number of pages",
                found: u64::from(page_count),
            });
        }
        let expected = u64::from(page_count.div_ceil(BLOCK_PAGES));
        if u64::from(block_count) != expected {
            return Err(Error::Mismatch {
                what: "index blocks",
                expected,
                found: u64::from(block_count),
            });
        }
        let parts = part_bytes
            .iter()
            .fold(0u64, |sum, &part| sum.saturating_add(part));
        if parts != pages.length() {
            return Err(Error::Mismatch {
                what: "bytes of all pages",
                expected: pages.length(),
                found: parts,
            });
        }
        let mut records = Cursor::new(WHAT, cursor.rest());
        let mut blocks: Vec<BlockRecord> = Vec::new();
        let (mut offset, mut child, mut page_offset) =
            (index.range.start, chart_count, pages.range.start);
        for block in 0..block_count {
            let first_page_offset = records.u64()?;
            let checksum = records.u64()?;
            let length = records.u32()?;
            let first_child = records.u32()?;
            let ordered = first_page_offset >= page_offset && first_page_offset <= pages.range.end;
            if !ordered || (block == 0 && first_page_offset != pages.range.start) {
                return Err(Error::Value {
                    what: "offset of an index block's pages",
                    found: first_page_offset,
                });
            }
            let ordered = first_child >= child && first_child <= page_count;
            if !ordered
                || first_child.saturating_sub(child) % 4 != 0
                || (block == 0 && first_child != chart_count)
            {
                return Err(Error::Value {
                    what: "first child of an index block",
                    found: u64::from(first_child),
                });
            }
            (page_offset, child) = (first_page_offset, first_child);
            let end = offset.saturating_add(u64::from(length));
            blocks.push(BlockRecord {
                range: offset..end,
                checksum,
                first_page_offset,
                first_child,
            });
            offset = end;
        }
        records.finish()?;
        if offset != index.range.end {
            return Err(Error::Mismatch {
                what: "end of the index blocks",
                expected: index.range.end,
                found: offset,
            });
        }
        Ok(Self {
            page_count,
            part_bytes,
            blocks,
        })
    }

    /// Bytes of a directory of `block_count` blocks.
    pub(crate) fn encoded_length(block_count: u32) -> u64 {
        RECORD_BYTES
            .saturating_mul(u64::from(block_count))
            .saturating_add(32)
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = self.page_count.to_le_bytes().to_vec();
        out.extend(
            u32::try_from(self.blocks.len())
                .unwrap_or(u32::MAX)
                .to_le_bytes(),
        );
        out.extend(self.part_bytes.iter().flat_map(|part| part.to_le_bytes()));
        for block in &self.blocks {
            out.extend(block.first_page_offset.to_le_bytes());
            out.extend(block.checksum.to_le_bytes());
            let length = block.range.end.saturating_sub(block.range.start);
            out.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
            out.extend(block.first_child.to_le_bytes());
        }
        out
    }
}
