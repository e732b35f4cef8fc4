//! The integer lattice that every stored position lies on.

use glam::DVec3;

/// Bits of one lattice coordinate.
pub const LATTICE_BITS: u32 = 21;

/// A point of the lattice; each coordinate in `0..2^21`.
pub type LatticePoint = [u32; 3];

/// One cubic lattice over the whole model: world position = `origin + step * point`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lattice {
    /// World position of lattice point (0, 0, 0), in the input's units.
    pub origin: [f64; 3],
    /// World length of one lattice unit, the same on all axes; finite, > 0.
    pub step: f64,
    /// Stored positions are multiples of `2^shift`; 0..=15.
    pub shift: u8,
}

impl Lattice {
    /// World position of `point`.
    #[allow(clippy::arithmetic_side_effects, reason = "floats")]
    pub fn world_from_lattice(&self, [x, y, z]: LatticePoint) -> DVec3 {
        DVec3::from_array(self.origin)
            + self.step * DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    }
}

/// Axis-aligned box on the lattice, both ends inclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: LatticePoint,
    /// Largest coordinates.
    pub max: LatticePoint,
}

impl Bounds {
    /// What lies in both; its smallest coordinates are above its largest where nothing does.
    pub(crate) fn common(&self, other: &Self) -> Self {
        let mut common = *self;
        for (low, min) in common.min.iter_mut().zip(other.min) {
            *low = min.max(*low);
        }
        for (high, max) in common.max.iter_mut().zip(other.max) {
            *high = max.min(*high);
        }
        common
    }
}
