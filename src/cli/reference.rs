//! The input that a file is compared with.

use glam::DVec3;
use marquetry_converter::import;
use marquetry_converter::mesh::ImportedMesh;
use marquetry_evaluation::Mesh;
use std::path::Path;

/// An imported mesh without the triangles that have a corner which is no place.
#[derive(Debug)]
pub(super) struct Reference {
    pub(super) mesh: ImportedMesh,
    /// Bounds of all triangles; vertices that no triangle uses do not count.
    pub(super) min: DVec3,
    pub(super) max: DVec3,
}

impl Reference {
    /// Imports the mesh at `path`.
    ///
    /// # Errors
    /// When it cannot be read or is not a mesh.
    pub(super) fn load(path: &Path) -> anyhow::Result<Self> {
        let (mut mesh, _) = import::import(path)?;
        let ImportedMesh {
            positions,
            triangles,
            appearance,
            ..
        } = &mut mesh;
        let is_whole = |triangle: &[u32; 3]| {
            let mut corners = triangle.iter().map(|&v| positions.get(v as usize));
            corners.all(|corner| corner.is_some_and(|p| p.is_finite()))
        };
        if !triangles.iter().all(is_whole) {
            let kept: Vec<bool> = triangles.iter().map(is_whole).collect();
            let mut keep = kept.iter();
            triangles.retain(|_| keep.next().is_some_and(|&kept| kept));
            let mut keep = kept.iter();
            appearance
                .faces
                .retain(|_| keep.next().is_some_and(|&kept| kept));
        }
        let corners = mesh.triangles.iter().flatten();
        let (min, max) = corners
            .filter_map(|&vertex| mesh.positions.get(vertex as usize))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
                (min.min(p), max.max(p))
            });
        Ok(Self { mesh, min, max })
    }

    /// The mesh, borrowed.
    pub(super) fn mesh(&self) -> Mesh<'_> {
        Mesh {
            positions: &self.mesh.positions,
            triangles: &self.mesh.triangles,
        }
    }

    /// Diagonal of the bounds; 0 without triangles.
    pub(super) fn diagonal(&self) -> f64 {
        let diagonal = (self.max - self.min).length();
        if diagonal.is_finite() { diagonal } else { 0.0 }
    }

    /// `length` over the diagonal; 0 where there is none.
    pub(super) fn rel(&self, length: f64) -> f64 {
        let diagonal = self.diagonal();
        if diagonal > 0.0 {
            length / diagonal
        } else {
            0.0
        }
    }
}
