//! A mesh that is measured more than once.

use super::{Bvh, CHUNK, Closest, Distances, Mesh, MeshError, OneWay, Sums, of_both, one_way};
use glam::DVec3;
use rayon::prelude::*;

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

    /// By point, the nearest of this mesh; `None` where the point is not finite. Quicker where points follow one another on a surface.
    pub fn nearest(&self, points: &[DVec3]) -> Vec<Option<Closest>> {
        let chunks = points.par_chunks(CHUNK).flat_map_iter(|chunk| {
            let mut hint = 0;
            let of = move |&point: &DVec3| self.tree.closest_from(point, &mut hint);
            chunk.iter().map(of)
        });
        chunks.collect()
    }

    /// What [`from_points`](super::from_points) finds.
    pub fn from_points(&self, points: &[DVec3]) -> OneWay {
        let chunks: Vec<Sums> = points
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut hint = 0;
                let mut sums = Sums::default();
                let mut of = |&point: &DVec3| self.tree.closest_from(point, &mut hint);
                for closest in chunk.iter().filter_map(&mut of) {
                    sums.add(closest.distance2);
                }
                sums
            })
            .collect();
        let mut total = Sums::default();
        for chunk in &chunks {
            total.merge(chunk);
        }
        total.distances()
    }
}
