//! The two surfaces that are compared: a patch, and the image that a window's samples make of it.

use super::Window;
use super::tighten::Surface;
use crate::atlas::patch::Patch;
use crate::parameterize::Edges;
use glam::{DVec2, DVec3};
use std::cell::OnceCell;

/// Half a cell: a triangle of the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Half {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) upper: bool,
}

/// The image over a half cell, linear in the window's coordinates.
pub(super) struct Facet {
    corner: DVec2,
    base: DVec3,
    along_u: DVec3,
    along_v: DVec3,
}

impl Facet {
    pub(super) fn at(&self, place: DVec2) -> DVec3 {
        let inside = place - self.corner;
        self.base + self.along_u * inside.x + self.along_v * inside.y
    }
}

/// A window's samples at one level.
pub(super) struct Image<'a> {
    positions: &'a [DVec3],
    row: usize,
    stride: usize,
    pub(super) cells: u32,
    /// Cells of this level a chart side, and the window's first.
    pub(super) scale: f64,
    pub(super) origin: DVec2,
}

impl<'a> Image<'a> {
    /// Every 2^`level`-th sample of a window.
    pub(super) fn of(window: Window, level: u32, positions: &'a [DVec3]) -> Self {
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

    pub(super) fn facet(&self, half: Half) -> Facet {
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

    /// The image at a place, in cells of this level; of places outside the window, the nearest cell's plane.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts saturate; NaN becomes 0"
    )]
    pub(super) fn at(&self, place: DVec2) -> DVec3 {
        let last = self.cells - 1;
        let (x, y) = ((place.x as u32).min(last), (place.y as u32).min(last));
        let (u, v) = (place.x - f64::from(x), place.y - f64::from(y));
        let (near, far) = (self.sample(x, y), self.sample(x + 1, y + 1));
        if v > u {
            near * (1.0 - v) + far * u + self.sample(x, y + 1) * (v - u)
        } else {
            near * (1.0 - u) + self.sample(x + 1, y) * (u - v) + far * v
        }
    }

    /// The cells that a span of one coordinate touches, kept inside the window.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the window's cells"
    )]
    pub(super) fn cell_range(&self, low: f64, high: f64) -> [u32; 2] {
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
pub(super) struct Source<'a> {
    pub(super) patch: &'a Patch,
    pub(super) uv: &'a [DVec2],
    neighbours: OnceCell<Vec<[u32; 3]>>,
}

impl<'a> Source<'a> {
    pub(super) fn new(patch: &'a Patch, uv: &'a [DVec2]) -> Self {
        Self {
            patch,
            uv,
            neighbours: OnceCell::new(),
        }
    }
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
