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
    // References are swapped, not what they refer to.
    let [mut rest, mut row, mut row_rest, mut cell, mut spare] = scratch.polygons.each_mut();
    rest.set(corners);
    let [y0, y1] = image.cell_range(low.y, high.y);
    if low.y < f64::from(y0) {
        rest.cut(above(1, y0), snap(1, y0), spare, row);
        std::mem::swap(&mut rest, &mut row);
    }
    for y in y0..=y1 {
        if y == y1 && high.y <= f64::from(y1 + 1) {
            std::mem::swap(&mut rest, &mut row);
        } else {
            rest.cut(above(1, y + 1), snap(1, y + 1), row, spare);
            std::mem::swap(&mut rest, &mut spare);
        }
        let Some([left, right]) = span(row.corners()) else {
            continue;
        };
        if right < 0.0 || left > end {
            continue;
        }
        let [x0, x1] = image.cell_range(left, right);
        if left < f64::from(x0) {
            row.cut(above(0, x0), snap(0, x0), spare, row_rest);
            std::mem::swap(&mut row, &mut row_rest);
        }
        for x in x0..=x1 {
            if x == x1 && right <= f64::from(x1 + 1) {
                std::mem::swap(&mut row, &mut cell);
            } else {
                row.cut(above(0, x + 1), snap(0, x + 1), cell, row_rest);
                std::mem::swap(&mut row, &mut row_rest);
            }
            halves(cell, [x, y], [row_rest, spare], &mut emit);
        }
    }
}

/// Cuts what lies in a cell along its diagonal.
fn halves(
    cell: &Polygon<Place>,
    [x, y]: [u32; 2],
    [lower, upper]: [&mut Polygon<Place>; 2],
    emit: &mut impl FnMut(Half, &[Place]),
) {
    let corner = DVec2::new(f64::from(x), f64::from(y));
    let height = |c: &Place| above_diagonal(c.place - corner);
    let (lower, upper) = if cell.corners().iter().all(|c| height(c) <= 0.0) {
        (cell.corners(), [].as_slice())
    } else if cell.corners().iter().all(|c| height(c) >= 0.0) {
        ([].as_slice(), cell.corners())
    } else {
        cell.cut(height, |_| (), lower, upper);
        (lower.corners(), upper.corners())
    };
    for (corners, upper) in [(lower, false), (upper, true)] {
        if corners.len() > 2 {
            emit(Half { x, y, upper }, corners);
        }
    }
}

/// The least and the largest first coordinate.
fn span(corners: &[Place]) -> Option<[f64; 2]> {
    let mut places = corners.iter().map(|corner| corner.place.x);
    let first = places.next()?;
    Some(places.fold([first; 2], |[low, high], x| [low.min(x), high.max(x)]))
}

/// Height above the grid line at `line`: along x a vertical one, along y a horizontal one.
fn above(axis: usize, line: u32) -> impl Fn(&Place) -> f64 {
    let line = f64::from(line);
    move |c| c.place[axis] - line
}

/// Puts a corner on a grid line.
fn snap(axis: usize, line: u32) -> impl Fn(&mut Place) {
    let line = f64::from(line);
    move |c| c.place[axis] = line
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
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            polygons: [Polygon::EMPTY; 5],
        }
    }
}
