//! Where the tiles of an open file are; grows by its directory and index blocks as they are read.

use super::block::{self, BlockPlace};
use super::directory::Directory;
use super::{BLOCK_TILES, TexelSize, TileEntry, TileId, TileTexels, decode_vp8};
use crate::header::{SectionKind, check, checksum};
use crate::{ByteSource, ChartId, Document, Error, ImageTask, Limits, Quadrant};
use std::ops::Range;

const NONE: u32 = u32::MAX;

/// The index of a file's colour tiles. Holds no source.
#[derive(Debug, Clone)]
pub struct ColourIndex {
    content_id: [u8; 16],
    limits: Limits,
    chart_count: usize,
    page_count: u32,
    directory_range: Range<u64>,
    directory_checksum: u64,
    tiles: Range<u64>,
    directory: Option<Directory>,
    /// By chart, [`NONE`] for charts without texels.
    roots: Vec<u32>,
    blocks: Vec<Option<Vec<TileEntry>>>,
}

impl ColourIndex {
    /// The index of `document`, with nothing loaded; `None` for a file without tiles.
    ///
    /// # Errors
    /// When the file has tiles and no directory of them, or the other way round, or the directory is too large.
    pub fn of(document: &Document, limits: Limits) -> Result<Option<Self>, Error> {
        let header = document.header();
        let section = |kind| header.section(kind);
        let (directory, tiles) = match (
            section(SectionKind::ColourDirectory),
            section(SectionKind::ColourTiles),
        ) {
            (Err(_), Err(_)) => return Ok(None),
            (directory, tiles) => (directory?, tiles?),
        };
        if directory.length() > limits.section_bytes {
            return Err(Error::Limit {
                what: "bytes of the colour directory",
                limit: limits.section_bytes,
                found: directory.length(),
            });
        }
        Ok(Some(Self {
            content_id: document.content_id,
            limits,
            chart_count: document.charts.len(),
            page_count: document.stored_page_count(),
            directory_range: directory.range.clone(),
            directory_checksum: directory.checksum,
            tiles: tiles.range.clone(),
            directory: None,
            roots: Vec::new(),
            blocks: Vec::new(),
        }))
    }

    /// Where the directory lies; it is loaded before anything else.
    pub fn directory_range(&self) -> Range<u64> {
        self.directory_range.clone()
    }

    /// Whether the directory was loaded.
    pub fn has_directory(&self) -> bool {
        self.directory.is_some()
    }

    /// Checks and takes the directory.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode.
    pub fn load_directory(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Range { start, .. } = self.directory_range;
        check(
            "colour directory",
            start,
            &self.content_id,
            bytes,
            self.directory_checksum,
        )?;
        let directory = Directory::parse(bytes, &self.tiles, self.chart_count, &self.limits)?;
        let mut next = 0u32;
        self.roots = directory
            .sizes
            .iter()
            .map(|size| {
                if size.is_none() {
                    return NONE;
                }
                let root = next;
                next = next.saturating_add(1);
                root
            })
            .collect();
        self.blocks = directory.blocks.iter().map(|_| None).collect();
        self.directory = Some(directory);
        Ok(())
    }

    /// Bytes of the directory, the index and the tiles.
    pub fn bytes(&self) -> u64 {
        let length = |range: &Range<u64>| range.end.saturating_sub(range.start);
        length(&self.directory_range).saturating_add(length(&self.tiles))
    }

    /// Tiles of the file; 0 before the directory is loaded.
    pub fn tile_count(&self) -> u32 {
        self.directory.as_ref().map_or(0, |d| d.tile_count)
    }

    /// Index blocks; 0 before the directory is loaded.
    pub fn block_count(&self) -> u32 {
        u32::try_from(self.blocks.len()).unwrap_or(u32::MAX)
    }

    /// The index block that holds `tile`.
    pub fn block_of(&self, tile: TileId) -> u32 {
        tile.0 / BLOCK_TILES
    }

    /// Where index block `block` lies in the file; empty when there is no such block.
    pub fn block_range(&self, block: u32) -> Range<u64> {
        self.directory
            .as_ref()
            .and_then(|d| d.blocks.get(at(block)))
            .map_or(0..0, |record| record.range.clone())
    }

    /// Tiles of index block `block`.
    pub fn block_tiles(&self, block: u32) -> Range<u32> {
        let count = self.tile_count();
        let first = block.saturating_mul(BLOCK_TILES).min(count);
        first..first.saturating_add(BLOCK_TILES).min(count)
    }

    /// Whether index block `block` was loaded.
    pub fn has_block(&self, block: u32) -> bool {
        matches!(self.blocks.get(at(block)), Some(Some(_)))
    }

