//! The edges around every vertex, and walks along them.

use super::adjacency::{end, id, previous, start};
use super::{ManifoldMesh, NONE};

/// A half-edge that starts at every vertex; at a border the one from which the whole fan follows.
pub(super) struct Fans(pub(super) Vec<u32>);

impl Fans {
    pub(super) fn of(mesh: &ManifoldMesh) -> Self {
        let mut first = vec![NONE; mesh.positions.len()];
        for (h, &twin) in (0_u32..).zip(&mesh.twins) {
            let slot = &mut first[start(&mesh.triangles, h) as usize];
            if *slot == NONE || twin == NONE {
                *slot = h;
            }
        }
        Self(first)
    }

    pub(super) fn is_open(&self, mesh: &ManifoldMesh, v: u32) -> bool {
        let first = self.0[v as usize];
        first == NONE || mesh.twins[first as usize] == NONE
    }

    /// Visits the half-edges from `v` and their ends, counter-clockwise; of the last edge at a border the incoming half.
    pub(super) fn each(&self, mesh: &ManifoldMesh, v: u32, mut visit: impl FnMut(u32, u32)) {
        let first = self.0[v as usize];
        let mut h = first;
        while h != NONE {
            visit(h, end(&mesh.triangles, h));
            let incoming = previous(h);
            h = mesh.twins[incoming as usize];
            if h == NONE {
                visit(incoming, start(&mesh.triangles, incoming));
            }
            if h == first {
                break;
            }
        }
    }
}

/// Steps from the first vertex of its component, and the vertex before, for every vertex.
pub(super) fn breadth_first(mesh: &ManifoldMesh) -> (Vec<u32>, Vec<u32>) {
    let fans = Fans::of(mesh);
    let mut depth = vec![NONE; mesh.positions.len()];
    let mut parent = vec![NONE; mesh.positions.len()];
    let mut queue: Vec<u32> = Vec::with_capacity(mesh.positions.len());
    for root in 0..id(mesh.positions.len()) {
        if depth[root as usize] != NONE {
            continue;
        }
        depth[root as usize] = 0;
        let mut at = queue.len();
        queue.push(root);
        while let Some(&v) = queue.get(at) {
            at += 1;
            fans.each(mesh, v, |_, w| {
                if depth[w as usize] == NONE {
                    depth[w as usize] = depth[v as usize] + 1;
                    parent[w as usize] = v;
                    queue.push(w);
                }
            });
        }
    }
    (depth, parent)
}
