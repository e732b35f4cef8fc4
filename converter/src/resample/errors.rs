//! Distance between a patch and its image, over the overlay of both meshes.
//!
//! The largest |S − I| over the overlay's corners bounds the Hausdorff distance both ways, but it counts sliding along the
//! surface as well. So source triangles that stand out are bounded again, in descending order, by [`super::tighten`], until
//! the next cannot matter.
//!
//! Limit: this compares over the chart's own square. Where a border's samples cut a corner of the border curve, the sliver
//! between is compared with this chart's image only, though the neighbour's may be closer: the bound is then loose.

use super::overlay::{Place, Scratch, visit};
use super::polygon::Polygon;
use super::surfaces::{Image, Source};
use super::tighten::{Surface, bound, unit_normal};
use super::{GridError, Window};
use crate::atlas::patch::Patch;
use glam::{DVec2, DVec3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

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
    let source = Source::new(patch, uv);
    let mut scratch = Scratch::default();
    let mut errors = Vec::new();
    let mut level = 0;
    while window.cells >> level > 0 {
        let image = Image::of(window, level, positions);
        errors.push(error(
            &source,
            &image,
            triangles,
            &mut scratch,
            Bound::Tight,
        ));
        level += 1;
    }
    errors.reverse();
    errors
}

/// The error of a window at its finest.
pub(super) fn finest_error(
    patch: &Patch,
    uv: &[DVec2],
    triangles: &[u32],
    window: Window,
    positions: &[DVec3],
    bound: Bound,
) -> GridError {
    let source = Source::new(patch, uv);
    let image = Image::of(window, 0, positions);
    error(&source, &image, triangles, &mut Scratch::default(), bound)
}

/// How much work goes into the guaranteed bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bound {
    /// The largest |S − I|.
    Parametric,
    /// As tight as walking over the surfaces gets it.
    Tight,
}

/// A triangle, and the largest squared gap over it.
#[derive(Debug, Clone, Copy)]
struct Loose {
    square: f64,
    triangle: u32,
}

impl Ord for Loose {
    /// By the gap; of equal ones the first triangle is the largest.
    fn cmp(&self, other: &Self) -> Ordering {
        self.square
            .total_cmp(&other.square)
            .then(other.triangle.cmp(&self.triangle))
    }
}

impl PartialOrd for Loose {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Loose {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Loose {}

/// The error of one image.
fn error(
    source: &Source,
    image: &Image,
    triangles: &[u32],
    scratch: &mut Scratch,
    bound: Bound,
) -> GridError {
    let mut loose = Vec::with_capacity(triangles.len());
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
        loose.push(Loose {
            square: farthest,
            triangle,
        });
    }
    let most = loose
        .iter()
        .fold(0.0f64, |most, loose| most.max(loose.square))
        .sqrt()
        .max(plane);
    let max = match bound {
        Bound::Parametric => most,
        Bound::Tight => tightened(source, image, loose, plane, most, scratch),
    };
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

/// The bound, from `plane` to `most`, given the largest squared gap of every triangle.
fn tightened(
    source: &Source,
    image: &Image,
    mut loose: Vec<Loose>,
    plane: f64,
    most: f64,
    scratch: &mut Scratch,
) -> f64 {
    let mut max = plane;
    let threshold = (plane * TIGHT_ENOUGH).powi(2);
    loose.retain(|loose| loose.square > threshold);
    // Few of them are looked at, so they are not sorted.
    let mut queue = BinaryHeap::from(loose);
    while let Some(Loose { square, triangle }) = queue.pop() {
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
    max.max((plane * TIGHT_ENOUGH).min(most))
}
