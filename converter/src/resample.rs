//! Surface samples over the unit square, and how far they are from the source.
//!
//! Samples on a side come from the chart's borders, evaluated in the border's own direction, so both charts of a border get
//! the same bits. Samples inside are found by rasterizing the patch's triangles in (u, v) with exact predicates:
//! a certified parametrization covers every sample. Where it is not certified, the nearest triangle in (u, v) answers.
//!
//! A sample depends on its place in the square alone: any window of any resolution gives the bits that the whole grid has
//! there.
//!
//! Errors: [`GridError`] says what is guaranteed.

mod attributes;
mod borders;
mod errors;
mod locate;
mod overlay;
mod points;
mod polygon;
mod surfaces;
#[cfg(test)]
mod tests;
mod tighten;

use crate::atlas::patch::{Attributes, Border, Patch};
use crate::parameterize::Parametrization;
use errors::Bound;
use glam::{DVec2, DVec3};
use locate::{Bins, Raster};
pub(crate) use points::SourcePoint;
use surfaces::{Image, Source};

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

/// A square part of a chart's grid: `cells` × `cells` cells of `resolution` from cell (x, y).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// log2 of the whole chart's cells a side, at most 30.
    pub resolution: u8,
    /// First cell along u.
    pub x: u32,
    /// First cell along v.
    pub y: u32,
    /// Cells a side; for errors a power of two.
    pub cells: u32,
}

impl Window {
    /// The whole chart.
    pub fn whole(resolution: u8) -> Self {
        Self {
            resolution,
            x: 0,
            y: 0,
            cells: 1 << resolution,
        }
    }
}

/// How far a grid's surface is from its patch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GridError {
    /// Upper bound of the Hausdorff distance both ways.
    pub max: f64,
    /// Largest distance to the source triangle's plane over the overlay of both meshes, at corresponding points:
    /// realistic, not guaranteed; never above `max`.
    pub max_plane: f64,
    /// Area-weighted mean of the squared distance (to the tangent plane of the source).
    pub mean_square: f64,
    /// Source area that the mean was taken over.
    pub area: f64,
}

/// Samples the patch at `resolution`; border samples come from `borders` (evaluated in the border's own direction), so
/// both charts of a border get bit-equal ones.
pub fn resample(
    patch: &Patch,
    parametrization: &Parametrization,
    borders: &[Border],
    resolution: u8,
) -> Grid {
    let window = Window::whole(resolution);
    let mut raster = Raster::new(window);
    for (corners, triangle) in patch.triangles.iter().zip(0u32..) {
        raster.draw(
            triangle,
            corners.map(|vertex| parametrization.uv[vertex as usize]),
        );
    }
    raster.into_grid(patch, &parametrization.uv, borders)
}

/// Samples a window; equal to that part of the whole grid, bit for bit.
///
/// For many windows of one patch use a [`Sampler`].
pub fn resample_window(
    patch: &Patch,
    parametrization: &Parametrization,
    borders: &[Border],
    window: Window,
) -> Grid {
    Sampler::new(patch, parametrization).grid(borders, window)
}

/// Error of every coarser resolution and of the grid itself: `result[r]` for r in `0..=resolution`, over the whole chart.
/// `positions` are the decoded samples at `resolution` (same order as [`Grid`]).
pub fn grid_errors(
    patch: &Patch,
    parametrization: &Parametrization,
    resolution: u8,
    positions: &[DVec3],
) -> Vec<GridError> {
    let all: Vec<u32> = (0u32..).take(patch.triangles.len()).collect();
    errors::errors(
        patch,
        &parametrization.uv,
        &all,
        Window::whole(resolution),
        positions,
    )
}

/// Errors over a window: `result[k]` where it is drawn with 2^k cells a side, up to `window.cells`.
/// `positions` are its (cells + 1)² decoded samples.
///
/// For many windows of one patch use a [`Sampler`].
pub fn grid_errors_window(
    patch: &Patch,
    parametrization: &Parametrization,
    window: Window,
    positions: &[DVec3],
) -> Vec<GridError> {
    Sampler::new(patch, parametrization).errors(window, positions)
}

/// What points of the source tell of a grid's error: quick, good enough to choose by, not guaranteed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Estimate {
    /// Integral over the source's area of the squared distance to its tangent plane.
    pub(crate) squares: f64,
    /// Area of the source.
    pub(crate) area: f64,
    /// Largest distance to a tangent plane.
    pub(crate) worst: f64,
}

impl Estimate {
    /// Adds a point that stands for an `area` and is `height` from its plane.
    pub(crate) fn add(&mut self, area: f64, height: f64) {
        self.squares += area * height * height;
        self.area += area;
        self.worst = self.worst.max(height.abs());
    }
}

/// A patch whose triangles are sorted into bins over (u, v), for many windows.
#[derive(Debug)]
pub struct Sampler<'a> {
    patch: &'a Patch,
    parametrization: &'a Parametrization,
    bins: Bins,
}

