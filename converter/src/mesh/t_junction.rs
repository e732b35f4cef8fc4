//! Puts vertices into the border edges that they lie on.
//!
//! Where an edge of one wall faces several of the next (a T-junction), welding vertices leaves both open. Here a border edge
//! takes the border vertices on it as corners, if a piece of it is then an edge of another triangle too; the triangle is cut into a fan.
//! No point moves.
//!
//! Limits: a vertex lies on an edge within [`TOLERANCE`] of the diagonal, and within a thousandth of the edge; only borders
//! are looked at, so a vertex on the inside of an edge that two triangles share already stays where it is.

use super::WeldedMesh;
use super::account::Account;
use super::adjacency::{EdgeTable, apex, end, id, start};
use glam::DVec3;
use rayon::prelude::*;

/// How far a vertex may be from an edge that it lies on, over the diagonal of the bounds: what coordinates of six or seven
/// digits leave of a straight line.
const TOLERANCE: f64 = 1e-6;
/// The same over the length of the edge, for details that are themselves not much larger.
const TOLERANCE_OF_EDGE: f64 = 1e-3;

/// A border edge and the vertices on it, from its start to its end.
struct Split {
    half_edge: u32,
    inner: Vec<u32>,
}

/// Splits border edges at the vertices on them; whether there were any (then `table` no longer fits).
pub(super) fn insert(mesh: &mut WeldedMesh, table: &EdgeTable, account: &mut Account) -> bool {
    let borders: Vec<u32> = table
        .edges()
        .filter(|e| e.len() == 1)
        .map(|e| e[0])
        .collect();
    let mut splits = find(mesh, &borders);
    splits.sort_unstable_by_key(|s| s.half_edge);
    keep_first(&mut splits);
    let splits = keep_shared(mesh, splits);
    if splits.is_empty() {
        return false;
    }
    account.t_junctions = splits.iter().map(|s| s.inner.len()).sum();
    let before = mesh.triangles.len();
    for same in splits.chunk_by(|a, b| a.half_edge / 3 == b.half_edge / 3) {
        let mut chains: [&[u32]; 3] = [&[]; 3];
        for split in same {
            chains[split.half_edge as usize % 3] = &split.inner;
        }
        let t = same[0].half_edge as usize / 3;
        let pieces = fans(mesh.triangles[t], chains);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        account.gained_area += pieces.iter().map(area).sum::<f64>() - area(&mesh.triangles[t]);
        mesh.triangles[t] = pieces[0];
        mesh.triangles.extend_from_slice(&pieces[1..]);
    }
    account.added_triangles += mesh.triangles.len() - before;
    true
}

/// All border edges, with the border vertices on each.
fn find(mesh: &WeldedMesh, borders: &[u32]) -> Vec<Split> {
    let at = |v: u32| mesh.positions[v as usize];
    let mut vertices: Vec<u32> = borders
        .iter()
        .flat_map(|&h| [start(&mesh.triangles, h), end(&mesh.triangles, h)])
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    let (low, high) = mesh
        .positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
            (low.min(p), high.max(p))
        });
    let tolerance = TOLERANCE * low.distance(high);
    let tree = PointTree::new(&mesh.positions, vertices);
    borders
        .par_iter()
        .map(|&half_edge| {
            let ends = [
                start(&mesh.triangles, half_edge),
                end(&mesh.triangles, half_edge),
            ];
            let opposite = apex(&mesh.triangles, half_edge);
            let [a, b] = ends.map(at);
            let along = b - a;
            let length = along.length();
            let near = tolerance.min(TOLERANCE_OF_EDGE * length);
            let mut on: Vec<(f64, u32)> = Vec::new();
            tree.for_each_near([a, b], near, |v| {
                let t = (at(v) - a).dot(along) / length;
                let apart = 2.0 * near;
                let inside = t > apart && t < length - apart;
                if inside
                    && !ends.contains(&v)
                    && v != opposite
                    && (a + along * (t / length)).distance(at(v)) <= near
                {
                    on.push((t, v));
                }
            });
            on.sort_unstable_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
            Split {
                half_edge,
                inner: on.into_iter().map(|(_, v)| v).collect(),
            }
        })
        .collect()
}

/// A vertex may lie on two edges of a narrow triangle, but can be put into one only.
fn keep_first(splits: &mut [Split]) {
    let mut seen = Vec::new();
    for same in splits.chunk_by_mut(|a, b| a.half_edge / 3 == b.half_edge / 3) {
        seen.clear();
        for split in same {
            split.inner.retain(|v| seen.binary_search(v).is_err());
            seen.extend_from_slice(&split.inner);
            seen.sort_unstable();
        }
    }
}

