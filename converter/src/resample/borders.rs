//! Samples on the sides of a chart.

use super::attributes::within_segment;
use crate::atlas::patch::{Attributes, Border, Patch};
use glam::DVec3;

/// The side a sample (i, j) of a grid of `cells` a side lies on, and how many cells along it; a corner belongs to the side
/// that starts there.
pub(super) fn side_of(i: u32, j: u32, cells: u32) -> Option<(usize, u32)> {
    match (i, j) {
        (i, 0) if i < cells => Some((0, i)),
        (i, j) if i == cells && j < cells => Some((1, j)),
        (i, j) if j == cells && i > 0 => Some((2, cells - i)),
        (0, j) => Some((3, cells - j)),
        _ => None,
    }
}

/// Sample `step` of 0..=2^resolution along a side.
///
/// It is evaluated at the border's own parameter, whichever way the side runs, so both charts compute the same bits.
pub(super) fn sample(
    patch: &Patch,
    borders: &[Border],
    side: usize,
    step: u32,
    resolution: u8,
) -> (DVec3, Attributes) {
    let (border, forward) = patch.borders[side];
    let cells = 1u32 << resolution;
    let step = if forward { step } else { cells - step };
    at(
        &borders[border as usize],
        f64::from(step) / f64::from(cells),
    )
}

/// The border at parameter `param` in [0, 1]; its own points are met exactly.
fn at(border: &Border, param: f64) -> (DVec3, Attributes) {
    let last = border.points.len() - 1;
    let next = border.params.partition_point(|&p| p < param).min(last);
    if next == 0 || border.params[next] <= param {
        return (border.points[next], border.attributes[next]);
    }
    if param >= 1.0 {
        return (border.points[last], border.attributes[last]);
    }
    let from = next - 1;
    let along = (param - border.params[from]) / (border.params[next] - border.params[from]);
    let position = border.points[from] + (border.points[next] - border.points[from]) * along;
    (
        position,
        within_segment(border.attributes[from], border.attributes[next], along),
    )
}
