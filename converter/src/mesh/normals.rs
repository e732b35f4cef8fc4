//! Vertex normals.
//!
//! Each face counts by its area and its angle at the vertex: large flat faces stay flat, narrow ones, whose own normals are noise, count for
//! little, and it does not matter along which diagonal a flat quad is cut. By sin(angle) / (edge · edge), which is exact on a sphere
//! (Max, "Weights for Computing Vertex Normals from Facet Normals", 1999), the few small faces beside a large one bend the light on
//! all of it; by angles alone narrow faces count for much.
//!
//! Copies of one vertex whose normals point nearly the same or nearly opposite ways lie on one sheet that was cut for
//! topology's sake; they share one normal, up to sign, so that the cut does not show.

use super::ManifoldMesh;
use super::adjacency::{UnionFind, id};
use glam::DVec3;
use marquetry_evaluation::distance::Mesh;
use std::collections::HashMap;

/// Copies lie on one sheet if the cosine between their normals is at least this (45°).
const SAME_SHEET: f64 = 0.707;

/// Cosine, either way, between the normal of a vertex and one that was found for its place, at least.
const SAME_PLACE: f64 = 0.7;

/// Normals of the vertices of a surface, of any length.
pub fn vertex_normals(surface: Mesh<'_>) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; surface.positions.len()];
    for t in surface.triangles {
        let [a, b, c] = t.map(|v| surface.positions[v as usize]);
        let edges = [b - a, c - b, a - c];
        let normal = edges[0].cross(-edges[2]);
        let twice_area = normal.length();
        for k in 0..3 {
            let angle = twice_area.atan2(edges[k].dot(-edges[(k + 2) % 3]));
            sums[t[k] as usize] += angle * normal;
        }
    }
    sums
}

/// Unit normals; +z where all faces at a vertex have no area.
pub(super) fn shared_normals(mesh: &ManifoldMesh) -> Vec<DVec3> {
    let mut sums = vertex_normals(Mesh {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    });
    share_among_copies(&mesh.origin, &mut sums);
    for n in &mut sums {
        *n = unit(*n).unwrap_or(DVec3::Z);
    }
    sums
}

/// Gives vertices the unit normals that were found for their `places`, up to sign, where they are about like those they have.
pub fn take_over(mesh: &mut ManifoldMesh, places: &[DVec3], normals: &[DVec3]) {
    let key = |place: &DVec3| place.to_array().map(f64::to_bits);
    let found: HashMap<[u64; 3], DVec3> = (places.iter().map(key))
        .zip(normals.iter().copied())
        .collect();
    for (place, own) in mesh.positions.iter().zip(&mut mesh.normals) {
        let Some(&found) = found.get(&key(place)) else {
            continue;
        };
        let cosine = found.dot(*own);
        if cosine.abs() >= SAME_PLACE {
            *own = found * cosine.signum();
        }
    }
}

/// `v` at length 1, also where the square of its length would overflow or vanish.
fn unit(v: DVec3) -> Option<DVec3> {
    let scaled = v / v.abs().max_element();
    let unit = scaled / scaled.length();
    unit.is_finite().then_some(unit)
}

fn share_among_copies(origin: &[u32], sums: &mut [DVec3]) {
    let mut vertices: Vec<u32> = (0..id(origin.len())).collect();
    vertices.sort_by_key(|&v| origin[v as usize]);
    for copies in vertices.chunk_by(|&a, &b| origin[a as usize] == origin[b as usize]) {
        if copies.len() == 1 {
            continue;
        }
        let own: Vec<DVec3> = copies
            .iter()
            .map(|&v| unit(sums[v as usize]).unwrap_or(DVec3::ZERO))
            .collect();
        let mut sheets = UnionFind::new(copies.len());
        for i in 0..copies.len() {
            for j in 0..i {
                if own[i].dot(own[j]).abs() >= SAME_SHEET {
                    sheets.union(id(i), id(j));
                }
            }
        }
        let mut shared = vec![DVec3::ZERO; copies.len()];
        let roots: Vec<usize> = (0..copies.len())
            .map(|i| sheets.find(id(i)) as usize)
            .collect();
        let sense = |i: usize, root: usize| {
            if own[i].dot(own[root]) < 0.0 {
                -1.0
            } else {
                1.0
            }
        };
        for (i, &root) in roots.iter().enumerate() {
            shared[root] += sums[copies[i] as usize] * sense(i, root);
        }
        for (i, &root) in roots.iter().enumerate() {
            sums[copies[i] as usize] = shared[root] * sense(i, root);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_found_for_places_are_taken_with_the_sense_that_vertices_have() {
        let places = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let found = [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::Z];
        let mut mesh = ManifoldMesh {
            // The last is at no place that is known.
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE],
            normals: vec![DVec3::new(0.0, 0.6, 0.8); 4],
            ..ManifoldMesh::default()
        };
        let own = mesh.normals[0];
        take_over(&mut mesh, &places, &found);
        assert_eq!(mesh.normals, [DVec3::Z, DVec3::Z, own, own]);
    }
}
