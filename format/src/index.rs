//! The paged index: one entry a page, in blocks of 1024 entries that are read when needed.
//!
//! The directory says where the blocks are; it is read when the file is opened. A block stores its
//! entries plane by plane, packed, with errors, cones and bounds quantized so that they stay
//! bounds.

pub(crate) mod block;
pub(crate) mod directory;
pub(crate) mod quantize;

use crate::lattice::Bounds;

/// Entries of an index block; the last one may have fewer.
pub const BLOCK_PAGES: u32 = 1024;

/// A cone that holds every triangle normal of a page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalCone {
    /// Unit axis.
    pub axis: [f32; 3],
    /// Cosine of the half angle; −1 when the cone says nothing.
    pub cos: f32,
}

/// What the index says of one page.
#[derive(Debug, Clone, PartialEq)]
pub struct PageEntry {
    /// Place in the file, bytes.
    pub offset: u64,
    /// Stored length, bytes; 0 for a root page that adds nothing to the base.
    pub length: u32,
    /// Low half of xxh3-64 of the stored bytes, seeded with the content id.
    pub checksum: u32,
    /// Finest resolution of the node, `0..=5` (5 below the root).
    pub resolution: u8,
    /// Geometric error (lattice units, upper bound). A root: by resolution `0..=resolution`, the base's
    /// included. Else: one value, at its 32² cells.
    pub errors: Vec<f32>,
    /// All triangle normals at the finest resolution.
    pub cone: NormalCone,
    /// All samples of the node and of everything below it.
    pub bounds: Bounds,
    /// Whether the four children exist.
    pub has_children: bool,
}
