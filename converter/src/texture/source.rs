//! Where on the source's images the triangles of a chart or a cluster lie.
//!
//! A triangle of a patch is a piece of a source triangle, so one look-up by its centre serves all its texels: the source triangle
//! nearest to it, and the corners' texture coordinates by its plane. Nothing has to be carried through welding, cutting
//! and layout for that.
//!
//! Limits: of source triangles that coincide, any one is taken; a patch triangle that closes a hole gets the colour of the
//! nearest triangle beside it.

use super::appearance::{Appearance, NO_MATERIAL, TexturedFace};
use crate::atlas::patch::Patch;
use glam::{DVec2, DVec3, Vec2};
use marquetry_evaluation::distance::{Bvh, MeshError};

/// The imported triangles, to be found by place.
#[derive(Debug)]
pub struct SourceMesh {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    bvh: Bvh,
    /// By triangle of the tree.
    numbers: Vec<u32>,
}

impl SourceMesh {
    /// Triangles with a corner that is not finite, or without area, are left out.
    ///
    /// # Errors
    /// When no triangle is left.
    pub fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let usable = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            let area = (b - a).cross(c - a).length_squared();
            area.is_finite() && area > 0.0
        };
        let numbered = triangles.iter().zip(0u32..).filter(|(t, _)| usable(t));
        let (kept, numbers): (Vec<[u32; 3]>, Vec<u32>) = numbered.map(|(t, n)| (*t, n)).unzip();
        let bvh = Bvh::new(&positions, &kept)?;
        Ok(Self {
            positions,
            triangles,
            bvh,
            numbers,
        })
    }

    /// What covers every triangle of `patch`.
    pub fn faces_of(&self, patch: &Patch, appearance: &Appearance) -> Vec<TexturedFace> {
        let corners = |t: &[u32; 3]| t.map(|v| patch.positions[v as usize]);
        patch
            .triangles
            .iter()
            .map(|t| self.face(corners(t), appearance))
            .collect()
    }

    /// What covers a triangle that is a piece of a source triangle.
    pub fn face(&self, corners: [DVec3; 3], appearance: &Appearance) -> TexturedFace {
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let face = || {
            let found = self.bvh.closest(centre, f64::INFINITY)?;
            let number = *self.numbers.get(found.triangle as usize)? as usize;
            let source = appearance.faces.get(number)?;
            if source.material == NO_MATERIAL {
                return None;
            }
            let own = self.triangles[number].map(|v| self.positions[v as usize]);
            Some(TexturedFace {
                material: source.material,
                uv: corners.map(|p| carried(own, source.uv, p)),
            })
        };
        face().unwrap_or(TexturedFace::PLAIN)
    }
}

/// The texture coordinates at `point`, projected to the plane of a triangle that has area.
fn carried(corners: [DVec3; 3], uv: [Vec2; 3], point: DVec3) -> Vec2 {
    let [s, t] = weights(corners, point).to_array();
    let uv = uv.map(Vec2::as_dvec2);
    (uv[0] + (uv[1] - uv[0]) * s + (uv[2] - uv[0]) * t).as_vec2()
}

/// Weights of the second and third corner at `point`, projected to the plane of a triangle; no numbers for one without area.
pub(super) fn weights([a, b, c]: [DVec3; 3], point: DVec3) -> DVec2 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    DVec2::new(
        ap.cross(ac).dot(normal) / area,
        ab.cross(ap).dot(normal) / area,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::appearance::Material;

    #[test]
    fn a_piece_of_a_triangle_keeps_its_place_on_the_image() {
        let positions = vec![DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0, DVec3::Z * -9.0];
        let source = SourceMesh::new(positions, vec![[0, 1, 2], [0, 3, 1], [0, 0, 1]]).unwrap();
        let square = TexturedFace {
            material: 0,
            uv: [Vec2::ZERO, Vec2::X, Vec2::Y],
        };
        let appearance = Appearance {
            materials: vec![Material::default()],
            faces: vec![square, TexturedFace::PLAIN, square],
            ..Appearance::default()
        };
        let patch = Patch {
            positions: vec![
                DVec3::new(1.0, 0.0, 0.0),
                DVec3::new(2.0, 0.0, 0.0),
                DVec3::new(1.0, 1.0, 0.0),
                DVec3::new(1.0, 0.0, -1.0),
            ],
            triangles: vec![[0, 1, 2], [0, 3, 1]],
            ..Patch::default()
        };
        let faces = source.faces_of(&patch, &appearance);
        assert_eq!(
            faces[0].uv,
            [
                Vec2::new(0.25, 0.0),
                Vec2::new(0.5, 0.0),
                Vec2::new(0.25, 0.25)
            ]
        );
        assert_eq!(faces[1], TexturedFace::PLAIN);
    }
}
