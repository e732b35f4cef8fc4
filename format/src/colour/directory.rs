//! The colour directory: the size of every chart's tiles, and where the index blocks are.

use super::{BLOCK_TILES, MOST_TEXELS, TEXEL_STEP, TexelSize};
use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::{Error, Limits};
use std::ops::Range;

const WHAT: &str = "colour directory";
/// The one codec of this version: a VP8 key frame.
const CODEC_VP8: u8 = 1;
/// Bytes before the block records.
pub(crate) const FIXED_BYTES: usize = 16;
/// Bytes of one record.
pub(crate) const RECORD_BYTES: usize = 24;

/// What the directory says of one index block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BlockRecord {
    /// Bytes of the file.
    pub(crate) range: Range<u64>,
    /// xxh3-64 of the block.
    pub(crate) checksum: u64,
    /// Where the block's first tile lies in the file.
    pub(crate) first_tile_offset: u64,
    /// The first child of the block's first tile that has children.
    pub(crate) first_child: u32,
}

/// The directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Directory {
    pub(crate) tile_count: u32,
    /// By chart; `None` for charts without texels.
    pub(crate) sizes: Vec<Option<TexelSize>>,
    pub(crate) blocks: Vec<BlockRecord>,
}

impl Directory {
    /// Reads the directory of a file of `chart_count` charts whose blocks and tiles lie in `tiles`.
    pub(crate) fn parse(
        bytes: &[u8],
        tiles: &Range<u64>,
        chart_count: usize,
        limits: &Limits,
    ) -> Result<Self, Error> {
        let mut cursor = Cursor::new(WHAT, bytes);
        let tile_count = cursor.u32()?;
        let block_count = cursor.u32()?;
        let (codec, method) = (cursor.u8()?, cursor.u8()?);
        let reserved = cursor.u16()?;
        let packed_length = cursor.u32()?;
        if tile_count > limits.tiles {
            let (limit, found) = (u64::from(limits.tiles), u64::from(tile_count));
            return Err(Error::Limit {
                what: "colour tiles",
                limit,
                found,
            });
        }
        let expected = u64::from(tile_count.div_ceil(BLOCK_TILES));
        if u64::from(block_count) != expected {
            return Err(Error::Mismatch {
                what: "index blocks of colour tiles",
                expected,
                found: u64::from(block_count),
            });
        }
        if codec != CODEC_VP8 {
            return Err(Error::Value {
                what: "codec of colour tiles",
                found: u64::from(codec),
            });
        }
        if reserved != 0 {
            return Err(Error::Reserved {
                what: WHAT,
                value: u64::from(reserved),
            });
        }
        let record_bytes = usize::try_from(block_count)
            .unwrap_or(usize::MAX)
            .saturating_mul(RECORD_BYTES);
        let records = cursor.take(record_bytes)?;
        let packed = cursor.take(usize::try_from(packed_length).unwrap_or(usize::MAX))?;
        cursor.finish()?;
        let method = Method::from_code(WHAT, method)?;
        let sizes = sizes_from(&packing::unpack(
            WHAT,
            method,
            packed,
            chart_count.saturating_mul(2),
        )?)?;
        let roots = sizes.iter().flatten().count();
        let roots = u32::try_from(roots).unwrap_or(u32::MAX);
        if tile_count < roots {
            return Err(Error::Mismatch {
                what: "root tiles",
                expected: u64::from(roots),
                found: u64::from(tile_count),
            });
        }
        let blocks = records_from(records, tiles, roots, tile_count)?;
        Ok(Self {
            tile_count,
            sizes,
            blocks,
        })
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Error> {
        let code = |side: fn(&TexelSize) -> u32| {
            self.sizes.iter().map(move |size| {
                let steps = size.as_ref().map_or(0, side) / TEXEL_STEP;
                u8::try_from(steps).unwrap_or(u8::MAX)
            })
        };
        let sizes: Vec<u8> = code(|s| s.width).chain(code(|s| s.height)).collect();
        let (method, packed) = packing::pack(&sizes)?;
        let word = |n: usize| u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes();
        let mut out = self.tile_count.to_le_bytes().to_vec();
        out.extend(word(self.blocks.len()));
        out.extend([CODEC_VP8, method as u8, 0, 0]);
        out.extend(word(packed.len()));
        for block in &self.blocks {
            out.extend(block.first_tile_offset.to_le_bytes());
            out.extend(block.checksum.to_le_bytes());
            let length = block.range.end.saturating_sub(block.range.start);
            out.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
            out.extend(block.first_child.to_le_bytes());
        }
        out.extend(packed);
        Ok(out)
    }
}

/// The parts of an encoded directory that say what is stored, not where: the content id covers them.
pub(crate) fn content_of(bytes: &[u8]) -> [&[u8]; 2] {
    let (fixed, rest) = bytes
        .split_at_checked(FIXED_BYTES)
        .unwrap_or((bytes, Default::default()));
    let blocks = match fixed {
        [_, _, _, _, a, b, c, d, ..] => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0,
    };
    let records = usize::try_from(blocks)
        .unwrap_or(usize::MAX)
        .saturating_mul(RECORD_BYTES);
    [fixed, rest.get(records..).unwrap_or_default()]
}

fn sizes_from(bytes: &[u8]) -> Result<Vec<Option<TexelSize>>, Error> {
    let (widths, heights) = bytes.split_at_checked(bytes.len() / 2).unwrap_or_default();
    let size = |(&width, &height): (&u8, &u8)| {
        let [width, height] =
            [width, height].map(|code| u32::from(code).saturating_mul(TEXEL_STEP));
        if width > MOST_TEXELS || height > MOST_TEXELS || (width == 0) != (height == 0) {
            return Err(Error::Value {
                what: "size of a chart's tiles",
                found: u64::from(width.max(height)),
            });
        }
        Ok((width > 0).then_some(TexelSize { width, height }))
    };
    widths.iter().zip(heights).map(size).collect()
}

fn records_from(
    bytes: &[u8],
    tiles: &Range<u64>,
    roots: u32,
    tile_count: u32,
) -> Result<Vec<BlockRecord>, Error> {
    let mut cursor = Cursor::new(WHAT, bytes);
    let mut blocks: Vec<BlockRecord> = Vec::new();
    let (mut offset, mut child, mut tile_offset) = (tiles.start, roots, tiles.start);
    for index in 0..bytes.len() / RECORD_BYTES {
        let first_tile_offset = cursor.u64()?;
        let checksum = cursor.u64()?;
        let length = cursor.u32()?;
        let first_child = cursor.u32()?;
        if first_tile_offset < tile_offset || first_tile_offset > tiles.end {
            return Err(Error::Value {
                what: "offset of an index block's tiles",
                found: first_tile_offset,
            });
        }
        let ordered = first_child >= child && first_child <= tile_count;
        if !ordered || (index == 0 && first_child != roots) {
            return Err(Error::Value {
                what: "first child of an index block of tiles",
                found: u64::from(first_child),
            });
        }
        (tile_offset, child) = (first_tile_offset, first_child);
        let end = offset.saturating_add(u64::from(length));
        blocks.push(BlockRecord {
            range: offset..end,
            checksum,
            first_tile_offset,
            first_child,
        });
        offset = end;
    }
    cursor.finish()?;
    // The tiles follow their index blocks without a gap.
    let first = blocks
        .first()
        .map_or(tiles.end, |block| block.first_tile_offset);
    if first != offset {
        return Err(Error::Mismatch {
            what: "end of the index blocks of tiles",
            expected: first,
            found: offset,
        });
    }
    Ok(blocks)
}
