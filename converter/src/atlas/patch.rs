//! The piece of the source surface under one chart.

use glam::{DVec3, Vec3};

/// Attributes of a surface point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Attributes {
    /// Normal, unit length or zero.
    pub normal: Vec3,
    /// Linear-light colour, 0..=1 each.
    pub colour: Vec3,
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
