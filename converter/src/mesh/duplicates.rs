//! Triangles that are there twice.
//!
//! The same three vertices in the same sense: only the first is kept. In the opposite sense it depends on the sheet of such pairs
//! that hang together by edges. If the sheet has a free rim, or touches nothing else, it is a two-sided wall of no
//! thickness, and its second side is left out: it would only fight with the first for every pixel. Otherwise it is where two
//! bodies touch, and both sides stay.

use super::account::{Account, Reason};
use super::adjacency::{EdgeTable, UnionFind, apex, end, id, start};
use super::{NONE, WeldedMesh};

/// Leaves duplicates out of `mesh`; whether there were any (then `table` no longer fits).
pub fn remove(mesh: &mut WeldedMesh, table: &EdgeTable, account: &mut Account) -> bool {
    let mut dropped: Vec<Option<Reason>> = vec![None; mesh.triangles.len()];
    let pairs = find(&mesh.triangles, table, &mut dropped);
    if !pairs.is_empty() {
        for (_, second) in second_sides(&pairs, table, &dropped) {
            dropped[second as usize] = Some(Reason::SecondSide);
        }
    }
    for (t, reason) in mesh.triangles.iter().zip(&dropped) {
        if let Some(reason) = reason {
            account.lose(*reason, t.map(|v| mesh.positions[v as usize]));
        }
    }
    let before = mesh.triangles.len();
    let mut reasons = dropped.iter();
    mesh.triangles
        .retain(|_| reasons.next().is_some_and(Option::is_none));
    mesh.triangles.len() < before
}

/// Marks all but the first of equal triangles; gives the pairs of opposite ones, the earlier first.
fn find(
    triangles: &[[u32; 3]],
    table: &EdgeTable,
    dropped: &mut [Option<Reason>],
) -> Vec<(u32, u32)> {
    let mut pairs = Vec::new();
    let mut faces: Vec<(u32, u32)> = Vec::new();
    for edge in table.edges().filter(|e| e.len() > 1) {
        // Each triangle is looked at from one edge only: the one between its two lowest vertices.
        faces.clear();
        faces.extend(
            edge.iter()
                .map(|&h| (apex(triangles, h), h))
                .filter(|&(top, h)| top > start(triangles, h) && top > end(triangles, h)),
        );
        faces.sort_unstable();
        for same in faces.chunk_by(|a, b| a.0 == b.0).filter(|s| s.len() > 1) {
            let mut first = [NONE; 2];
            for &(_, h) in same {
                let sense = &mut first[usize::from(start(triangles, h) < end(triangles, h))];
                if *sense == NONE {
                    *sense = h / 3;
                } else {
                    dropped[h as usize / 3] = Some(Reason::Duplicate);
                }
            }
            if let [a, b] = first
                && a != NONE
                && b != NONE
            {
                pairs.push((a.min(b), a.max(b)));
            }
        }
    }
    pairs
}

/// The pairs that lie in a two-sided wall.
fn second_sides(
    pairs: &[(u32, u32)],
    table: &EdgeTable,
    dropped: &[Option<Reason>],
) -> Vec<(u32, u32)> {
    let mut pair_of = vec![NONE; dropped.len()];
    for (i, &(a, b)) in pairs.iter().enumerate() {
        pair_of[a as usize] = id(i);
        pair_of[b as usize] = id(i);
    }
    let mut sheets = UnionFind::new(pairs.len());
    let mut rim = Vec::new();
    let mut touching = Vec::new();
    let mut faces = Vec::new();
    for edge in table.edges().filter(|e| e.len() > 1) {
        faces.clear();
        faces.extend(
            edge.iter()
                .map(|h| h / 3)
                .filter(|&t| dropped[t as usize].is_none()),
        );
        let paired = || {
            faces
                .iter()
                .map(|&t| pair_of[t as usize])
                .filter(|&p| p != NONE)
        };
        let Some(first) = paired().next() else {
            continue;
        };
        for p in paired() {
            sheets.union(first, p);
        }
        if faces.len() == 2 && paired().count() == 2 {
            rim.push(first);
        }
        if paired().count() < faces.len() {
            touching.push(first);
        }
    }
    let mut is_wall = vec![true; pairs.len()];
    for p in touching {
        is_wall[sheets.find(p) as usize] = false;
    }
    for p in rim {
        is_wall[sheets.find(p) as usize] = true;
    }
    let wall = |i: usize| is_wall[sheets.find(id(i)) as usize];
    let chosen: Vec<bool> = (0..pairs.len()).map(wall).collect();
    pairs
        .iter()
        .zip(chosen)
        .filter(|(_, chosen)| *chosen)
        .map(|(&pair, _)| pair)
        .collect()
}
