//! The piece of the source surface under one chart.

use glam::{DVec3, Vec3};
use std::ops::RangeInclusive;

/// Attributes of a surface point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Attributes {
    /// Normal, unit length or zero.
    pub normal: Vec3,
    /// Linear-light colour, 0..=1 each.
    pub colour: Vec3,
    /// 0 on the imported surface, above it inside a cap that closes what cutting a handle opened.
    pub cap: f32,
}

/// A border curve between two charts, or of one chart and nothing: sampled once, copied into both.
#[derive(Debug, Clone, Default)]
pub struct Border {
    /// Polyline, at least two points.
    pub points: Vec<DVec3>,
    /// Attributes at the points.
    pub attributes: Vec<Attributes>,
    /// Parameter of every point: strictly increasing from 0 to 1 (arc length, or density-weighted).
    pub params: Vec<f64>,
}

impl Border {
    /// Largest distance of the curve, where its parameter is in `part`, from the polyline through its points at
    /// parameters k / 2^resolution.
    pub fn chord_error(&self, resolution: u8, part: RangeInclusive<f64>) -> f64 {
        let cells = f64::from(1u32 << resolution);
        let at = |t: f64| {
            let i = self
                .params
                .partition_point(|&p| p <= t)
                .clamp(1, self.params.len() - 1);
            let (p, q) = (self.params[i - 1], self.params[i]);
            self.points[i - 1].lerp(self.points[i], ((t - p) / (q - p)).clamp(0.0, 1.0))
        };
        self.params
            .iter()
            .zip(&self.points)
            .filter(|&(t, _)| part.contains(t))
            .map(|(&t, &point)| {
                let cell = (t * cells).floor().min(cells - 1.0);
                let (a, b) = (at(cell / cells), at((cell + 1.0) / cells));
                let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                point.distance(if along.is_nan() { a } else { a.lerp(b, along) })
            })
            .fold(0.0, f64::max)
    }
}

/// The piece of the source under one chart: a triangulated disk with four sides.
#[derive(Debug, Clone, Default)]
pub struct Patch {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex attributes.
    pub attributes: Vec<Attributes>,
    /// Counter-clockwise triangles; every vertex is used.
    pub triangles: Vec<[u32; 3]>,
    /// The vertices of each side in order, both corners included: `sides[s]` ends where `sides[s + 1]` starts.
    pub sides: [Vec<u32>; 4],
    /// Border of each side, and whether the side runs along it (else against it). The side has as many vertices as the
    /// border has points.
    pub borders: [(u32, bool); 4],
}

impl Patch {
    /// Surface area.
    pub fn area(&self) -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            (b - a).cross(c - a).length()
        };
        0.5 * self.triangles.iter().map(doubled).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A right angle in the middle of the first half.
    fn corner() -> Border {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 3.0, 0.0)];
        Border {
            attributes: vec![Attributes::default(); 3],
            params: vec![0.0, 0.25, 1.0],
            points,
        }
    }

    #[test]
    fn a_corner_between_samples_is_cut_off() {
        assert!(corner().chord_error(0, 0.0..=1.0) > 0.9);
        assert!(corner().chord_error(1, 0.0..=1.0) > 0.4);
        assert!(corner().chord_error(2, 0.0..=1.0) < 1e-12);
    }

    #[test]
    fn only_the_part_asked_for_counts() {
        assert!(corner().chord_error(1, 0.5..=1.0) < 1e-12);
    }
}
