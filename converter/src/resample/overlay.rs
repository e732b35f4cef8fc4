//! Distance between a patch and its image, over the overlay of both meshes.
//!
//! Source S and image I are both piecewise linear over the square. Where one source triangle and one image triangle
//! (half a cell, cut by its diagonal) overlap, S − I is linear, so |S − I| is convex and takes its maximum at a corner
//! of the overlap, and the squared distance to the source triangle's plane has a closed integral. Every overlap is made
//! by cutting source triangles along grid lines and diagonals.
//!
//! The largest |S − I| bounds the Hausdorff distance both ways, but it counts sliding along the surface as well. So
//! overlaps that stand out are bounded again, in descending order, by [`super::tighten`], until the next cannot matter.
//!
//! Limit: this compares over the chart's own square. Where a border's samples cut a corner of the border curve, the sliver
//! between is compared with this chart's image only, though the neighbour's may be closer: the bound is then loose.

use super::polygon::{Corner, Polygon};
use super::tighten::{Surface, bound, unit_normal};
use super::{GridError, Window};
use crate::atlas::patch::Patch;
use crate::parameterize::Edges;
use glam::{DVec2, DVec3};
use std::cell::OnceCell;

/// The bound is raised by this fraction against rounding.
const ROUNDING: f64 = 1e-9;

/// What the tightened bound may stay above the realistic error, relative to it, before work is spent on it.
const TIGHT_ENOUGH: f64 = 1.02;

/// Errors of a window at 1, 2, 4… cells a side; `positions` are its samples, `triangles` all that touch it.
pub(super) fn errors(
    patch: &Patch,
    uv: &[DVec2],
    triangles: &[u32],
    window: Window,
    positions: &[DVec3],
) -> Vec<GridError> {
    let source = Source {
        patch,
        uv,
        neighbours: OnceCell::new(),
    };
    let mut scratch = Scratch::default();
    let mut errors = Vec::new();
    let mut level = 0;
    while window.cells >> level > 0 {
        let image = Image::of(window, level, positions);
        errors.push(error(&source, &image, triangles, &mut scratch));
        level += 1;
    }
    errors.reverse();
    errors
}

/// The error of one image.
fn error(source: &Source, image: &Image, triangles: &[u32], scratch: &mut Scratch) -> GridError {
    let mut loose = std::mem::take(&mut scratch.loose);
    loose.clear();
    let (mut plane, mut squares, mut area) = (0.0f64, 0.0, 0.0);
    for &triangle in triangles {
        let normal = unit_normal(source.corners(triangle));
        let mut farthest = 0.0f64;
        visit(source, image, triangle, scratch, |half, corners| {
            let facet = image.facet(half);
            let mut measure = |corner: &Place| {
                let gap = corner.surface - facet.at(corner.place);
                let height = gap.dot(normal);
                farthest = farthest.max(gap.length_squared());
                plane = plane.max(height.abs());
                (corner.surface, height)
            };
            let apex = measure(&corners[0]);
            let mut from = measure(&corners[1]);
            for corner in &corners[2..] {
                let to = measure(corner);
                let part = 0.5 * (from.0 - apex.0).cross(to.0 - apex.0).dot(normal).abs();
                squares += part * mean_square([apex.1, from.1, to.1]);
                area += part;
                from = to;
            }
        });
        loose.push((farthest, triangle));
    }
    let max = tightened(source, image, &mut loose, plane, scratch);
    scratch.loose = loose;
    GridError {
        max: max * (1.0 + ROUNDING),
        max_plane: plane,
        mean_square: if area > 0.0 { squares / area } else { 0.0 },
        area,
    }
}

/// Mean of the square of a function that is linear over a triangle.
fn mean_square([a, b, c]: [f64; 3]) -> f64 {
    (a * a + b * b + c * c + a * b + b * c + c * a) / 6.0
}

/// The bound, at least `plane`, from the largest squared gap of every triangle.
fn tightened(
    source: &Source,
    image: &Image,
    loose: &mut Vec<(f64, u32)>,
    plane: f64,
    scratch: &mut Scratch,
) -> f64 {
    let mut max = plane;
    let threshold = (plane * TIGHT_ENOUGH).powi(2);
    let most = loose
        .iter()
        .fold(0.0f64, |most, &(square, _)| most.max(square));
    if most <= threshold {
        return most.sqrt().max(plane);
    }
    loose.retain(|&(square, _)| square > threshold);
    loose.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for &(square, triangle) in loose.iter() {
        if square <= (max * TIGHT_ENOUGH).powi(2) {
            return max.max(square.sqrt());
        }
        let (mut piece, mut shadow) = (Polygon::EMPTY, Polygon::EMPTY);
        visit(source, image, triangle, scratch, |half, corners| {
            let facet = image.facet(half);
            let gap = |corner: &Place| corner.surface.distance_squared(facet.at(corner.place));
            if corners.iter().any(|corner| gap(corner) > max * max) {
                piece.set(corners.iter().map(|corner| corner.surface));
                shadow.set(corners.iter().map(|corner| facet.at(corner.place)));
                max = max.max(bound(image, half, &piece, max));
                max = max.max(bound(source, triangle, &shadow, max));
            }
        });
    }
    max.max((plane * TIGHT_ENOUGH).min(most.sqrt()))
}

