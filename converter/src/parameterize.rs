//! Patches onto the unit square.

use crate::atlas::patch::{Border, Patch};
use glam::DVec2;

/// How a patch lies on the unit square.
#[derive(Debug, Clone, Default)]
pub struct Parametrization {
    /// (u, v) of every vertex of the patch, in [0, 1]²; side vertices lie exactly on their side at their border's parameter.
    pub uv: Vec<DVec2>,
    /// Triangles whose orientation in (u, v) is not strictly positive (exact predicate); 0 when certified.
    pub flipped: u32,
    /// Mean L² stretch, 1 = isometric up to scale.
    pub stretch: f64,
}

/// Parametrizes `patch`; may split chords, so vertices and triangles may be added to it.
pub fn parameterize(patch: &mut Patch, borders: &[Border]) -> Parametrization {
    let _ = (patch, borders);
    unimplemented!()
}
