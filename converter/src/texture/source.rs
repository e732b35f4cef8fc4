//! Where on the source's images the triangles of a chart or a cluster lie.
//!
//! A triangle of a patch is a piece of a source triangle, so one look-up by its centre serves all its texels: the source triangle
//! nearest to it, and the corners' texture coordinates by its plane. Nothing has to be carried through welding, cutting
//! and layout for that. Scans have sheets that lie on each other: of triangles about as near to the centre the one is taken that
//! has the corners on it, at its own corners if there are several, and of triangles that coincide the last, which a viewer draws over the others.
//!
//! Limit: a patch triangle that closes a hole gets the colour of the nearest triangle beside it.

use super::appearance::{Appearance, NO_MATERIAL, TexturedFace};
use crate::atlas::patch::Patch;
use glam::{DVec2, DVec3, Vec2};
use marquetry_evaluation::distance::{Bvh, MeshError, closest_point};

/// Part of the size of a triangle that numbers may be off by.
const TINY: f64 = 1e-6;

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

    fn corners(&self, number: u32) -> [DVec3; 3] {
        self.triangles[number as usize].map(|v| self.positions[v as usize])
    }

    /// The number of the triangle that one with these corners, which may be `rounded` by so much, is a piece of.
    pub fn piece_of(&self, corners: [DVec3; 3], rounded: f64) -> Option<u32> {
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let nearest = self.bvh.closest(centre, f64::INFINITY)?;
        let size: f64 = corners.map(|p| p.distance(centre)).iter().sum();
        let (distance, close) = (nearest.distance2.sqrt(), 2.0 * rounded + TINY * size);
        if distance > close {
            // No piece: it closes a hole, and there may be any number about as far away.
            return self.numbers.get(nearest.triangle as usize).copied();
        }
        let slack = 2.0 * distance + close;
        let mut near: Vec<(u32, Likeness)> = self
            .bvh
            .within(centre, slack * slack)
            .iter()
            .filter_map(|found| self.numbers.get(found.triangle as usize))
            .map(|&number| (number, Likeness::new(corners, self.corners(number))))
            .collect();
        let least = |of: fn(&Likeness) -> f64, near: &[(u32, Likeness)]| {
            near.iter()
                .map(|(_, l)| of(l))
                .fold(f64::INFINITY, f64::min)
        };
        let off = least(|l| l.off, &near);
        near.retain(|(_, l)| l.off <= off + slack);
        if near.iter().any(|(_, l)| l.is_front) {
            near.retain(|(_, l)| l.is_front);
        }
        let apart = least(|l| l.apart, &near);
        near.retain(|(_, l)| l.apart <= apart + slack);
        near.iter().map(|&(number, _)| number).max()
    }

    /// What covers every triangle of `patch`.
    pub fn faces_of(&self, patch: &Patch, appearance: &Appearance) -> Vec<TexturedFace> {
        let corners = |t: &[u32; 3]| t.map(|v| patch.positions[v as usize]);
        patch
            .triangles
            .iter()
            .map(|t| {
                let corners = corners(t);
                self.texture(self.piece_of(corners, 0.0), corners, appearance)
            })
            .collect()
    }

    /// What the source triangle of a `number` has on a piece of it.
    pub fn texture(
        &self,
        number: Option<u32>,
        corners: [DVec3; 3],
        appearance: &Appearance,
    ) -> TexturedFace {
        let face = || {
            let number = number?;
            let source = appearance.faces.get(number as usize)?;
            if source.material == NO_MATERIAL {
                return None;
            }
            let own = self.corners(number);
            Some(TexturedFace {
                material: source.material,
                uv: corners.map(|p| carried(own, source.uv, p)),
            })
        };
        face().unwrap_or(TexturedFace::PLAIN)
    }
}

/// How far a piece is from a source triangle; the least is its own.
#[derive(Debug, Clone, Copy)]
struct Likeness {
    /// Largest distance of a corner from the triangle.
    off: f64,
    /// Whether both look into one direction.
    is_front: bool,
    /// Sum of the distances of corners from the triangle's nearest ones.
    apart: f64,
}

impl Likeness {
    fn new(piece: [DVec3; 3], source: [DVec3; 3]) -> Self {
        let nearest = |p: DVec3| {
            let distances = source.map(|q| q.distance(p));
            distances.into_iter().fold(f64::INFINITY, f64::min)
        };
        let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        Self {
            off: piece
                .map(|p| closest_point(source, p).distance(p))
                .into_iter()
                .fold(0.0, f64::max),
            is_front: normal(piece).dot(normal(source)) >= 0.0,
            apart: piece.map(nearest).iter().sum(),
        }
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

    #[test]
    fn of_triangles_that_lie_on_each_other_a_piece_is_of_its_own() {
        let small = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let large = small.map(|p| 6.0 * p - DVec3::new(2.0, 2.0, 0.0));
        let [a, b, c] = small;
        let corners = [large, small, [a, c, b], large, small];
        let triangles = (0..5).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let source = SourceMesh::new(corners.as_flattened().to_vec(), triangles).unwrap();
        // The last of those that coincide; the back only where there is no front.
        for (rounded, off) in [(0.0, 0.0), (1e-3, 8e-4)] {
            let moved = |t: [DVec3; 3]| t.map(|p| p + DVec3::new(off, -off, off));
            assert_eq!(source.piece_of(moved(small), rounded), Some(4));
            assert_eq!(source.piece_of(moved([a, c, b]), rounded), Some(2));
            assert_eq!(source.piece_of(moved(large), rounded), Some(3));
            // No other has all of it.
            let piece = [DVec3::ZERO, 3.0 * DVec3::X, DVec3::Y];
            assert_eq!(source.piece_of(moved(piece), rounded), Some(3));
        }
    }
}