/// Calls `emit` with every overlap, of at least three corners, of a source triangle with a half cell of the image.
fn visit(
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
struct Place {
    place: DVec2,
    surface: DVec3,
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
struct Scratch {
    polygons: [Polygon<Place>; 5],
    loose: Vec<(f64, u32)>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            polygons: [Polygon::EMPTY; 5],
            loose: Vec::new(),
        }
    }
}

/// Half a cell: a triangle of the image.
#[derive(Debug, Clone, Copy)]
struct Half {
    x: u32,
    y: u32,
    upper: bool,
}

/// The image over a half cell, linear in the window's coordinates.
struct Facet {
    corner: DVec2,
    base: DVec3,
    along_u: DVec3,
    along_v: DVec3,
}

impl Facet {
    fn at(&self, place: DVec2) -> DVec3 {
        let inside = place - self.corner;
        self.base + self.along_u * inside.x + self.along_v * inside.y
    }
}

/// A window's samples at one level.
struct Image<'a> {
    positions: &'a [DVec3],
    row: usize,
    stride: usize,
    cells: u32,
    /// Cells of this level a chart side, and the window's first.
    scale: f64,
    origin: DVec2,
}

impl<'a> Image<'a> {
    /// Every 2^`level`-th sample of a window.
    fn of(window: Window, level: u32, positions: &'a [DVec3]) -> Self {
        let stride = 1u32 << level;
        let cells_per_unit = f64::from(1u32 << window.resolution) / f64::from(stride);
        Self {
            positions,
            row: window.cells as usize + 1,
            stride: stride as usize,
            cells: window.cells / stride,
            scale: cells_per_unit,
            origin: DVec2::new(f64::from(window.x), f64::from(window.y)) / f64::from(stride),
        }
    }

    fn sample(&self, x: u32, y: u32) -> DVec3 {
        self.positions[(y as usize * self.row + x as usize) * self.stride]
    }

    fn facet(&self, half: Half) -> Facet {
        let Half { x, y, upper } = half;
        let (base, opposite) = (self.sample(x, y), self.sample(x + 1, y + 1));
        let (along_u, along_v) = if upper {
            let corner = self.sample(x, y + 1);
            (opposite - corner, corner - base)
        } else {
            let corner = self.sample(x + 1, y);
            (corner - base, opposite - corner)
        };
        Facet {
            corner: DVec2::new(f64::from(x), f64::from(y)),
            base,
            along_u,
            along_v,
        }
    }

    /// The cells that a span of one coordinate touches, kept inside the window.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the window's cells"
    )]
    fn cell_range(&self, low: f64, high: f64) -> [u32; 2] {
        let last = f64::from(self.cells - 1);
        let first = low.floor().clamp(0.0, last);
        [first as u32, (high.ceil() - 1.0).clamp(first, last) as u32]
    }
}

impl Surface for Image<'_> {
    type Triangle = Half;

    fn corners(&self, Half { x, y, upper }: Half) -> [DVec3; 3] {
        let far = self.sample(x + 1, y + 1);
        if upper {
            [self.sample(x, y), far, self.sample(x, y + 1)]
        } else {
            [self.sample(x, y), self.sample(x + 1, y), far]
        }
    }

    fn across(&self, Half { x, y, upper }: Half, edge: usize) -> Option<Half> {
        match (upper, edge) {
            (false, 0) => y.checked_sub(1).map(|y| Half { x, y, upper: true }),
            (false, 1) => (x + 1 < self.cells).then_some(Half {
                x: x + 1,
                y,
                upper: true,
            }),
            (true, 1) => (y + 1 < self.cells).then_some(Half {
                x,
                y: y + 1,
                upper: false,
            }),
            (true, 2) => x.checked_sub(1).map(|x| Half { x, y, upper: false }),
            _ => Some(Half {
                x,
                y,
                upper: !upper,
            }),
        }
    }
}

/// The patch as a surface to walk on.
struct Source<'a> {
    patch: &'a Patch,
    uv: &'a [DVec2],
    neighbours: OnceCell<Vec<[u32; 3]>>,
}

impl Surface for Source<'_> {
    type Triangle = u32;

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.patch.triangles[triangle as usize].map(|vertex| self.patch.positions[vertex as usize])
    }

    fn across(&self, triangle: u32, edge: usize) -> Option<u32> {
        let neighbours = self
            .neighbours
            .get_or_init(|| Edges::of(&self.patch.triangles).neighbours());
        let beyond = neighbours[triangle as usize][edge];
        (beyond != u32::MAX).then_some(beyond)
    }
}

/// Largest |S − I| over the overlay: the bound before it is tightened.
#[cfg(test)]
pub(super) fn parametric_maximum(
    patch: &Patch,
    uv: &[DVec2],
    window: Window,
    positions: &[DVec3],
) -> f64 {
    let source = Source {
        patch,
        uv,
        neighbours: OnceCell::new(),
    };
    let image = Image::of(window, 0, positions);
    let mut farthest = 0.0f64;
    for triangle in (0u32..).take(patch.triangles.len()) {
        visit(
            &source,
            &image,
            triangle,
            &mut Scratch::default(),
            |half, corners| {
                for corner in corners {
                    farthest =
                        farthest.max(corner.surface.distance(image.facet(half).at(corner.place)));
                }
            },
        );
    }
    farthest
}