/// Keeps the vertices that end a piece which another edge has too.
fn keep_shared(mesh: &WeldedMesh, mut splits: Vec<Split>) -> Vec<Split> {
    if splits.iter().all(|s| s.inner.is_empty()) {
        return Vec::new();
    }
    let corners = |split: &Split| -> Vec<u32> {
        let mut corners = vec![start(&mesh.triangles, split.half_edge)];
        corners.extend_from_slice(&split.inner);
        corners.push(end(&mesh.triangles, split.half_edge));
        corners
    };
    // Both ends of a piece, its split, and its number there.
    let mut pieces: Vec<([u32; 2], u32, u32)> = Vec::new();
    for (s, split) in splits.iter().enumerate() {
        for (k, w) in corners(split).windows(2).enumerate() {
            pieces.push(([w[0].min(w[1]), w[0].max(w[1])], id(s), id(k)));
        }
    }
    pieces.par_sort_unstable();
    let mut shared: Vec<Vec<bool>> = splits
        .iter()
        .map(|s| vec![false; s.inner.len() + 1])
        .collect();
    for same in pieces.chunk_by(|a, b| a.0 == b.0).filter(|s| s.len() > 1) {
        for &(_, s, k) in same {
            shared[s as usize][k as usize] = true;
        }
    }
    for (split, shared) in splits.iter_mut().zip(&shared) {
        let mut k = 0;
        split.inner.retain(|_| {
            k += 1;
            shared[k - 1] || shared[k]
        });
    }
    splits.retain(|s| !s.inner.is_empty());
    splits
}

/// A triangle cut into fans, given the vertices on its three edges; in its sense.
fn fans(triangle: [u32; 3], chains: [&[u32]; 3]) -> Vec<[u32; 3]> {
    let mut done = Vec::new();
    let mut left = vec![(triangle, chains)];
    while let Some((t, chains)) = left.pop() {
        let Some(k) = chains.iter().position(|c| !c.is_empty()) else {
            done.push(t);
            continue;
        };
        // Turned so that the edge to cut is the first.
        let [a, b, c] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
        let [chain, second, third] = [chains[k], chains[(k + 1) % 3], chains[(k + 2) % 3]];
        let mut from = a;
        for (i, &to) in chain.iter().chain([&b]).enumerate() {
            let own = |given, here| if here { given } else { &[][..] };
            let pieces = [&[][..], own(second, i == chain.len()), own(third, i == 0)];
            left.push(([from, to, c], pieces));
            from = to;
        }
    }
    done
}

/// A k-d tree of points with the box of every node, to find those near a segment.
struct PointTree<'a> {
    positions: &'a [DVec3],
    vertices: Vec<u32>,
    nodes: Vec<Node>,
}

/// Points `from..to` and their box; the first child follows, `second` is 0 at a leaf.
struct Node {
    low: DVec3,
    high: DVec3,
    from: usize,
    to: usize,
    second: usize,
}

impl<'a> PointTree<'a> {
    const LEAF: usize = 8;

    fn new(positions: &'a [DVec3], vertices: Vec<u32>) -> Self {
        let mut tree = Self {
            positions,
            vertices,
            nodes: Vec::new(),
        };
        if !tree.vertices.is_empty() {
            tree.split(0, tree.vertices.len());
        }
        tree
    }

    fn split(&mut self, from: usize, to: usize) {
        let positions = self.positions;
        let at = |v: u32| positions[v as usize];
        let (low, high) = self.vertices[from..to]
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &v| {
                (low.min(at(v)), high.max(at(v)))
            });
        let node = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            from,
            to,
            second: 0,
        });
        if to - from <= Self::LEAF {
            return;
        }
        let size = high - low;
        let axis = (0..3)
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap_or(0);
        let middle = usize::midpoint(from, to);
        self.vertices[from..to].select_nth_unstable_by(middle - from, |&a, &b| {
            at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(&b))
        });
        self.split(from, middle);
        self.nodes[node].second = self.nodes.len();
        self.split(middle, to);
    }

    /// Calls `each` with every point that may be within `near` of the segment.
    fn for_each_near(&self, [a, b]: [DVec3; 2], near: f64, mut each: impl FnMut(u32)) {
        let along = b - a;
        let mut stack = vec![0];
        while let Some(at) = stack.pop() {
            let Some(node) = self.nodes.get(at) else {
                continue;
            };
            if !meets(a, along, node.low - near, node.high + near) {
                continue;
            }
            if node.second == 0 {
                for &v in &self.vertices[node.from..node.to] {
                    each(v);
                }
            } else {
                stack.push(node.second);
                stack.push(at + 1);
            }
        }
    }
}

/// Whether the segment from `a` meets the box (slabs: Kay & Kajiya, "Ray Tracing Complex Scenes", 1986).
fn meets(a: DVec3, along: DVec3, low: DVec3, high: DVec3) -> bool {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        if along[axis] == 0.0 {
            if a[axis] < low[axis] || a[axis] > high[axis] {
                return false;
            }
            continue;
        }
        let (p, q) = (
            (low[axis] - a[axis]) / along[axis],
            (high[axis] - a[axis]) / along[axis],
        );
        enter = enter.max(p.min(q));
        leave = leave.min(p.max(q));
    }
    // Rounding of the quotients; what is let through is looked at exactly.
    enter <= leave + 1e-9
}

#[cfg(test)]
mod tests;
