//! L² stretch of a map from the square to the surface.
//!
//! Sander, Snyder, Gortler & Hoppe, "Texture mapping progressive meshes", 2001: the root mean square of the map's
//! directional derivatives, by area. Here it is normalised by the total areas, so an isometry up to scale has stretch 1.
//!
//! Triangles without area in space carry no stretch; a triangle without area in (u, v) has infinite stretch.

use glam::{DVec2, DVec3};

/// Bounds of a vertex's stretch: one reweight changes a weight at most by their squares.
const STRETCH_RANGE: [f64; 2] = [1e-3, 1e6];

/// What a doubled area in (u, v) is taken for when it is smaller or negative: about what rounding can tell from zero.
const SMALLEST_AREA: f64 = 1e-30;

/// What stretch needs of the triangles in space.
#[derive(Debug)]
pub(super) struct Metric {
    shapes: Vec<Shape>,
    area: f64,
}

/// Squared lengths of two sides of a triangle, their dot product, and the area.
#[derive(Debug, Clone, Copy)]
struct Shape {
    first: f64,
    second: f64,
    dot: f64,
    area: f64,
}

impl Metric {
    pub(super) fn of(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut area = 0.0;
        let shapes = triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|vertex| positions[vertex as usize]);
                let (first, second) = (b - a, c - a);
                let shape = Shape {
                    first: first.length_squared(),
                    second: second.length_squared(),
                    dot: first.dot(second),
                    area: 0.5 * first.cross(second).length(),
                };
                area += shape.area;
                shape
            })
            .collect();
        Self { shapes, area }
    }

    /// Part of the area, 0..=1, that triangles with only such corners have.
    pub(super) fn part(&self, triangles: &[[u32; 3]], is_such: impl Fn(u32) -> bool) -> f64 {
        let such = triangles.iter().zip(&self.shapes);
        let area: f64 = such
            .filter(|(corners, _)| corners.iter().all(|&v| is_such(v)))
            .map(|(_, shape)| shape.area)
            .sum();
        area / self.area.max(f64::MIN_POSITIVE)
    }

    /// L² stretch of the whole map, at least 1; 0 without area in space, infinite if a face has none in (u, v).
    pub(super) fn stretch(&self, triangles: &[[u32; 3]], uv: &[DVec2]) -> f64 {
        if self.area <= 0.0 {
            return 0.0;
        }
        let mut energy = 0.0;
        for (corners, shape) in triangles.iter().zip(&self.shapes) {
            energy += shape.energy(corners.map(|vertex| uv[vertex as usize]), 0.0);
        }
        energy.sqrt() / self.area
    }

    /// Stretch around every vertex where an isometry onto a square of the same area has 1; faces that are flipped or
    /// flat by rounding count as very small.
    pub(super) fn vertex_stretch(
        &self,
        triangles: &[[u32; 3]],
        uv: &[DVec2],
        around: &mut Vec<f64>,
    ) {
        let mut sums = vec![(0.0, 0.0); uv.len()];
        for (corners, shape) in triangles.iter().zip(&self.shapes) {
            let energy = shape.energy(corners.map(|vertex| uv[vertex as usize]), SMALLEST_AREA);
            for &vertex in corners {
                let sum = &mut sums[vertex as usize];
                sum.0 += energy;
                sum.1 += shape.area;
            }
        }
        around.clear();
        around.extend(sums.iter().map(|&(energy, area)| {
            let stretch = (energy / area / self.area).sqrt();
            if stretch.is_finite() {
                stretch.clamp(STRETCH_RANGE[0], STRETCH_RANGE[1])
            } else {
                1.0
            }
        }));
    }
}

impl Shape {
    /// Area times squared L² stretch, where the square has area 1; infinite without any area in (u, v).
    fn energy(&self, [a, b, c]: [DVec2; 3], smallest_area: f64) -> f64 {
        if self.area <= 0.0 {
            return 0.0;
        }
        let (first, second) = (b - a, c - a);
        let doubled_area = first.perp_dot(second).max(smallest_area);
        if doubled_area <= 0.0 {
            return f64::INFINITY;
        }
        let gradient = self.first * second.length_squared() + self.second * first.length_squared()
            - 2.0 * self.dot * first.dot(second);
        0.5 * self.area * (gradient / doubled_area / doubled_area).max(0.0)
    }
}
