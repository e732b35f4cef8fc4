//! One index block: up to 1024 tiles, checksums first, then the packed facts.

use super::TileEntry;
use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::{Error, Limits};

const WHAT: &str = "index block of tiles";
/// Bytes of facts a tile: three of its length, one of its children.
const FACT_BYTES: usize = 4;

/// What a block's place in the file says about it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockPlace {
    /// First tile.
    pub(crate) first_tile: u32,
    /// Tiles.
    pub(crate) tile_count: usize,
    /// Where its first tile starts, and its last ends.
    pub(crate) offset: u64,
    pub(crate) end_offset: u64,
    /// First child of its first tile with children, and one past the last child of its last.
    pub(crate) first_child: u32,
    pub(crate) end_child: u32,
}

/// The part of a block's bytes that the content id covers.
pub(crate) fn facts_of(tile_count: usize, bytes: &[u8]) -> &[u8] {
    bytes
        .get(tile_count.saturating_mul(4)..)
        .unwrap_or_default()
}

/// Reads a block whose checksum was checked.
pub(crate) fn parse(
    place: &BlockPlace,
    bytes: &[u8],
    limits: &Limits,
) -> Result<Vec<TileEntry>, Error> {
    let n = place.tile_count;
    let mut cursor = Cursor::new(WHAT, bytes);
    let mut checksums = Cursor::new(WHAT, cursor.take(n.saturating_mul(4))?);
    let method = Method::from_code(WHAT, cursor.u8()?)?;
    let facts = packing::unpack(WHAT, method, cursor.rest(), n.saturating_mul(FACT_BYTES))?;
    let plane = |at: usize, tile: usize| {
        let index = at.saturating_mul(n).saturating_add(tile);
        facts.get(index).copied().unwrap_or_default()
    };
    let (mut offset, mut child) = (place.offset, place.first_child);
    let mut entries = Vec::with_capacity(n);
    for (tile, number) in (0..n).zip(place.first_tile..) {
        let length = u32::from_le_bytes([plane(0, tile), plane(1, tile), plane(2, tile), 0]);
        if length > limits.page_bytes {
            return Err(Error::Limit {
                what: "bytes of a tile",
                limit: u64::from(limits.page_bytes),
                found: u64::from(length),
            });
        }
        let children = plane(3, tile);
        if children > 15 {
            return Err(Error::Reserved {
                what: "children of a tile",
                value: u64::from(children),
            });
        }
        if children != 0 && child <= number {
            return Err(Error::Value {
                what: "tile with children",
                found: u64::from(number),
            });
        }
        entries.push(TileEntry {
            offset,
            length,
            checksum: checksums.u32()?,
            children,
            first_child: child,
        });
        offset = offset.saturating_add(u64::from(length));
        child = child.saturating_add(children.count_ones());
    }
    if child != place.end_child {
        return Err(Error::Mismatch {
            what: "children of a block of tiles",
            expected: u64::from(place.end_child),
            found: u64::from(child),
        });
    }
    if offset != place.end_offset {
        return Err(Error::Mismatch {
            what: "end of a block's tiles",
            expected: place.end_offset,
            found: offset,
        });
    }
    Ok(entries)
}

/// The method byte and the packed facts of tiles with these lengths and children.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn encode_facts(tiles: &[(u32, u8)]) -> Result<Vec<u8>, Error> {
    let mut facts = Vec::with_capacity(tiles.len().saturating_mul(FACT_BYTES));
    for k in 0..3 {
        facts.extend(
            tiles
                .iter()
                .filter_map(|(length, _)| length.to_le_bytes().get(k).copied()),
        );
    }
    facts.extend(tiles.iter().map(|(_, children)| children));
    let (method, packed) = packing::pack(&facts)?;
    let mut out = vec![method as u8];
    out.extend(packed);
    Ok(out)
}
