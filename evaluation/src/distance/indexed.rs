//! A mesh that is measured more than once.

use super::{Bvh, Distances, Mesh, MeshError, of_both, one_way, sampled};

/// A mesh and its tree, for more than one measurement.
#[derive(Debug)]
pub struct Indexed<'a> {
    /// The mesh.
    pub mesh: Mesh<'a>,
    /// Its tree.
    pub tree: Bvh,
}

impl<'a> Indexed<'a> {
    /// Builds the tree.
    ///
    /// # Errors
    /// When the mesh has no triangles, an index out of range or a coordinate that is not finite.
    pub fn new(mesh: Mesh<'a>) -> Result<Self, MeshError> {
        if mesh.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        let tree = Bvh::new(mesh.positions, mesh.triangles)?;
        Ok(Self { mesh, tree })
    }

    /// What [`measure`](super::measure) finds.
    pub fn measure(&self, other: &Self, samples: u64) -> Distances {
        let samples = samples.max(1);
        let forward = one_way(self.mesh, other.mesh, &other.tree, samples);
        let backward = one_way(other.mesh, self.mesh, &self.tree, samples);
        of_both(&forward, &backward, samples)
    }

    /// RMS distance to this mesh from `samples` samples, at least 1, over another that has finite corners.
    pub fn rms_from(&self, other: Mesh<'_>, samples: u64) -> f64 {
        sampled(other, self.mesh, &self.tree, samples.max(1))
            .distances()
            .rms
    }
}
