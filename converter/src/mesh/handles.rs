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
use rayon::prelude::*;

/// Cuts and caps every handle that a cap nowhere farther than `distance` (a length) from the surface can close.
pub fn cut(mesh: &mut ManifoldMesh, distance: f64) -> Caps {
    let mut done = Caps::default();
    // Where loops of one search meet, the others are looked for again right there, and at last everywhere.
    for _ in 0..SEARCHES {
        let mut places = leftover_edges(mesh);
        let before = done.loops;
        while !places.is_empty() {
            let (loops, left) = search::loops(mesh, &places, distance);
            caps::cut(mesh, &loops, &mut done);
            places = if loops.is_empty() { Vec::new() } else { left };
        }
        if done.loops == before {
            break;
        }
    }
    done
}

/// Searches of the whole surface after which handles that still overlap stay.
const SEARCHES: usize = 2;

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
    let weights: Vec<u32> = (0..half_edges)
        .into_par_iter()
        .map(|h| {
            let twin = mesh.twins[h as usize];
            let (a, b) = (start(&mesh.triangles, h), end(&mesh.triangles, h));
            let in_tree = parent[a as usize] == b || parent[b as usize] == a;
            if twin < h || in_tree {
                NONE
            } else {
                depth[a as usize] + depth[b as usize]
            }
        })
        .collect();
    let candidates = || weights.iter().enumerate().filter(|&(_, &w)| w != NONE);
    let mut buckets: Vec<u32> = Vec::new();
    for (_, &weight) in candidates() {
        let weight = weight as usize;
        if weight >= buckets.len() {
            buckets.resize(weight + 1, 0);
        }
        buckets[weight] += 1;
    }
    let mut at = 0;
    for bucket in buckets.iter_mut().rev() {
        at += std::mem::replace(bucket, at);
    }
    let mut sorted = vec![0; at as usize];
    for (h, &weight) in candidates() {
        let slot = &mut buckets[weight as usize];
        sorted[*slot as usize] = id(h);
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
