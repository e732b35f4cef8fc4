//! Which vertices have several normals.
//!
//! A crease is a vertex whose faces turn more than `SHARP` away from its normal, into up to three directions that each are clear. Where
//! directions are not clear the surface is rough, and only faces of a direction that has most of the area keep it, so that a wall is
//! not lit like the rubble at its foot.
//!
//! Only what is *angular* has creases: along most of its sharp edges the surface goes on beyond the faces at the edge as these begin, as it does in
//! CAD models. Sharp edges of a scan are noise, or what is left of something rounder; normals on both sides would take a second
//! vertex each, for light that the source does not show.

use crate::mesh::ManifoldMesh;
use crate::mesh::adjacency::{EdgeTable, end, start};
use glam::DVec3;
use rayon::prelude::*;

/// Cosine of the angle (40°) up to which faces share a normal.
const SHARP: f64 = 0.766;
/// Cosine of the angle (20°) up to which faces have one direction.
const CLEAR: f64 = 0.94;
/// Part of the area around a vertex that faces of one direction have which keep it whatever the others do.
const DOMINANT: f64 = 0.9;
/// Directions of faces at a vertex on a crease, at most: those of a corner.
const DIRECTIONS: usize = 3;
/// Cosine of the angle (5°) up to which a surface goes on as it is.
const STRAIGHT: f64 = 0.9962;
/// Part of the length of sharp edges that surfaces go on from in what is angular: 0.44 and more of CAD models, at most 0.22 of scans.
const ANGULAR: f64 = 1.0 / 3.0;
/// Triangles that are angular whatever they look like: too few to tell.
const FEW: usize = 64;

/// Vertices of a component whose faces turn far from their normals.
#[derive(Debug, Default)]
pub(super) struct Creases(Vec<Crease>);

#[derive(Debug)]
struct Crease {
    vertex: u32,
    /// Whether its faces turn into a few clear directions.
    is_clear: bool,
}

impl Creases {
    /// Those of a component of something angular. `around` are, vertex by vertex in ascending order, pairs of it and a face at it.
    pub(super) fn of<'a>(
        mesh: &ManifoldMesh,
        around: impl Iterator<Item = &'a [[u32; 2]]>,
    ) -> Self {
        Self(around.filter_map(|faces| crease(mesh, faces)).collect())
    }

    /// The normal of a vertex as a face sees it; `around` are all faces at the vertex.
    pub(super) fn normal(
        &self,
        mesh: &ManifoldMesh,
        [vertex, face]: [u32; 2],
        around: impl Iterator<Item = u32>,
    ) -> DVec3 {
        let normal = mesh.normals[vertex as usize];
        let Ok(number) = self.0.binary_search_by_key(&vertex, |crease| crease.vertex) else {
            return normal;
        };
        let own = face_vector(mesh, face).normalize_or_zero();
        let (mut alike, mut area, mut whole) = (DVec3::ZERO, 0.0, 0.0);
        for face in around.map(|face| face_vector(mesh, face)) {
            let (unit, length) = (face.normalize_or_zero(), face.length());
            whole += length;
            if unit.dot(own) >= SHARP {
                area += length;
                alike += unit;
            }
        }
        if self.0[number].is_clear || area > DOMINANT * whole {
            alike.normalize_or(normal)
        } else {
            normal
        }
    }
}

/// Normal of a face, twice its area long.
fn face_vector(mesh: &ManifoldMesh, t: u32) -> DVec3 {
    let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
    (b - a).cross(c - a)
}

/// The vertex that `faces`, pairs of it and a face, are around, if they turn far from its normal.
fn crease(mesh: &ManifoldMesh, faces: &[[u32; 2]]) -> Option<Crease> {
    let &[vertex, _] = faces.first()?;
    let normals = faces
        .iter()
        .map(|&[_, f]| face_vector(mesh, f).normalize_or_zero());
    let normals: Vec<DVec3> = normals.filter(|&n| n != DVec3::ZERO).collect();
    let of_all = mesh.normals[vertex as usize];
    if normals.iter().all(|n| n.dot(of_all) >= SHARP) {
        return None;
    }
    let is_clear = |own: &DVec3| {
        let alike = normals.iter().filter(|n| n.dot(*own) >= SHARP);
        alike.sum::<DVec3>().normalize_or_zero().dot(*own) >= CLEAR
    };
    let mut directions: Vec<DVec3> = Vec::new();
    for &n in &normals {
        if directions.iter().all(|other| other.dot(n) < SHARP) {
            directions.push(n);
        }
    }
    Some(Crease {
        vertex,
        is_clear: directions.len() <= DIRECTIONS && normals.iter().all(is_clear),
    })
}

