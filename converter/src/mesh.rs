//! Triangle meshes between import and segmentation.

use glam::DVec3;

/// No vertex, half-edge or face.
pub const NONE: u32 = u32::MAX;

/// A mesh as an importer read it: polygons triangulated, nothing welded, nothing dropped yet.
#[derive(Debug, Clone, Default)]
pub struct ImportedMesh {
    /// Vertex positions, input units. May hold non-finite numbers.
    pub positions: Vec<DVec3>,
    /// Vertex sRGB colours, as many as positions, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Triangles; every index is in range.
    pub triangles: Vec<[u32; 3]>,
}

/// An oriented 2-manifold with border. Every vertex has one fan of triangles; every edge has one or two.
#[derive(Debug, Clone, Default)]
pub struct ManifoldMesh {
    /// Vertex positions; copies made to split a vertex have bit-equal positions.
    pub positions: Vec<DVec3>,
    /// Welded vertex that each vertex is (a copy of).
    pub origin: Vec<u32>,
    /// sRGB colours, as many as positions, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Unit vertex normals (area-and-angle-weighted over all copies of the origin that lie on the same sheet).
    pub normals: Vec<DVec3>,
    /// Counter-clockwise triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Opposite half-edge of half-edge `3 * t + k` (which runs from corner k to corner k + 1 of triangle t), or [`NONE`].
    pub twins: Vec<u32>,
}
