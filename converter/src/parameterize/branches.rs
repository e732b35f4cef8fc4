//! How much a harmonic map will shrink what sticks out of a disk, estimated before there is one.
//!
//! Along a tube a harmonic map shrinks by exp(−2π) for every length that equals the girth, so a branch a few girths long
//! drowns in rounding, and reweighting has nothing left to measure. Counting sees it: breadth-first layers from the border are
//! rings, and the parts of the disk beyond a layer form a tree. From ring to ring the surface's girth changes by the rings'
//! number of vertices, the map's by exp(−2π / vertices).
//!
//! Limits: edges count as equally long, as they do for Tutte's weights; a tip of one or two vertices is no ring. Good to an order of magnitude, which is
//! all that a start for reweighting needs.

use super::edges::{Edges, NONE};
use crate::mesh::adjacency::UnionFind;
use std::f64::consts::PI;

/// Shrinking (a length) that is left to reweighting; the estimate is no better than that.
const ENOUGH: f64 = 5.0;

/// Weights are divided by this power of the shrinking at both their ends; along a tube the exponent of the shrinking falls to
/// (√(p² + 1) − p) of what it was, here 0.16.
const POWER: f64 = 3.0;

/// Estimates stop here: powers of it are still numbers.
const MOST: f64 = 1e30;

/// Weights that keep something of long branches: Tutte's, which go by the number of edges as the estimate does, lowered
/// along branches.
pub(super) fn weights(edges: &Edges, on_side: &[bool]) -> Vec<f64> {
    let shrunk = shrinking(edges, on_side);
    let factor = |v: u32| (shrunk[v as usize] / ENOUGH).max(1.0).powf(-POWER);
    edges
        .ends
        .iter()
        .map(|&[a, b]| factor(a) * factor(b))
        .collect()
}

/// Estimate for every vertex of how much longer its surroundings are than their image, 1 on the border.
fn shrinking(edges: &Edges, on_side: &[bool]) -> Vec<f64> {
    let count = on_side.len();
    let (starts, neighbours) = adjacency(edges, count);
    let around = |v: u32| &neighbours[starts[v as usize] as usize..starts[v as usize + 1] as usize];
    // Breadth-first layers.
    let mut layer = vec![NONE; count];
    let mut order: Vec<u32> = (0u32..)
        .zip(on_side)
        .filter(|&(_, &on_side)| on_side)
        .map(|(v, _)| v)
        .collect();
    for &v in &order {
        layer[v as usize] = 0;
    }
    let mut at = 0;
    while let Some(&v) = order.get(at) {
        at += 1;
        for &w in around(v) {
            if layer[w as usize] == NONE {
                layer[w as usize] = layer[v as usize] + 1;
                order.push(w);
            }
        }
    }
    // Innermost first: each ring is what a layer adds to one part of the inside; it encloses the rings found in that part so far.
    let mut sets = UnionFind::new(count);
    let mut outermost = vec![NONE; count];
    let mut ring_of = vec![NONE; count];
    let mut rings: Vec<Ring> = Vec::new();
    for members in order
        .chunk_by(|&v, &w| layer[v as usize] == layer[w as usize])
        .rev()
    {
        let mut enclosed = Vec::new();
        for &v in members {
            for &w in around(v) {
                if layer[w as usize] != NONE && layer[w as usize] > layer[v as usize] {
                    enclosed.push(outermost[sets.find(w) as usize]);
                }
            }
        }
        for &v in members {
            for &w in around(v) {
                if layer[w as usize] != NONE && layer[w as usize] >= layer[v as usize] {
                    sets.union(v, w);
                }
            }
        }
        let first = rings.len();
        for &v in members {
            let root = sets.find(v) as usize;
            if outermost[root] == NONE || (outermost[root] as usize) < first {
                outermost[root] = u32::try_from(rings.len()).unwrap_or(NONE);
                rings.push(Ring::default());
            }
            ring_of[v as usize] = outermost[root];
            rings[outermost[root] as usize].vertices += 1;
        }
        enclosed.sort_unstable();
        enclosed.dedup();
        for inner in enclosed {
            let member = rings[inner as usize].member;
            let outer = outermost[sets.find(member) as usize];
            rings[inner as usize].outer = outer;
            rings[outer as usize].enclosed += rings[inner as usize].vertices;
        }
        for &v in members {
            rings[ring_of[v as usize] as usize].member = v;
        }
    }
    // Rings come innermost first, so what encloses a ring has a higher number.
    for i in (0..rings.len()).rev() {
        let ring = rings[i];
        let Some(outer) = rings.get(ring.outer as usize).copied() else {
            continue;
        };
        rings[i].shrunk = outer.shrunk;
        // A loop of four edges may give each of two layers two vertices.
        if ring.vertices >= 3 || ring.enclosed > 0 {
            let (own, other) = (
                f64::from(ring.vertices.max(3)),
                f64::from(outer.vertices.max(3)),
            );
            let girth = f64::from(outer.enclosed.max(3)) / other;
            let factor = girth * (PI * (own.recip() + other.recip())).exp();
            rings[i].shrunk = (rings[i].shrunk * factor).min(MOST);
        }
    }
    ring_of
        .into_iter()
        .map(|ring| rings.get(ring as usize).map_or(1.0, |ring| ring.shrunk))
        .collect()
}

