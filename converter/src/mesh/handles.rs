//! Tiny handles, cut along short loops of edges and capped.
//!
//! Every handle costs the segmentation three regions, however small it is; range scans are full of tunnels of a few
//! edges. Where a closed path of edges that does not separate the surface is short, the surface is cut along it and both
//! openings are closed by a fan around the loop's centre (`caps`): one handle less, and every imported triangle is still there.
//!
//! Method: a spanning tree and a spanning tree of the dual that avoids it leave two edges a handle
//! (Eppstein, "Dynamic generators of topologically embedded graphs", 2003; shortest loops as in Erickson & Whittlesey, "Greedy
//! optimal homotopy and homology generators", 2005). Those edges only say where to look: around them balls of bounded
//! radius are searched for their shortest loop through the middle that does not separate (`search`).
//!
//! Limits: loops are paths of edges, a few percent longer than they could be; a loop that touches an open border is left
//! alone; so is a handle whose opening is wider than the bound allows, for the cap would be that far from the source.

mod search;

use super::adjacency::{UnionFind, end, id, next, start};
use super::caps::{self, Caps};
use super::fans::breadth_first;
use super::{ManifoldMesh, NONE};

/// Cuts and caps every handle that a cap nowhere farther than `distance` (a length) from the surface can close.
pub fn cut(mesh: &mut ManifoldMesh, distance: f64) -> Caps {
    let mut done = Caps::default();
    // Loops of one round are disjoint, so handles side by side take more than one.
    for _ in 0..ROUNDS {
        let places = leftover_edges(mesh);
        if places.is_empty() {
            break;
        }
        let loops = search::loops(mesh, &places, distance);
        if loops.is_empty() {
            break;
        }
        caps::cut(mesh, &loops, &mut done);
    }
    done
}

/// Rounds of search after which handles that still overlap stay.
const ROUNDS: usize = 4;

/// Half-edges that no spanning tree of the vertices and no disjoint one of the faces holds: two a handle, near it.
///
/// A boundary loop counts as a face.
fn leftover_edges(mesh: &ManifoldMesh) -> Vec<u32> {
    let depth_and_parent = breadth_first(mesh);
    let half_edges = id(mesh.twins.len());
    let faces = mesh.triangles.len();
    let (loop_of, loops) = boundary(mesh);
    let mut dual = UnionFind::new(faces + loops as usize);
    let face = |h: u32| match mesh.twins[h as usize] {
        NONE => id(faces) + loop_of[h as usize],
        twin => twin / 3,
    };
    let (depth, parent) = &depth_and_parent;
    // Deepest first: what is left over then lies right behind a handle, as seen from the root.
    let mut buckets: Vec<u32> = Vec::new();
    let weight = |h: u32| {
        let (a, b) = (start(&mesh.triangles, h), end(&mesh.triangles, h));
        depth[a as usize] + depth[b as usize]
    };
    let candidates = || {
        (0..half_edges).filter(|&h| {
            let twin = mesh.twins[h as usize];
            let (a, b) = (start(&mesh.triangles, h), end(&mesh.triangles, h));
            twin > h && parent[a as usize] != b && parent[b as usize] != a
        })
    };
    for h in candidates() {
        let w = weight(h) as usize;
        if w >= buckets.len() {
            buckets.resize(w + 1, 0);
        }
        buckets[w] += 1;
    }
    let mut at = 0;
    for bucket in buckets.iter_mut().rev() {
        at += std::mem::replace(bucket, at);
    }
    let mut sorted = vec![0; at as usize];
    for h in candidates() {
        let slot = &mut buckets[weight(h) as usize];
        sorted[*slot as usize] = h;
        *slot += 1;
    }
    let mut left = Vec::new();
    for h in sorted {
        let (a, b) = (dual.find(h / 3), dual.find(face(h)));
        if a == b {
            left.push(h);
        } else {
            dual.union(a, b);
        }
    }
    left
}

/// Boundary loop of every half-edge, [`NONE`] inside, and the number of loops.
fn boundary(mesh: &ManifoldMesh) -> (Vec<u32>, u32) {
    let mut loop_of = vec![NONE; mesh.twins.len()];
    let mut count = 0;
    for first in 0..id(mesh.twins.len()) {
        if mesh.twins[first as usize] != NONE || loop_of[first as usize] != NONE {
            continue;
        }
        let mut h = first;
        while loop_of[h as usize] == NONE {
            loop_of[h as usize] = count;
            h = next(h);
            while mesh.twins[h as usize] != NONE {
                h = next(mesh.twins[h as usize]);
            }
        }
        count += 1;
    }
    (loop_of, count)
}

#[cfg(test)]
mod tests;
