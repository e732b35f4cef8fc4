//! Colour tiles: texels of the charts, at a density of their own.
//!
//! A chart with texels is an image over its square, in levels: at level l it has (width · 2^l) × (height · 2^l) texels,
//! texel (i, j) covering the square from (i, j) to (i + 1, j + 1). A **tile** is the width × height texels of one node, and
//! a gutter of [`GUTTER`] texels around them: those of the neighbours, also across glue. Levels above the leaves are the area mean
//! of four texels each, in linear light. A tile has any of its four children, so that only what shows more detail than its
//! parent is stored.
//!
//! Tiles are numbered as pages are: the roots in chart order, then level by level. The index is in blocks of
//! [`BLOCK_TILES`]. In page addresses tiles have the numbers after those of pages and clusters.

mod block;
mod directory;
mod index;
mod tile;
#[cfg(not(target_arch = "wasm32"))]
pub mod writer;

pub use index::ColourIndex;
pub use tile::{TileTexels, decode_vp8};

pub(crate) use tile::{decode_frame, frame_size};

pub(crate) use block::facts_of;
pub(crate) use directory::content_of;

/// Texels around the own ones of a tile, on each side.
pub const GUTTER: u32 = 2;
/// Most texels a side of a tile, gutter not counted.
pub const MOST_TEXELS: u32 = 128;
/// Widths and heights are multiples of this, so that three mips of a tile are whole.
pub const TEXEL_STEP: u32 = 8;
/// Entries of one index block.
pub const BLOCK_TILES: u32 = 1024;

/// Number of a tile in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileId(pub u32);

/// Texels of every tile of a chart, gutter not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TexelSize {
    /// Along u: a multiple of [`TEXEL_STEP`], at most [`MOST_TEXELS`].
    pub width: u32,
    /// Along v, as `width`.
    pub height: u32,
}

impl TexelSize {
    /// Width and height of what a tile stores, gutter included.
    pub fn stored(self) -> (u32, u32) {
        let with = |side: u32| side.saturating_add(2 * GUTTER);
        (with(self.width), with(self.height))
    }
}

/// What the index says of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileEntry {
    /// Where it starts in the file.
    pub offset: u64,
    /// Stored bytes.
    pub length: u32,
    /// Lower half of the checksum of the stored bytes.
    pub checksum: u32,
    /// Bit q is set where quadrant q is a tile.
    pub children: u8,
    /// First of its children; meaningless without any.
    pub(crate) first_child: u32,
}