#[derive(Debug, Clone, Copy)]
struct Ring {
    vertices: u32,
    /// Vertices of all rings right inside.
    enclosed: u32,
    /// The ring around it.
    outer: u32,
    /// One of its vertices.
    member: u32,
    shrunk: f64,
}

impl Default for Ring {
    fn default() -> Self {
        Self {
            vertices: 0,
            enclosed: 0,
            outer: NONE,
            member: NONE,
            shrunk: 1.0,
        }
    }
}

fn adjacency(edges: &Edges, count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 1];
    for &v in edges.ends.as_flattened() {
        starts[v as usize + 1] += 1;
    }
    for k in 0..count {
        starts[k + 1] += starts[k];
    }
    let mut next = starts.clone();
    let mut neighbours = vec![0u32; 2 * edges.ends.len()];
    for &[a, b] in &edges.ends {
        for (from, to) in [(a, b), (b, a)] {
            neighbours[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        }
    }
    (starts, neighbours)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rings of vertices inside each other, the first on the border, joined like a triangulated tube, closed by a pole.
    fn rings(sizes: &[u32]) -> (Edges, Vec<bool>) {
        let mut triangles = Vec::new();
        let mut first = 0;
        for pair in sizes.windows(2) {
            let (m, n) = (pair[0], pair[1]);
            let inner = first + m;
            let (mut i, mut j) = (0, 0);
            while i < m || j < n {
                let (a, b) = (first + i % m, inner + j % n);
                if j == n || (i < m && u64::from(i) * u64::from(n) <= u64::from(j) * u64::from(m)) {
                    triangles.push([a, first + (i + 1) % m, b]);
                    i += 1;
                } else {
                    triangles.push([a, inner + (j + 1) % n, b]);
                    j += 1;
                }
            }
            first = inner;
        }
        let last = sizes[sizes.len() - 1];
        let pole = first + last;
        triangles.extend((0..last).map(|i| [first + i, first + (i + 1) % last, pole]));
        let on_side = (0..=pole).map(|v| v < sizes[0]).collect();
        (Edges::of(&triangles), on_side)
    }

    #[test]
    fn a_flat_disk_shrinks_nowhere() {
        let sizes: Vec<u32> = (1..=20).rev().map(|r| 6 * r).collect();
        let (edges, on_side) = rings(&sizes);
        let most = shrinking(&edges, &on_side).into_iter().fold(0.0, f64::max);
        assert!(most < 2.0, "{most}");
    }

    #[test]
    fn a_tube_shrinks_exponentially() {
        let (edges, on_side) = rings(&[12; 25]);
        let most = shrinking(&edges, &on_side).into_iter().fold(0.0, f64::max);
        let expected = (2.0 * PI * 24.0 / 12.0).exp();
        assert!((most / expected).ln().abs() < 0.1, "{most} {expected}");
    }

    #[test]
    fn a_balloon_behind_a_neck_is_seen() {
        let (edges, on_side) = rings(&[40, 30, 18, 4, 4, 4, 12, 24, 24, 12, 4]);
        let most = shrinking(&edges, &on_side).into_iter().fold(0.0, f64::max);
        assert!(most > 100.0, "{most}");
    }
}
