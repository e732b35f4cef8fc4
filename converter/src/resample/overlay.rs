//! The overlay of a patch and its image.
//!
//! Source S and image I are both piecewise linear over the square. Where one source triangle and one image triangle
//! (half a cell, cut by its diagonal) overlap, S − I is linear, so |S − I| is convex and takes its maximum at a corner
//! of the overlap, and the squared distance to the source triangle's plane has a closed integral. Every overlap is made
//! by cutting source triangles along grid lines and diagonals.
//!
//! Points in space are carried through the cuts, not recomputed from (u, v): needles there have no useful gradients.

use super::polygon::{Corner, Polygon};
use super::surfaces::{Half, Image, Source};
use glam::{DVec2, DVec3};

/// Calls `emit` with every overlap, of at least three corners, of a source triangle with a half cell of the image.
pub(super) fn visit(
    source: &Source,
    image: &Image,
    triangle: u32,
    scratch: &mut Scratch,
    mut emit: impl FnMut(Half, &[Place]),
) {
    let corners = source.patch.triangles[triangle as usize].map(|vertex| Place {
        place: source.uv[vertex as usize] * image.scale - image.origin,
        surface: source.patch.positions[vertex as usize],
    });
    let low = corners[0].place.min(corners[1].place).min(corners[2].place);
    let high = corners[0].place.max(corners[1].place).max(corners[2].place);
    let end = f64::from(image.cells);
    // Not `low > end`, so that NaN leaves here too.
    if !(low.max_element() <= f64::MAX
        && low.x <= end
        && low.y <= end
        && high.x >= 0.0
        && high.y >= 0.0)
    {
        return;
    }
    let ([x0, x1], [y0, y1]) = (
        image.cell_range(low.x, high.x),
        image.cell_range(low.y, high.y),
    );
    if x0 == x1 && y0 == y1 && low.min_element() >= 0.0 && high.max_element() <= end {
        let cell = DVec2::new(f64::from(x0), f64::from(y0));
        let sides = corners.map(|corner| above_diagonal(corner.place - cell));
        if sides.iter().all(|&side| side <= 0.0) {
            return emit(
                Half {
                    x: x0,
                    y: y0,
                    upper: false,
                },
                &corners,
            );
        }
        if sides.iter().all(|&side| side >= 0.0) {
            return emit(
                Half {
                    x: x0,
                    y: y0,
                    upper: true,
                },
                &corners,
            );
        }
    }
    let [rest, row, row_rest, cell, cell_rest] = &mut scratch.polygons;
    let horizontal = |line: f64| {
        (
            move |c: &Place| c.place.y - line,
            move |c: &mut Place| c.place.y = line,
        )
    };
    let vertical = |line: f64| {
        (
            move |c: &Place| c.place.x - line,
            move |c: &mut Place| c.place.x = line,
        )
    };
    row.set(corners);
    cut(row, horizontal(f64::from(y0)), cell, rest);
    for y in y0..=y1 {
        cut(rest, horizontal(f64::from(y + 1)), row, row_rest);
        std::mem::swap(rest, row_rest);
        cut(row, vertical(f64::from(x0)), cell, row_rest);
        for x in x0..=x1 {
            cut(row_rest, vertical(f64::from(x + 1)), cell, cell_rest);
            std::mem::swap(row_rest, cell_rest);
            let corner = DVec2::new(f64::from(x), f64::from(y));
            cell.cut(|c| above_diagonal(c.place - corner), |_| (), cell_rest, row);
            for (half, upper) in [(&*cell_rest, false), (&*row, true)] {
                if half.corners().len() > 2 {
                    emit(Half { x, y, upper }, half.corners());
                }
            }
        }
    }
}

fn cut<H: Fn(&Place) -> f64, S: Fn(&mut Place)>(
    polygon: &Polygon<Place>,
    (height, snap): (H, S),
    below: &mut Polygon<Place>,
    above: &mut Polygon<Place>,
) {
    polygon.cut(height, snap, below, above);
}

/// Positive above the diagonal of the cell at the origin.
fn above_diagonal(place: DVec2) -> f64 {
    place.y - place.x
}

/// A point of the source: where in the window, in cells, and where in space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) place: DVec2,
    pub(super) surface: DVec3,
}

impl Corner for Place {
    const BLANK: Self = Self {
        place: DVec2::ZERO,
        surface: DVec3::ZERO,
    };

    fn towards(self, other: Self, along: f64) -> Self {
        Self {
            place: self.place + (other.place - self.place) * along,
            surface: self.surface.towards(other.surface, along),
        }
    }
}

/// Memory used again for every triangle.
#[derive(Debug)]
pub(super) struct Scratch {
    polygons: [Polygon<Place>; 5],
    /// Squared gaps by triangle.
    pub(super) loose: Vec<(f64, u32)>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            polygons: [Polygon::EMPTY; 5],
            loose: Vec::new(),
        }
    }
}