    /// Checks and takes an index block.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode.
    pub fn load_block(&mut self, block: u32, bytes: &[u8]) -> Result<(), Error> {
        let missing = Error::NoSuch {
            what: "index block of tiles",
            number: block,
        };
        let tiles = self.block_tiles(block);
        let Some(directory) = &self.directory else {
            return Err(missing);
        };
        let Some(record) = directory.blocks.get(at(block)) else {
            return Err(missing);
        };
        check(
            "index block of tiles",
            record.range.start,
            &self.content_id,
            bytes,
            record.checksum,
        )?;
        let next = directory.blocks.get(at(block).saturating_add(1));
        let place = BlockPlace {
            first_tile: tiles.start,
            tile_count: tiles.len(),
            offset: record.first_tile_offset,
            end_offset: next.map_or(self.tiles.end, |next| next.first_tile_offset),
            first_child: record.first_child,
            end_child: next.map_or(directory.tile_count, |next| next.first_child),
        };
        let entries = block::parse(&place, bytes, &self.limits)?;
        match self.blocks.get_mut(at(block)) {
            Some(slot) => *slot = Some(entries),
            None => return Err(missing),
        }
        Ok(())
    }

    /// Loads the directory and every index block.
    ///
    /// # Errors
    /// When the source fails or something is not valid.
    pub fn load(&mut self, source: &dyn ByteSource) -> Result<(), Error> {
        if !self.has_directory() {
            self.load_directory(&source.read(self.directory_range())?)?;
        }
        for block in 0..self.block_count() {
            if !self.has_block(block) {
                self.load_block(block, &source.read(self.block_range(block))?)?;
            }
        }
        Ok(())
    }

    /// The root tile of a chart; `None` without texels or while the directory is not loaded.
    pub fn root(&self, chart: ChartId) -> Option<TileId> {
        let root = *self.roots.get(at(chart.0))?;
        (root != NONE).then_some(TileId(root))
    }

    /// Texels of a chart's tiles; `None` as for [`Self::root`].
    pub fn size(&self, chart: ChartId) -> Option<TexelSize> {
        *self.directory.as_ref()?.sizes.get(at(chart.0))?
    }

    /// The entry of `tile`; `None` while its index block is not loaded, or beyond the last.
    pub fn tile(&self, tile: TileId) -> Option<&TileEntry> {
        let block = self.blocks.get(at(self.block_of(tile)))?.as_ref()?;
        block.get(at(tile.0 % BLOCK_TILES))
    }

    /// The child of `tile` at `quadrant`, if it has one and its index block is loaded.
    pub fn child(&self, tile: TileId, quadrant: Quadrant) -> Option<TileId> {
        let entry = self.tile(tile)?;
        let bit = 1u8.checked_shl(u32::from(quadrant.0))?;
        if entry.children & bit == 0 {
            return None;
        }
        let before = entry.children & bit.wrapping_sub(1);
        Some(TileId(entry.first_child.checked_add(before.count_ones())?))
    }

    /// Where `tile` lies in the file; `None` while its index block is not loaded.
    pub fn tile_range(&self, tile: TileId) -> Option<Range<u64>> {
        let entry = self.tile(tile)?;
        Some(entry.offset..entry.offset.checked_add(u64::from(entry.length))?)
    }

    /// The number under which page addresses name `tile`: tiles follow pages and clusters.
    pub fn page_number(&self, tile: TileId) -> Option<u32> {
        self.page_count.checked_add(tile.0)
    }

    /// Checks and decodes a tile of `chart`.
    ///
    /// # Errors
    /// When the bytes do not match length and checksum, or are no picture of the chart's size.
    pub fn decode(&self, chart: ChartId, tile: TileId, bytes: &[u8]) -> Result<TileTexels, Error> {
        decode_vp8(self.check(chart, tile, bytes)?, bytes)
    }

    /// [`ColourIndex::decode`] as a task of its own, the checksum compared.
    ///
    /// # Errors
    /// When the bytes do not match length and checksum.
    pub fn task(&self, chart: ChartId, tile: TileId, frame: Vec<u8>) -> Result<ImageTask, Error> {
        let (width, height) = self.check(chart, tile, &frame)?.stored();
        Ok(ImageTask {
            width,
            height,
            frame,
        })
    }

    /// The size of a tile of `chart`, the bytes being its.
    fn check(&self, chart: ChartId, tile: TileId, bytes: &[u8]) -> Result<TexelSize, Error> {
        let no_such = |what, number| Error::NoSuch { what, number };
        let size = self.size(chart).ok_or(no_such("textured chart", chart.0))?;
        let entry = self.tile(tile).ok_or(no_such("colour tile", tile.0))?;
        let (expected, found) = (u64::from(entry.length), bytes.len() as u64);
        if expected != found {
            return Err(Error::Mismatch {
                what: "bytes of a tile",
                expected,
                found,
            });
        }
        let computed = checksum(&self.content_id, bytes) & u64::from(u32::MAX);
        if computed != u64::from(entry.checksum) {
            return Err(Error::Checksum {
                what: "colour tile",
                offset: entry.offset,
                stored: u64::from(entry.checksum),
                computed,
            });
        }
        Ok(size)
    }
}

fn at(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
