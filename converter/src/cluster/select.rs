//! Which components are too small for charts.
//!
//! A component hangs together by welded vertices, cuts made for topology's sake included: no crack can open within one.
//! It is small if a leaf has room for it as it is.

use crate::mesh::adjacency::{UnionFind, id, label};
use crate::mesh::{ManifoldMesh, NONE};
use glam::DVec3;
use marquetry_format::cluster::{MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};

/// Most triangles of a small component: about where a dozen charts take as many bytes (`ARCHITECTURE.md`).
pub const MOST_TRIANGLES: usize = MAX_CLUSTER_TRIANGLES;

/// A mesh without its small components, and these.
#[derive(Debug, Default)]
pub struct Selection {
    /// The surface that is to have charts; may be without triangles.
    pub rest: ManifoldMesh,
    /// All small components; may be without triangles.
    pub small: ManifoldMesh,
    /// Triangles of `small`, component by component, in order of first occurrence.
    pub components: Vec<Vec<u32>>,
}

/// Takes the small components out of `mesh`. Every triangle is in one part or the other.
pub fn select(mesh: ManifoldMesh) -> Selection {
    let origins = mesh.origin.iter().map(|&o| o as usize + 1).max();
    let origins = origins.unwrap_or(0);
    let mut sets = UnionFind::new(origins);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.origin[v as usize]);
        sets.union(a, b);
        sets.union(a, c);
    }
    let first = |t: &[u32; 3]| mesh.origin[t[0] as usize];
    let (components, count) = label(&mut sets, mesh.triangles.iter().map(first));
    let mut triangles = vec![0usize; count as usize];
    let mut vertices = vec![0usize; count as usize];
    let mut is_counted = vec![false; mesh.positions.len()];
    for (t, &component) in mesh.triangles.iter().zip(&components) {
        triangles[component as usize] += 1;
        for &v in t {
            let is_new = !std::mem::replace(&mut is_counted[v as usize], true);
            vertices[component as usize] += usize::from(is_new);
        }
    }
    let is_small: Vec<bool> = triangles
        .iter()
        .zip(&vertices)
        .map(|(&t, &v)| t <= MOST_TRIANGLES && v <= MAX_CLUSTER_VERTICES)
        .collect();
    if !is_small.contains(&true) {
        return Selection {
            rest: mesh,
            ..Selection::default()
        };
    }
    let mut lists: Vec<Vec<u32>> = Vec::new();
    let mut next = 0u32;
    let mut place = vec![NONE; count as usize];
    for &component in &components {
        if !is_small[component as usize] {
            continue;
        }
        let slot = &mut place[component as usize];
        if *slot == NONE {
            *slot = id(lists.len());
            lists.push(Vec::new());
        }
        lists[*slot as usize].push(next);
        next += 1;
    }
    let goes = |t: usize| is_small[components[t] as usize];
    Selection {
        rest: part(&mesh, |t| !goes(t)),
        small: part(&mesh, goes),
        components: lists,
    }
}

/// Positions and triangles of both parts.
pub fn joined(rest: ManifoldMesh, small: &ManifoldMesh) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let ManifoldMesh {
        mut positions,
        mut triangles,
        ..
    } = rest;
    let first = id(positions.len());
    positions.extend(&small.positions);
    triangles.extend(small.triangles.iter().map(|t| t.map(|v| v + first)));
    (positions, triangles)
}

/// The triangles of `mesh` that are `kept`, which are whole components, and their vertices.
fn part(mesh: &ManifoldMesh, kept: impl Fn(usize) -> bool) -> ManifoldMesh {
    let mut rest = ManifoldMesh::default();
    let mut vertex = vec![NONE; mesh.positions.len()];
    let mut triangle = vec![NONE; mesh.triangles.len()];
    // Origins are numbered anew, so that they stay below the number of vertices.
    let mut origin = vec![
        NONE;
        mesh.origin
            .iter()
            .map(|&o| o as usize + 1)
            .max()
            .unwrap_or(0)
    ];
    let mut origins = 0;
    for (t, corners) in mesh.triangles.iter().enumerate().filter(|&(t, _)| kept(t)) {
        triangle[t] = id(rest.triangles.len());
        rest.triangles.push(corners.map(|v| {
            let slot = &mut vertex[v as usize];
            if *slot == NONE {
                *slot = id(rest.positions.len());
                rest.positions.push(mesh.positions[v as usize]);
                let number = &mut origin[mesh.origin[v as usize] as usize];
                if *number == NONE {
                    *number = origins;
                    origins += 1;
                }
                rest.origin.push(*number);
                rest.normals.push(mesh.normals[v as usize]);
                rest.colours.extend(mesh.colours.get(v as usize));
            }
            *slot
        }));
    }
    for (twins, _) in mesh
        .twins
        .chunks_exact(3)
        .zip(&triangle)
        .filter(|&(_, &t)| t != NONE)
    {
        rest.twins.extend(twins.iter().map(|&twin| match twin {
            NONE => NONE,
            twin => 3 * triangle[twin as usize / 3] + twin % 3,
        }));
    }
    rest
}
