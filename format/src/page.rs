//! Decoded pages.

use crate::lattice::LatticePoint;

/// Number of a page; see `ARCHITECTURE.md` for the order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PageId(pub u32);

/// All samples of one node, decoded, row by row: sample (i, j) is at `j * side + i`, `side = 2^resolution + 1`.
///
/// A full page has `resolution` 5; a root page may stop earlier; the base gives `resolution` ≤ base resolution.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PageSamples {
    /// log2 of the cells a side.
    pub resolution: u8,
    /// Positions on the lattice.
    pub positions: Vec<LatticePoint>,
    /// Positions on the parent's surface (the morph targets).
    pub position_targets: Vec<LatticePoint>,
    /// Octahedral normals, 2×8 bits, (0, 0)..(255, 255).
    pub normals: Vec<[u8; 2]>,
    /// Normals of the parent's surface.
    pub normal_targets: Vec<[u8; 2]>,
    /// sRGB colours; empty when the file has none.
    pub colours: Vec<[u8; 3]>,
    /// Colours of the parent's surface; empty when the file has none.
    pub colour_targets: Vec<[u8; 3]>,
}

impl PageSamples {
    /// Samples a side.
    pub fn side(&self) -> usize {
        crate::codec::grid::side_of(self.resolution)
    }
}
