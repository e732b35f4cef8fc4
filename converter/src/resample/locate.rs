//! Which triangle of a patch a sample lies in.
//!
//! Triangles are rasterized over the samples; a sample belongs to the first triangle, by index, that contains it, its
//! boundary included. Containment is decided by exact predicates (Shewchuk 1997) on the stored coordinates, and sample
//! coordinates are dyadic and so exact: a certified parametrization leaves no sample out.

use super::attributes::within_triangle;
use super::borders::{sample, side_of};
use super::{Grid, Window};
use crate::atlas::patch::{Border, Patch};
use crate::parameterize::orientation;
use glam::{DVec2, DVec3};

/// "No triangle".
const NONE: u32 = u32::MAX;

/// Cells that a row's span is widened by: far above its rounding error, far below 1.
const SPAN_MARGIN: f64 = 1e-6;

/// Triangles a bin holds on average.
const BIN_LOAD: usize = 4;

/// Bins a side at most.
const MAX_BINS: u32 = 1024;

/// The first triangle over every sample of a window.
#[derive(Debug)]
pub(super) struct Raster {
    window: Window,
    owners: Vec<u32>,
    weights: Vec<[f64; 3]>,
}

impl Raster {
    pub(super) fn new(window: Window) -> Self {
        let samples = (window.cells as usize + 1).pow(2);
        Self {
            window,
            owners: vec![NONE; samples],
            weights: vec![[0.0; 3]; samples],
        }
    }

    /// Takes the free samples inside the triangle, those on the chart's sides excepted. Call in order of index.
    pub(super) fn draw(&mut self, triangle: u32, corners: [DVec2; 3]) {
        let Window {
            resolution,
            x,
            y,
            cells,
        } = self.window;
        let scale = f64::from(1u32 << resolution);
        let last = (1u32 << resolution) - 1;
        let low = corners[0].min(corners[1]).min(corners[2]) * scale;
        let high = corners[0].max(corners[1]).max(corners[2]) * scale;
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        let Some((first_row, last_row)) = inner_range(low.y, high.y, y, y + cells, last) else {
            return;
        };
        if inner_range(low.x, high.x, x, x + cells, last).is_none() {
            return;
        }
        for j in first_row..=last_row {
            let Some((from, to)) = row_span(corners, f64::from(j) / scale) else {
                continue;
            };
            let (from, to) = (from * scale - SPAN_MARGIN, to * scale + SPAN_MARGIN);
            let Some((from, to)) = inner_range(from, to, x, x + cells, last) else {
                continue;
            };
            for i in from..=to {
                let at = (j - y) as usize * (cells as usize + 1) + (i - x) as usize;
                if self.owners[at] == NONE {
                    let point = DVec2::new(f64::from(i), f64::from(j)) / scale;
                    if let Some(weights) = containing_weights(corners, point) {
                        self.owners[at] = triangle;
                        self.weights[at] = weights;
                    }
                }
            }
        }
    }

    /// Evaluates all samples.
    pub(super) fn into_grid(self, patch: &Patch, uv: &[DVec2], borders: &[Border]) -> Grid {
        let mut grid = Grid {
            resolution: self.window.resolution,
            positions: Vec::with_capacity(self.owners.len()),
            attributes: Vec::with_capacity(self.owners.len()),
        };
        self.evaluate(patch, uv, |place| {
            let (position, attributes) = match place {
                Found::OnSide(side, step, resolution) => {
                    sample(patch, borders, side, step, resolution)
                }
                Found::Inside(corners, weights) => (
                    blend(corners.map(|vertex| patch.positions[vertex]), weights),
                    within_triangle(corners.map(|vertex| patch.attributes[vertex]), weights),
                ),
            };
            grid.positions.push(position);
            grid.attributes.push(attributes);
        });
        grid
    }

    /// Evaluates the positions of all samples.
    pub(super) fn into_positions(
        self,
        patch: &Patch,
        uv: &[DVec2],
        borders: &[Border],
    ) -> Vec<DVec3> {
        let mut positions = Vec::with_capacity(self.owners.len());
        self.evaluate(patch, uv, |place| {
            positions.push(match place {
                Found::OnSide(side, step, resolution) => {
                    sample(patch, borders, side, step, resolution).0
                }
                Found::Inside(corners, weights) => {
                    blend(corners.map(|vertex| patch.positions[vertex]), weights)
                }
            });
        });
        positions
    }

    /// Calls `visit` with where each sample lies, row by row.
    fn evaluate(&self, patch: &Patch, uv: &[DVec2], mut visit: impl FnMut(Found)) {
        let Window {
            resolution,
            x,
            y,
            cells,
        } = self.window;
        let scale = f64::from(1u32 << resolution);
        let mut at = 0;
        for j in y..=y + cells {
            for i in x..=x + cells {
                visit(if let Some((side, step)) = side_of(i, j, 1 << resolution) {
                    Found::OnSide(side, step, resolution)
                } else {
                    let (mut owner, mut weights) = (self.owners[at], self.weights[at]);
                    if owner == NONE {
                        let point = DVec2::new(f64::from(i), f64::from(j)) / scale;
                        (owner, weights) = nearest(patch, uv, point);
                    }
                    let corners = patch.triangles[owner as usize];
                    Found::Inside(corners.map(|vertex| vertex as usize), weights)
                });
                at += 1;
            }
        }
    }
}

/// Where a sample lies.
enum Found {
    /// On a side, so many steps from its start at a resolution.
    OnSide(usize, u32, u8),
    /// Between three vertices, with these weights.
    Inside([usize; 3], [f64; 3]),
}

