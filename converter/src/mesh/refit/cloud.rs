//! Points of a surface, with its normals there.

use super::barycentric;
use glam::{DVec3, Vec3};
use marquetry_evaluation::distance::{self, Mesh, MeshError};

/// Cosine of the angle between a face and the normals of its vertices from which on the face's own is taken: there is a crease.
const CREASE: f64 = 0.766;

/// What a mesh is fitted to.
#[derive(Debug, Clone, Default)]
pub struct Cloud {
    /// Finite ones.
    pub(super) places: Vec<DVec3>,
    /// Of length 1, or zero where the surface has none.
    pub(super) normals: Vec<Vec3>,
}

impl Cloud {
    /// About `count` points spread evenly over `surface`, whose vertices have `normals`, of any length.
    ///
    /// # Errors
    /// When the mesh has an index out of range or a coordinate that is not finite.
    pub fn on(surface: Mesh<'_>, normals: &[DVec3], count: u64) -> Result<Self, MeshError> {
        let mut cloud = Self::default();
        distance::for_each_sample(surface, count, |triangle, place| {
            let corners = surface.corners(triangle);
            let face = distance::normal(corners).unwrap_or_default();
            let own = surface.triangles[triangle].map(|v| normals[v as usize].normalize_or_zero());
            let at = barycentric(corners, place).unwrap_or_default();
            let mean = at[0] * own[0] + at[1] * own[1] + at[2] * own[2];
            let mean = mean.normalize_or_zero();
            let normal = if own.iter().all(|own| own.dot(face) >= CREASE) {
                mean
            } else {
                face
            };
            cloud.places.push(place);
            cloud.normals.push(normal.as_vec3());
        })?;
        Ok(cloud)
    }

    /// Runs of at most `most` places and their normals.
    pub(super) fn chunks(&self, most: usize) -> impl Iterator<Item = (&[DVec3], &[Vec3])> {
        self.places.chunks(most).zip(self.normals.chunks(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::normals::vertex_normals;
    use glam::DMat3;

    /// Two squares with an edge in common: bent a little, points near it have normals between those of both, bent far they have those of their square.
    #[test]
    fn normals_are_smooth_but_for_creases() {
        for (degrees, is_smooth) in [(11.0_f64, true), (-85.0, false)] {
            let fold = DMat3::from_rotation_y(-degrees.to_radians());
            let at = |x: f64, y: f64| {
                let place = DVec3::new(x, y, 0.0);
                if x > 0.0 { fold * place } else { place }
            };
            let positions = [-1.0, 0.0, 1.0].map(|x| [at(x, 0.0), at(x, 1.0)]);
            let triangles = [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]];
            let surface = Mesh {
                positions: positions.as_flattened(),
                triangles: &triangles,
            };
            let cloud = Cloud::on(surface, &vertex_normals(surface), 1000).unwrap();
            assert_eq!(cloud.places.len(), 1000);
            let faces = [DVec3::Z, fold * DVec3::Z];
            let is_of_face = |normal: &&Vec3| {
                let nearest = faces.map(|face| normal.as_dvec3().distance(face));
                nearest.into_iter().fold(f64::INFINITY, f64::min) < 1e-6
            };
            let of_faces = cloud.normals.iter().filter(is_of_face).count();
            assert!(
                if is_smooth {
                    of_faces < 100
                } else {
                    of_faces == 1000
                },
                "{of_faces}"
            );
        }
    }
}