/// Whether the surface goes on from most of the sharp edges of some triangles as it begins there.
pub(super) fn is_angular(mesh: &ManifoldMesh, triangles: &[u32]) -> bool {
    if triangles.len() <= FEW {
        return true;
    }
    let corners: Vec<[u32; 3]> = (triangles.iter())
        .map(|&t| mesh.triangles[t as usize])
        .collect();
    let unit = |t: &u32| face_vector(mesh, *t).normalize_or_zero();
    let normals: Vec<DVec3> = triangles.par_iter().map(unit).collect();
    let edges = EdgeTable::new(&corners, mesh.positions.len());
    let inner = || {
        edges.edges().filter_map(|edge| match *edge {
            [h, twin] => {
                let ends = [start(&corners, h), end(&corners, h)];
                let faces = [h, twin].map(|h| h as usize / 3);
                Some((ends, faces, normals[faces[0]].dot(normals[faces[1]])))
            }
            _ => None,
        })
    };
    let mut goes_on = vec![false; triangles.len()];
    for (_, faces, _) in inner().filter(|&(.., cosine)| cosine >= STRAIGHT) {
        for face in faces {
            goes_on[face] = true;
        }
    }
    let (mut straight, mut all) = (0.0, 0.0);
    for (ends, faces, _) in inner().filter(|&(.., cosine)| cosine < SHARP) {
        let [a, b] = ends.map(|v| mesh.positions[v as usize]);
        let length = a.distance(b);
        all += length;
        if faces.iter().all(|&face| goes_on[face]) {
            straight += length;
        }
    }
    straight >= ANGULAR * all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::adjacency::id;

    /// A grid of `cells`² cells, two triangles each, over the unit square.
    fn sheet(cells: u32, height: impl Fn(f64, f64) -> f64) -> ManifoldMesh {
        let mut mesh = ManifoldMesh::default();
        for k in 0..(cells + 1).pow(2) {
            let [x, y] =
                [k % (cells + 1), k / (cells + 1)].map(|c| f64::from(c) / f64::from(cells));
            mesh.positions.push(DVec3::new(x, y, height(x, y)));
        }
        for k in 0..cells.pow(2) {
            let a = k / cells * (cells + 1) + k % cells;
            let [b, c, d] = [a + 1, a + cells + 2, a + cells + 1];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh
    }

    fn all(mesh: &ManifoldMesh) -> Vec<u32> {
        (0..id(mesh.triangles.len())).collect()
    }

    #[test]
    fn roofs_are_angular_and_rough_sheets_are_not() {
        let roof = sheet(10, |x, _| 1.0 - (x - 0.5).abs() * 2.0);
        assert!(is_angular(&roof, &all(&roof)));
        // Heights that have nothing to do with each other.
        let rough = sheet(10, |x, y| (1e4 * (x + 7.0 * y).sin()).fract() * 0.3);
        assert!(!is_angular(&rough, &all(&rough)));
        assert!(is_angular(&rough, &all(&rough)[..FEW]));
    }

    #[test]
    fn faces_at_a_ridge_keep_their_directions() {
        let mut roof = sheet(10, |x, _| 1.0 - (x - 0.5).abs() * 2.0);
        roof.normals = vec![DVec3::Z; roof.positions.len()];
        let mut faces: Vec<[u32; 2]> = (all(&roof).into_iter())
            .flat_map(|t| roof.triangles[t as usize].map(|v| [v, t]))
            .collect();
        faces.sort_unstable();
        let creases = Creases::of(&roof, faces.chunk_by(|a, b| a[0] == b[0]));
        // In the middle of the ridge.
        let v = 5 * 11 + 5;
        let around: Vec<u32> = (faces.iter())
            .filter(|face| face[0] == v)
            .map(|face| face[1])
            .collect();
        for &t in &around {
            let normal = creases.normal(&roof, [v, t], around.iter().copied());
            let own = face_vector(&roof, t).normalize_or_zero();
            assert!(normal.dot(own) > 0.9999, "{normal} {own}");
        }
    }
}