/// The integers in `low..=high` that lie in a window's `from..=to` and inside the chart, in `1..=last`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to u32 before the cast"
)]
fn inner_range(low: f64, high: f64, from: u32, to: u32, last: u32) -> Option<(u32, u32)> {
    let low = low.ceil().max(f64::from(from.max(1)));
    let high = high.floor().min(f64::from(to.min(last)));
    (low <= high).then_some((low as u32, high as u32))
}

/// Where the line at height `v` meets the triangle.
fn row_span([a, b, c]: [DVec2; 3], v: f64) -> Option<(f64, f64)> {
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    for (p, q) in [(a, b), (b, c), (c, a)] {
        if (p.y < v && q.y < v) || (p.y > v && q.y > v) {
            continue;
        }
        let rise = q.y - p.y;
        let (one, other) = if rise.abs() > 0.0 {
            let u = p.x + (q.x - p.x) * ((v - p.y) / rise);
            (u, u)
        } else {
            (p.x, q.x)
        };
        from = from.min(one).min(other);
        to = to.max(one).max(other);
    }
    (from <= to).then_some((from, to))
}

/// Barycentric coordinates of a point in a triangle of either orientation, `None` outside or if it has no area.
fn containing_weights([a, b, c]: [DVec2; 3], point: DVec2) -> Option<[f64; 3]> {
    let weights = [
        orientation(b, c, point),
        orientation(c, a, point),
        orientation(a, b, point),
    ];
    let inside = weights.iter().all(|&w| w >= 0.0) || weights.iter().all(|&w| w <= 0.0);
    let sum = weights[0] + weights[1] + weights[2];
    (inside && sum != 0.0).then(|| weights.map(|w| w / sum))
}

/// The triangle nearest to a point, the first of equals, and the barycentric coordinates of its nearest point.
fn nearest(patch: &Patch, uv: &[DVec2], point: DVec2) -> (u32, [f64; 3]) {
    let mut best = (f64::INFINITY, 0, [1.0, 0.0, 0.0]);
    for (corners, triangle) in patch.triangles.iter().zip(0u32..) {
        let corners = corners.map(|vertex| uv[vertex as usize]);
        if let Some(weights) = containing_weights(corners, point) {
            return (triangle, weights);
        }
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let along =
                ((point - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
            let along = if along.is_nan() { 0.0 } else { along };
            let distance = point.distance_squared(from + (to - from) * along);
            if distance < best.0 {
                let mut weights = [0.0; 3];
                weights[k] = 1.0 - along;
                weights[(k + 1) % 3] = along;
                best = (distance, triangle, weights);
            }
        }
    }
    (best.1, best.2)
}

fn blend(corners: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

/// Triangles by the squares of (u, v) that their bounding boxes touch.
#[derive(Debug, Clone, Default)]
pub(super) struct Bins {
    count: u32,
    side: u32,
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Bins {
    pub(super) fn new(triangles: &[[u32; 3]], uv: &[DVec2]) -> Self {
        let mut side = 1u32;
        while side < MAX_BINS && (side as usize).pow(2) * BIN_LOAD < triangles.len() {
            side *= 2;
        }
        let boxes: Vec<[u32; 4]> = triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|vertex| uv[vertex as usize]);
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                [
                    bin(low.x, side),
                    bin(low.y, side),
                    bin(high.x, side),
                    bin(high.y, side),
                ]
            })
            .collect();
        let mut starts = vec![0u32; (side as usize).pow(2) + 1];
        for bounds in &boxes {
            for_each_bin(*bounds, side, |at| starts[at + 1] += 1);
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![0u32; starts.last().map_or(0, |&end| end as usize)];
        for (bounds, triangle) in boxes.iter().zip(0u32..) {
            for_each_bin(*bounds, side, |at| {
                sorted[next[at] as usize] = triangle;
                next[at] += 1;
            });
        }
        Self {
            count: u32::try_from(triangles.len()).unwrap_or(u32::MAX),
            side,
            starts,
            triangles: sorted,
        }
    }

    /// Triangles that may touch a window, its boundary included, by index.
    pub(super) fn touching(&self, window: Window) -> Vec<u32> {
        let scale = f64::from(1u32 << window.resolution);
        let place = |cell: u32| bin(f64::from(cell) / scale, self.side);
        // A triangle that ends exactly on the window's first line may lie in the bin before it.
        let before = |cell: u32| place(cell).saturating_sub(1);
        let bounds = [
            before(window.x),
            before(window.y),
            place(window.x + window.cells),
            place(window.y + window.cells),
        ];
        if bounds == [0, 0, self.side - 1, self.side - 1] {
            return (0..self.count).collect();
        }
        let mut found = Vec::new();
        for_each_bin(bounds, self.side, |at| {
            let range = self.starts[at] as usize..self.starts[at + 1] as usize;
            found.extend_from_slice(&self.triangles[range]);
        });
        found.sort_unstable();
        found.dedup();
        found
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the bins; NaN becomes 0"
)]
fn bin(coordinate: f64, side: u32) -> u32 {
    (coordinate * f64::from(side)).clamp(0.0, f64::from(side - 1)) as u32
}

fn for_each_bin([x0, y0, x1, y1]: [u32; 4], side: u32, mut visit: impl FnMut(usize)) {
    for y in y0..=y1 {
        for x in x0..=x1 {
            visit(y as usize * side as usize + x as usize);
        }
    }
}
