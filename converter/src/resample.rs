//! Surface samples over the unit square, and how far they are from the source.

use crate::atlas::patch::{Attributes, Border, Patch};
use crate::parameterize::Parametrization;
use glam::DVec3;

/// A grid of (2^resolution + 1)² surface samples, row by row from (u, v) = (0, 0).
#[derive(Debug, Clone, Default)]
pub struct Grid {
    /// log2 of the cells a side.
    pub resolution: u8,
    /// Positions.
    pub positions: Vec<DVec3>,
    /// Attributes.
    pub attributes: Vec<Attributes>,
}

/// Samples the patch at `resolution`; border samples come from `borders` (evaluated in the border's own direction), so
/// both charts of a border get bit-equal ones.
pub fn resample(patch: &Patch, parametrization: &Parametrization, borders: &[Border], resolution: u8) -> Grid {
    let _ = (patch, parametrization, borders, resolution);
    unimplemented!()
}

/// How far a grid's surface is from its patch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GridError {
    /// Upper bound of the Hausdorff distance both ways.
    pub max: f64,
    /// Area-weighted mean of the squared distance (to the tangent plane of the source).
    pub mean_square: f64,
    /// Source area that the mean was taken over.
    pub area: f64,
}

/// Error of every coarser resolution and of the grid itself: `result[r]` for r in `0..=resolution`, over the whole chart.
/// `positions` are the decoded samples at `resolution` (same order as [`Grid`]).
pub fn grid_errors(patch: &Patch, parametrization: &Parametrization, resolution: u8, positions: &[DVec3]) -> Vec<GridError> {
    let _ = (patch, parametrization, resolution, positions);
    unimplemented!()
}
