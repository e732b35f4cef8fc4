//! Splits interior edges that join two vertices of one side.
//!
//! Such a chord would lie *on* the side of the square, and everything it cuts off would have no area there. Its midpoint
//! becomes a vertex, which is free to move inwards. All chords are split at once, each triangle by the template of its
//! one, two or three midpoints, so that no edge made here is a chord again.

use super::edges::{Edges, NONE};
use crate::atlas::patch::{Attributes, Patch};

/// Splits the chords of `patch`; true if there were any.
pub(super) fn split(patch: &mut Patch, edges: &Edges) -> bool {
    let sides = side_masks(patch);
    let mut midpoint = Vec::new();
    for (edge, &[a, b]) in edges.ends.iter().enumerate() {
        if edges.uses[edge] == 2 && sides[a as usize] & sides[b as usize] != 0 {
            midpoint.resize(edges.ends.len(), NONE);
            midpoint[edge] = add_midpoint(patch, a as usize, b as usize);
        }
    }
    if midpoint.is_empty() {
        return false;
    }
    let mut triangles = Vec::with_capacity(patch.triangles.len() + patch.triangles.len() / 4);
    for (&corners, ids) in patch.triangles.iter().zip(&edges.of_triangle) {
        push_split(
            corners,
            ids.map(|edge| midpoint[edge as usize]),
            &mut triangles,
        );
    }
    patch.triangles = triangles;
    true
}

/// Bit `s` of a vertex: it lies on side `s`, corners included.
fn side_masks(patch: &Patch) -> Vec<u8> {
    let mut masks = vec![0u8; patch.positions.len()];
    for (side, vertices) in patch.sides.iter().enumerate() {
        for &vertex in vertices {
            masks[vertex as usize] |= 1 << side;
        }
    }
    masks
}

fn add_midpoint(patch: &mut Patch, a: usize, b: usize) -> u32 {
    let (from, to) = (patch.attributes[a], patch.attributes[b]);
    let vertex = u32::try_from(patch.positions.len()).unwrap_or(NONE);
    patch
        .positions
        .push((patch.positions[a] + patch.positions[b]) * 0.5);
    patch.attributes.push(Attributes {
        normal: (from.normal + to.normal).normalize_or_zero(),
        colour: (from.colour + to.colour) * 0.5,
        cap: (from.cap + to.cap) * 0.5,
    });
    vertex
}

/// `midpoints[k]` lies between corners `k` and `k + 1`.
fn push_split(corners: [u32; 3], midpoints: [u32; 3], triangles: &mut Vec<[u32; 3]>) {
    let [a, b, c] = corners;
    match midpoints {
        [NONE, NONE, NONE] => triangles.push(corners),
        [m, NONE, NONE] => triangles.extend([[a, m, c], [m, b, c]]),
        [NONE, m, NONE] => triangles.extend([[b, m, a], [m, c, a]]),
        [NONE, NONE, m] => triangles.extend([[c, m, b], [m, a, b]]),
        [m, n, NONE] => triangles.extend([[m, b, n], [a, m, n], [a, n, c]]),
        [NONE, m, n] => triangles.extend([[m, c, n], [b, m, n], [b, n, a]]),
        [n, NONE, m] => triangles.extend([[m, a, n], [c, m, n], [c, n, b]]),
        [m, n, o] => triangles.extend([[m, b, n], [n, c, o], [o, a, m], [m, n, o]]),
    }
}
