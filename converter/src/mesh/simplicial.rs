//! Makes every edge known by its two ends, and every triangle by its three corners.
//!
//! After pairing and cutting, two edges may still join the same two vertices: a slit of one edge, or sheets that
//! pinch an edge and are connected elsewhere. All but one of them are halved. A pillow (two triangles glued along all three edges)
//! has one edge halved first.
//!
//! It ends: the halves and the edge from the new vertex to an apex are new pairs, unless both faces have the same apex, and then
//! halving one of those two edges, whose apexes differ, settles it.

use super::adjacency::{EdgeTable, apex, id, next, previous};
use super::{ManifoldMesh, NONE};
use std::collections::BTreeMap;

/// Halves edges until all have different ends; gives the number of halvings. New vertices get origins from `next_origin` on, one
/// for each pair of origins, since their positions are bit-equal.
pub(super) fn make_simplicial(mesh: &mut ManifoldMesh, next_origin: u32) -> usize {
    let mut origins = BTreeMap::new();
    let mut halved = 0;
    loop {
        let chosen = offending(mesh);
        if chosen.is_empty() {
            return halved;
        }
        halved += chosen.len();
        for h in chosen {
            let [a, b] =
                [h, next(h)].map(|h| mesh.triangles[h as usize / 3][h as usize % 3] as usize);
            let ends = (
                mesh.origin[a].min(mesh.origin[b]),
                mesh.origin[a].max(mesh.origin[b]),
            );
            let fresh = next_origin + id(origins.len());
            mesh.origin.push(*origins.entry(ends).or_insert(fresh));
            mesh.positions
                .push(mesh.positions[a] * 0.5 + mesh.positions[b] * 0.5);
            if !mesh.colours.is_empty() {
                let (p, q) = (mesh.colours[a], mesh.colours[b]);
                mesh.colours.push([0, 1, 2].map(|k| p[k].midpoint(q[k])));
            }
            halve(mesh, h, id(mesh.positions.len() - 1));
        }
    }
}

/// Half-edges to halve, no two at the same triangle.
fn offending(mesh: &ManifoldMesh) -> Vec<u32> {
    let table = EdgeTable::new(&mesh.triangles, mesh.positions.len());
    let twin = |h: u32| mesh.twins[h as usize];
    let mut touched = vec![false; mesh.triangles.len()];
    let mut chosen = Vec::new();
    for edge in table.edges() {
        let kept = match *edge {
            [_] => continue,
            [g, h] if twin(g) == h => {
                let pillow = apex(&mesh.triangles, g) == apex(&mesh.triangles, h)
                    && [next(g), previous(g)]
                        .iter()
                        .all(|&i| twin(i) != NONE && twin(i) / 3 == h / 3);
                if !pillow {
                    continue;
                }
                0
            }
            _ => 1,
        };
        let one_of_each = edge.iter().copied().filter(|&h| twin(h) > h);
        for h in one_of_each.skip(kept) {
            let faces = [h / 3, if twin(h) == NONE { h / 3 } else { twin(h) / 3 }];
            if faces.iter().all(|&t| !touched[t as usize]) {
                for t in faces {
                    touched[t as usize] = true;
                }
                chosen.push(h);
            }
        }
    }
    chosen
}

/// Puts vertex `middle` onto the edge of `h` and cuts the faces there in two.
fn halve(mesh: &mut ManifoldMesh, h: u32, middle: u32) {
    let g = mesh.twins[h as usize];
    let far = halve_face(mesh, h, middle);
    if g == NONE {
        return;
    }
    let near = halve_face(mesh, g, middle);
    // h now runs to the middle, g from the other end to it.
    for (a, b) in [(h, near), (g, far)] {
        mesh.twins[a as usize] = b;
        mesh.twins[b as usize] = a;
    }
}

/// Cuts the triangle of `h` from `middle` to its apex; it keeps the half with the start of `h`. Gives the half-edge from `middle` to
/// the end of `h`, in the new triangle, without a twin.
fn halve_face(mesh: &mut ManifoldMesh, h: u32, middle: u32) -> u32 {
    let (after, before) = (next(h), previous(h));
    let corner = |h: u32| mesh.triangles[h as usize / 3][h as usize % 3];
    let new = [middle, corner(after), corner(before)];
    let base = id(3 * mesh.triangles.len());
    mesh.triangles.push(new);
    mesh.triangles[after as usize / 3][after as usize % 3] = middle;
    let outer = mesh.twins[after as usize];
    mesh.twins.extend([NONE, outer, after]);
    if outer != NONE {
        mesh.twins[outer as usize] = base + 1;
    }
    mesh.twins[after as usize] = base + 2;
    mesh.twins[h as usize] = NONE;
    base
}
