//! From a triangle soup with shared vertices to an oriented 2-manifold, without moving a point.
//!
//! 1. Patches, joined by edges with exactly two faces, are oriented breadth-first; the majority of a patch's triangles keep their
//!    sense. Edges where that fails (a Möbius strip has one such curve) are cut.
//! 2. Around an edge with more faces these are sorted by dihedral angle, and each wedge of inside is closed by the two
//!    faces that bound it (Guéziec, Taubin, Lazarus & Horn, "Cutting and Stitching", 2001, with a geometric choice of partners). Faces without
//!    a partner are cut off.
//! 3. A closed component with negative volume is turned inside out.
//! 4. Every fan of triangles around a vertex gets its own copy of the vertex.
//! 5. Edges with the same ends are told apart by halving them ([`ManifoldMesh`] is a simplicial complex).
//!
//! Limits: the cut of a non-orientable surface is some curve, not the shortest. The inner shell of a hollow body is turned
//! outward like any other.

use super::account::Account;
use super::adjacency::{EdgeTable, UnionFind, apex, end, id, label, next, previous, start};
use super::{ManifoldMesh, NONE, WeldedMesh, normals, simplicial};
use glam::DVec3;
use rayon::prelude::*;

/// Makes an oriented manifold of `mesh`, whose edges are in `table`; what had to be cut is put into `account`.
pub fn manifold(mesh: WeldedMesh, table: &EdgeTable, account: &mut Account) -> ManifoldMesh {
    let WeldedMesh {
        positions,
        colours,
        mut triangles,
    } = mesh;
    let (mut twins, mut ambiguous) = two_face_twins(&triangles, table);
    let (mut turned, cuts) = orient(&triangles, &mut twins);
    ambiguous |= cuts > 0;
    account.cut_edges = cuts + pair_others(&positions, &triangles, table, &turned, &mut twins);
    turn_outward(&positions, &triangles, &twins, &mut turned);
    account.flipped_triangles = turned.iter().filter(|t| **t).count();
    turn(&mut triangles, &mut twins, &turned);

    let welded = positions.len();
    let origin = split_fans(&mut triangles, &twins, welded);
    account.vertex_copies = origin.len() - welded;
    let copy = |v: &u32| *v as usize;
    let mut mesh = ManifoldMesh {
        positions: origin.iter().map(|v| positions[copy(v)]).collect(),
        colours: if colours.is_empty() {
            colours
        } else {
            origin.iter().map(|v| colours[copy(v)]).collect()
        },
        normals: Vec::new(),
        origin,
        triangles,
        twins,
        cap_apexes: Vec::new(),
    };
    if ambiguous {
        let before = mesh.triangles.len();
        account.split_edges = simplicial::make_simplicial(&mut mesh, id(welded));
        account.added_triangles += mesh.triangles.len() - before;
    }
    mesh.normals = normals::shared_normals(&mesh);
    mesh
}

/// The other half-edge on edges with two faces; and whether any other edge, or a pillow, makes it necessary to look for
/// edges with the same ends later.
fn two_face_twins(triangles: &[[u32; 3]], table: &EdgeTable) -> (Vec<u32>, bool) {
    let mut twins = vec![NONE; 3 * triangles.len()];
    let mut ambiguous = false;
    for edge in table.edges() {
        match *edge {
            [_] => {}
            [g, h] => {
                twins[g as usize] = h;
                twins[h as usize] = g;
                ambiguous |= apex(triangles, g) == apex(triangles, h);
            }
            _ => ambiguous = true,
        }
    }
    (twins, ambiguous)
}

/// Which triangles must be turned round for neighbours to agree, and how many edges were cut because they cannot.
fn orient(triangles: &[[u32; 3]], twins: &mut [u32]) -> (Vec<bool>, usize) {
    let n = triangles.len();
    let mut turned = vec![false; n];
    // The usual case needs no search.
    let agrees = |(h, &twin): (usize, &u32)| {
        twin == NONE || start(triangles, id(h)) != start(triangles, twin)
    };
    if twins.par_iter().enumerate().all(agrees) {
        return (turned, 0);
    }
    let mut reached = vec![false; n];
    let mut patch: Vec<u32> = Vec::with_capacity(n);
    let mut cuts = 0;
    for seed in 0..n {
        if std::mem::replace(&mut reached[seed], true) {
            continue;
        }
        patch.clear();
        patch.push(id(seed));
        let mut at = 0;
        while let Some(&t) = patch.get(at) {
            at += 1;
            for h in [3 * t, 3 * t + 1, 3 * t + 2] {
                let twin = twins[h as usize];
                if twin == NONE {
                    continue;
                }
                let same_direction = start(triangles, h) == start(triangles, twin);
                let wanted = turned[t as usize] ^ same_direction;
                let other = twin as usize / 3;
                if !std::mem::replace(&mut reached[other], true) {
                    turned[other] = wanted;
                    patch.push(id(other));
                } else if turned[other] != wanted {
                    twins[h as usize] = NONE;
                    twins[twin as usize] = NONE;
                    cuts += 1;
                }
            }
        }
        let minority = patch.iter().filter(|t| turned[**t as usize]).count();
        if 2 * minority > patch.len() {
            for &t in &patch {
                turned[t as usize] = !turned[t as usize];
            }
        }
    }
    (turned, cuts)
}