impl<'a> Sampler<'a> {
    /// Sorts the triangles.
    pub fn new(patch: &'a Patch, parametrization: &'a Parametrization) -> Self {
        let bins = Bins::new(&patch.triangles, &parametrization.uv);
        Self {
            patch,
            parametrization,
            bins,
        }
    }

    /// See [`resample_window`].
    pub fn grid(&self, borders: &[Border], window: Window) -> Grid {
        let raster = self.raster(window);
        raster.into_grid(self.patch, &self.parametrization.uv, borders)
    }

    /// The positions of [`Self::grid`].
    pub(crate) fn positions(&self, borders: &[Border], window: Window) -> Vec<DVec3> {
        let raster = self.raster(window);
        raster.into_positions(self.patch, &self.parametrization.uv, borders)
    }

    fn raster(&self, window: Window) -> Raster {
        let mut raster = Raster::new(window);
        for triangle in self.bins.touching(window) {
            let corners = self.patch.triangles[triangle as usize];
            raster.draw(
                triangle,
                corners.map(|vertex| self.parametrization.uv[vertex as usize]),
            );
        }
        raster
    }

    /// The error of a window at its finest resolution alone.
    pub fn error(&self, window: Window, positions: &[DVec3]) -> GridError {
        self.finest(window, positions, Bound::Tight)
    }

    /// As [`Self::error`], but quicker where samples slide along the surface: `max` is an upper bound too, but counts
    /// the sliding.
    pub fn quick_error(&self, window: Window, positions: &[DVec3]) -> GridError {
        self.finest(window, positions, Bound::Parametric)
    }

    fn finest(&self, window: Window, positions: &[DVec3], bound: Bound) -> GridError {
        let triangles = self.bins.touching(window);
        errors::finest_error(
            self.patch,
            &self.parametrization.uv,
            &triangles,
            window,
            positions,
            bound,
        )
    }

    /// See [`grid_errors_window`].
    pub fn errors(&self, window: Window, positions: &[DVec3]) -> Vec<GridError> {
        let triangles = self.bins.touching(window);
        errors::errors(
            self.patch,
            &self.parametrization.uv,
            &triangles,
            window,
            positions,
        )
    }

    /// Triangles that may touch a window, and their boxes in its cells: lowest and highest corner.
    pub(crate) fn boxes(&self, window: Window) -> Vec<(u32, [DVec2; 2])> {
        let scale = f64::from(1u32 << window.resolution);
        let origin = DVec2::new(f64::from(window.x), f64::from(window.y));
        let of_triangle = |triangle: u32| {
            let corners = self.patch.triangles[triangle as usize];
            let [a, b, c] = corners.map(|v| self.parametrization.uv[v as usize] * scale - origin);
            (triangle, [a.min(b).min(c), a.max(b).max(c)])
        };
        let touching = self.bins.touching(window);
        touching.into_iter().map(of_triangle).collect()
    }

    /// Calls `emit` with points of the source in a window.
    pub(crate) fn visit_points(&self, window: Window, emit: impl FnMut(&SourcePoint)) {
        self.visit_points_of(window, &self.bins.touching(window), emit);
    }

    /// Calls `emit` with points of some triangles in a window.
    pub(crate) fn visit_points_of(
        &self,
        window: Window,
        triangles: &[u32],
        emit: impl FnMut(&SourcePoint),
    ) {
        let source = Source::new(self.patch, &self.parametrization.uv);
        points::visit_points(&source, window, triangles, emit);
    }

    /// Estimates where a window is drawn with 2^k cells a side, for the last `count` of k = 0..=log2 `window.cells`; those
    /// of the coarsest of them from fewer points.
    pub(crate) fn estimates(
        &self,
        window: Window,
        positions: &[DVec3],
        count: usize,
    ) -> Vec<Estimate> {
        /// Levels that see all points.
        const DENSE: usize = 2;
        /// The others see one of so many.
        const THINNED: usize = 3;
        let images: Vec<(f64, Image)> = (0u32..)
            .take(count)
            .map(|level| {
                let scale = 1.0 / f64::from(1u32 << level);
                (scale, Image::of(window, level, positions))
            })
            .collect();
        let mut estimates = vec![Estimate::default(); count];
        let mut seen = 0;
        self.visit_points(window, |point| {
            let levels = if seen % THINNED == 0 { count } else { DENSE };
            seen += 1;
            for ((scale, image), estimate) in images.iter().zip(&mut estimates).take(levels) {
                let gap = image.at(point.place * *scale) - point.surface;
                let height = gap.dot(point.normal);
                estimate.add(point.area, height);
            }
        });
        let area = estimates.first().map_or(0.0, |finest| finest.area);
        for estimate in &mut estimates {
            if estimate.area > 0.0 {
                estimate.squares *= area / estimate.area;
            }
            estimate.area = area;
        }
        estimates.reverse();
        estimates
    }
}
