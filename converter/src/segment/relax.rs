//! Lloyd's iteration that keeps valid labels valid: vertices change region one at a time.
//!
//! A vertex may go to a region beside it if the regions' borders around it only move (as simple points do in digital
//! topology, Bertrand 1994), or if one border edge of the dual triangulation is flipped and the new edge is not there yet. So
//! every state on the way is the dual of a triangulation.
//! Limit: where the Voronoi cells themselves are not valid, some vertices cannot follow; they stay where they were.

use super::Labels;
use super::complex::{Complex, id};
use super::surface::Surface;
use crate::mesh::{ManifoldMesh, NONE};
use std::collections::VecDeque;

/// Moves `labels` towards the `wanted` ones, those of Voronoi cells around the regions' centres, nearest vertices first.
/// `dual` says which regions meet, loops included.
pub(super) fn relax(
    mesh: &ManifoldMesh,
    surface: &Surface,
    wanted: &[u32],
    distances: &[f64],
    dual: &mut Complex,
    labels: &mut Labels,
) {
    let fans = Fans::of(mesh);
    let Labels {
        of: labels,
        count: first_loop,
    } = labels;
    let wants = |labels: &[u32], v: u32| labels[v as usize] != wanted[v as usize];
    let mut waiting: Vec<u32> = (0..id(labels.len()))
        .filter(|&v| wants(labels, v))
        .collect();
    // Cells grow outwards from their seeds.
    let distance = |v: u32| distances[v as usize];
    waiting.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
    let mut queue = VecDeque::from(waiting);
    let mut around = Vec::new();
    while let Some(v) = queue.pop_front() {
        if !wants(labels, v) {
            continue;
        }
        let (from, to) = (labels[v as usize], wanted[v as usize]);
        around.clear();
        fans.each(mesh, v, |w| around.push(labels[w as usize]));
        if surface.loop_of[v as usize] != NONE {
            around.push(*first_loop + surface.loop_of[v as usize]);
        }
        if !may_go(&mut around, from, to, dual) {
            continue;
        }
        labels[v as usize] = to;
        fans.each(mesh, v, |w| {
            if wants(labels, w) {
                queue.push_back(w);
            }
        });
    }
}

/// Whether a vertex with labels `around` it, in cyclic order, may leave region `from` for `to`. Updates `dual` if it may.
fn may_go(around: &mut Vec<u32>, from: u32, to: u32, dual: &mut Complex) -> bool {
    around.dedup();
    if around.len() > 1 && around.first() == around.last() {
        around.pop();
    }
    let distinct = around
        .iter()
        .enumerate()
        .all(|(i, label)| !around[..i].contains(label));
    let (Some(from_at), Some(to_at)) = (
        around.iter().position(|&label| label == from),
        around.iter().position(|&label| label == to),
    ) else {
        return false;
    };
    let count = around.len();
    if !distinct || count > 4 {
        return false;
    }
    let apart = (to_at + count - from_at) % count;
    if count < 4 || apart == 2 {
        return true;
    }
    // In order: from, to, x, y or from, y, x, to. The border from–x gives way to one of to–y.
    let (x, y) = (around[(from_at + 2) % 4], around[(from_at + 4 - apart) % 4]);
    dual.flip([from, x], [to, y])
}

/// The triangles around every vertex.
struct Fans(Vec<u32>);

impl Fans {
    fn of(mesh: &ManifoldMesh) -> Self {
        let mut first = vec![NONE; mesh.positions.len()];
        for (h, &twin) in mesh.twins.iter().enumerate() {
            let slot = &mut first[mesh.triangles[h / 3][h % 3] as usize];
            // A border vertex's fan starts at its border edge.
            if *slot == NONE || twin == NONE {
                *slot = id(h);
            }
        }
        Self(first)
    }

    /// Neighbours of `v`, counter-clockwise.
    fn each(&self, mesh: &ManifoldMesh, v: u32, mut visit: impl FnMut(u32)) {
        let first = self.0[v as usize];
        let mut h = first;
        while h != NONE {
            let (t, k) = (mesh.triangles[h as usize / 3], h as usize % 3);
            visit(t[(k + 1) % 3]);
            let incoming = h as usize / 3 * 3 + (k + 2) % 3;
            h = mesh.twins[incoming];
            if h == NONE {
                visit(t[(k + 2) % 3]);
            }
            if h == first {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::may_go;
    use crate::segment::complex::Complex;

    /// Regions 0–4: an equator 1, 2, 3 between the poles 0 and 4.
    fn bipyramid() -> Complex {
        let mut complex = Complex::default();
        for neighbours in [
            vec![1, 2, 3],
            vec![0, 2, 3, 4],
            vec![0, 1, 3, 4],
            vec![0, 1, 2, 4],
            vec![1, 2, 3],
        ] {
            complex.push(neighbours);
        }
        complex
    }

    #[test]
    fn border_vertex_changes_sides() {
        assert!(may_go(&mut vec![0, 0, 1, 1, 0], 0, 1, &mut bipyramid()));
        assert!(may_go(&mut vec![0, 2, 1], 0, 1, &mut bipyramid()));
        assert!(may_go(&mut vec![1, 0, 2, 3], 1, 2, &mut bipyramid()));
    }

    #[test]
    fn bridge_and_last_vertex_stay() {
        assert!(!may_go(&mut vec![0, 1, 0, 2], 0, 1, &mut bipyramid()));
        assert!(!may_go(&mut vec![1, 2, 3], 0, 1, &mut bipyramid()));
    }

    #[test]
    fn edge_is_flipped_only_to_a_new_one() {
        let mut dual = bipyramid();
        // 1 and 2 meet between 0 and 4, which do not.
        assert!(may_go(&mut vec![1, 0, 2, 4], 1, 0, &mut dual));
        assert!(dual.adjacent(0, 4) && !dual.adjacent(1, 2));
        assert!(!may_go(&mut vec![1, 0, 3, 4], 1, 0, &mut dual));
    }
}