/// Pairs the faces of edges that have more than two; gives the number of faces left without a partner.
fn pair_others(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    table: &EdgeTable,
    turned: &[bool],
    twins: &mut [u32],
) -> usize {
    let mut alone = 0;
    let mut faces: Vec<(f64, bool, u32)> = Vec::new();
    let mut open = Vec::new();
    let mut unmatched = Vec::new();
    for edge in table.edges().filter(|e| e.len() > 2) {
        sort_around(positions, triangles, edge, turned, &mut faces);
        open.clear();
        unmatched.clear();
        // Going round counter-clockwise, a face whose half-edge runs backward has the inside after it, one that
        // runs forward has it before: brackets on a circle.
        for &(_, backward, h) in &faces {
            if backward {
                open.push(h);
            } else if let Some(partner) = open.pop() {
                join(twins, partner, h);
            } else {
                unmatched.push(h);
            }
        }
        for &h in &unmatched {
            match open.pop() {
                Some(partner) => join(twins, partner, h),
                None => alone += 1,
            }
        }
        alone += open.len();
    }
    alone
}

fn join(twins: &mut [u32], a: u32, b: u32) {
    twins[a as usize] = b;
    twins[b as usize] = a;
}

/// The faces at an edge by angle around it, seen with the edge's higher vertex towards the eye: angle (0..4, monotone, not linear), whether
/// the half-edge runs towards the lower vertex once its triangle is turned, and the half-edge.
fn sort_around(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    edge: &[u32],
    turned: &[bool],
    faces: &mut Vec<(f64, bool, u32)>,
) {
    let at = |v: u32| positions[v as usize];
    let (a, b) = (start(triangles, edge[0]), end(triangles, edge[0]));
    let (low, high) = (at(a.min(b)), at(a.max(b)));
    let axis = (high - low) / (high - low).length();
    let across = |h: u32| {
        let v = at(apex(triangles, h)) - low;
        v - axis * v.dot(axis)
    };
    let x = edge
        .iter()
        .map(|&h| across(h))
        .find(|w| w.length_squared() > 0.0)
        .unwrap_or(DVec3::X);
    let y = axis.cross(x);
    faces.clear();
    faces.extend(edge.iter().map(|&h| {
        let w = across(h);
        let (x, y) = (w.dot(x), w.dot(y));
        let p = x / (x.abs() + y.abs());
        let angle = if y >= 0.0 { 1.0 - p } else { 3.0 + p };
        let backward = (start(triangles, h) > end(triangles, h)) ^ turned[h as usize / 3];
        (if angle.is_finite() { angle } else { 0.0 }, backward, h)
    }));
    // Where two bodies share a face, the one that ends there comes before the one that begins.
    faces.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
}

/// Turns closed components with negative volume.
fn turn_outward(positions: &[DVec3], triangles: &[[u32; 3]], twins: &[u32], turned: &mut [bool]) {
    let (component, count) = components(twins);
    let mut closed = vec![true; count as usize];
    let mut volume = vec![0.0; count as usize];
    let mut anchor = vec![None; count as usize];
    for (t, corners) in triangles.iter().enumerate() {
        let c = component[t] as usize;
        closed[c] &= !twins[3 * t..3 * t + 3].contains(&NONE);
        let [p, q, r] = corners.map(|v| positions[v as usize]);
        // Relative to a point of the component, lest a far-off origin drowns the volume in rounding.
        let from: DVec3 = *anchor[c].get_or_insert(p);
        let six = (p - from).cross(q - from).dot(r - from);
        volume[c] += if turned[t] { -six } else { six };
    }
    for (t, turned) in turned.iter_mut().enumerate() {
        let c = component[t] as usize;
        *turned ^= closed[c] && volume[c] < 0.0;
    }
}

/// The component of every triangle and their number.
pub(super) fn components(twins: &[u32]) -> (Vec<u32>, u32) {
    let mut sets = UnionFind::new(twins.len() / 3);
    for (h, &twin) in (0_u32..).zip(twins) {
        if twin != NONE && twin > h {
            sets.union(h / 3, twin / 3);
        }
    }
    label(&mut sets, 0..id(twins.len() / 3))
}

/// Swaps two corners of each turned triangle and renames its half-edges.
fn turn(triangles: &mut [[u32; 3]], twins: &mut [u32], turned: &[bool]) {
    if !turned.contains(&true) {
        return;
    }
    // (a, b, c) becomes (a, c, b): half-edge 0 (a→b) is now 2 (b→a), and so on.
    let renamed = |h: u32| {
        if h != NONE && turned[h as usize / 3] {
            3 * (h / 3) + 2 - h % 3
        } else {
            h
        }
    };
    for (t, corners) in triangles.iter_mut().enumerate() {
        let own = &mut twins[3 * t..3 * t + 3];
        for h in own.iter_mut() {
            *h = renamed(*h);
        }
        if turned[t] {
            corners.swap(1, 2);
            own.swap(0, 2);
        }
    }
}

/// Gives every fan its own vertex; `origin` of every vertex. The first fan keeps the welded vertex's number.
fn split_fans(triangles: &mut [[u32; 3]], twins: &[u32], welded: usize) -> Vec<u32> {
    let mut origin: Vec<u32> = (0..id(welded)).collect();
    let mut used = vec![false; welded];
    let mut done = vec![false; twins.len()];
    for first in 0..id(twins.len()) {
        if done[first as usize] {
            continue;
        }
        let vertex = start(triangles, first);
        let own = if std::mem::replace(&mut used[vertex as usize], true) {
            origin.push(vertex);
            id(origin.len() - 1)
        } else {
            vertex
        };
        let mut visit = |h: u32| {
            done[h as usize] = true;
            triangles[h as usize / 3][h as usize % 3] = own;
        };
        let mut h = first;
        let open = loop {
            visit(h);
            h = twins[previous(h) as usize];
            if h == NONE || h == first {
                break h == NONE;
            }
        };
        if open {
            h = twins[first as usize];
            while h != NONE {
                h = next(h);
                visit(h);
                h = twins[h as usize];
            }
        }
    }
    origin
}

#[cfg(test)]
mod tests;
