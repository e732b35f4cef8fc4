//! Vertex regions: disks whose adjacency is the dual of a coarse triangulation.

use crate::mesh::ManifoldMesh;

/// The label of every vertex of a [`ManifoldMesh`].
///
/// Let K be the mesh with every boundary loop closed by a virtual vertex of its own region. Then: every region's dual cell
/// is a disk, two regions meet in at most one arc, three in at most one triangle, and every region has at least
/// three neighbours.
#[derive(Debug, Clone, Default)]
pub struct Segmentation {
    /// Region of every vertex, `0..regions`.
    pub labels: Vec<u32>,
    /// Number of regions.
    pub regions: u32,
    /// For half-edge `3 * t + k` whose ends have different labels: where, from its start (0) to its end (1), the border of the two
    /// regions crosses the edge, in `[0.05, 0.95]`; both half-edges of an edge agree (`1 - f`). 0.5 elsewhere.
    pub crossings: Vec<f32>,
}

/// Cuts `mesh` into about `target_regions` regions (more where topology asks).
///
/// # Errors
/// Never for a valid manifold mesh with at least one triangle.
pub fn segment(mesh: &ManifoldMesh, target_regions: u32) -> Segmentation {
    let _ = (mesh, target_regions);
    unimplemented!()
}
