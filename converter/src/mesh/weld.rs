//! Vertices with the same position become one.
//!
//! The exact weld compares position bits (−0 equals +0). A tolerance weld follows only where the exact one has plainly
//! failed: more than [`FAILED_BORDER`] of the edges are border edges, *and* merging vertices that lie closer than a
//! hundredth of the median edge takes away at least half of them, and hardly any area. A genuine soup stays as it is.
//!
//! Limit: the tolerance weld joins chains of close vertices, whatever their length, into the first of them.

use super::account::{Account, Reason, total_area};
use super::adjacency::{EdgeTable, UnionFind, end, id, start};
use super::{ImportedMesh, NONE, WeldedMesh, is_place};
use glam::DVec3;
use rayon::prelude::*;

/// Share of border edges above which the exact weld is suspected to have failed.
pub const FAILED_BORDER: f64 = 0.3;

/// Part of the area that a tolerance weld may change.
pub(super) const WELD_AREA: f64 = 1e-3;

/// Welds bit-equal positions; leaves out triangles that are not finite or have coinciding corners, and unused vertices.
pub fn exact(mesh: ImportedMesh, account: &mut Account) -> WeldedMesh {
    let ImportedMesh {
        positions,
        colours,
        mut triangles,
        ..
    } = mesh;
    let first = first_equal(&positions);
    triangles.retain_mut(|t| {
        let corners = t.map(|v| positions[v as usize]);
        *t = t.map(|v| first[v as usize]);
        let reason = if !corners.into_iter().all(is_place) {
            Reason::NonFinite
        } else if has_equal_corners(*t) {
            Reason::Degenerate
        } else {
            return true;
        };
        account.lose(reason, corners);
        false
    });
    compact(positions, &colours, &first, triangles)
}

/// A weld within a tolerance and its edge table, where the exact one has plainly failed.
pub fn tolerant(
    mesh: &WeldedMesh,
    table: &EdgeTable,
    account: &mut Account,
) -> Option<(WeldedMesh, EdgeTable)> {
    let before = border_share(table);
    if before <= FAILED_BORDER {
        return None;
    }
    let tolerance = tolerance(mesh, table);
    let first = first_within(&mesh.positions, tolerance);
    let (mut kept, mut lost) = (Vec::new(), Vec::new());
    for t in &mesh.triangles {
        let welded = t.map(|v| first[v as usize]);
        if has_equal_corners(welded) {
            lost.push(*t);
        } else {
            kept.push(welded);
        }
    }
    // Details of the size of the tolerance are no failed weld.
    if kept.is_empty() || lost.len() * 100 > mesh.triangles.len() {
        return None;
    }
    let welded = compact(mesh.positions.clone(), &mesh.colours, &first, kept);
    let table = EdgeTable::new(&welded.triangles, welded.positions.len());
    if border_share(&table) > before / 2.0 {
        return None;
    }
    // Nor are triangles that are long and hardly wider than it.
    let area = |mesh: &WeldedMesh| total_area(&mesh.positions, &mesh.triangles);
    let was: f64 = area(mesh) - total_area(&mesh.positions, &lost);
    if (area(&welded) - was).abs() > WELD_AREA * was {
        return None;
    }
    for t in lost {
        account.lose(Reason::TooSmall, t.map(|v| mesh.positions[v as usize]));
    }
    account.weld_tolerance = Some(tolerance);
    Some((welded, table))
}

fn has_equal_corners([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

fn border_share(table: &EdgeTable) -> f64 {
    table.edges().filter(|e| e.len() == 1).count() as f64 / table.len().max(1) as f64
}

/// A hundred-thousandth of the diagonal, but no more than a hundredth of the median edge.
fn tolerance(mesh: &WeldedMesh, table: &EdgeTable) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &p in &mesh.positions {
        (low, high) = (low.min(p), high.max(p));
    }
    let at = |v: u32| mesh.positions[v as usize];
    let mut lengths: Vec<f64> = table
        .edges()
        .map(|e| at(start(&mesh.triangles, e[0])).distance(at(end(&mesh.triangles, e[0]))))
        .collect();
    let middle = lengths.len() / 2;
    let (_, median, _) = lengths.select_nth_unstable_by(middle, f64::total_cmp);
    (1e-5 * low.distance(high)).min(1e-2 * *median)
}

/// Drops vertices that no triangle uses, keeps the order of the others; colours of welded vertices are averaged.
fn compact(
    mut positions: Vec<DVec3>,
    colours: &[[u8; 3]],
    first: &[u32],
    mut triangles: Vec<[u32; 3]>,
) -> WeldedMesh {
    let number = drop_unused(&mut positions, &mut triangles);
    let mut welded = WeldedMesh {
        positions,
        colours: Vec::new(),
        triangles,
    };
    if !colours.is_empty() {
        let mut sums = vec![[0_u64; 4]; welded.positions.len()];
        for (colour, &f) in colours.iter().zip(first) {
            if let Some(sum) = sums.get_mut(number[f as usize] as usize) {
                for k in 0..3 {
                    sum[k] += u64::from(colour[k]);
                }
                sum[3] += 1;
            }
        }
        let mean = |s: u64, n: u64| u8::try_from((s + n / 2) / n.max(1)).unwrap_or(u8::MAX);
        welded.colours = sums
            .iter()
            .map(|s| [0, 1, 2].map(|k| mean(s[k], s[3])))
            .collect();
    }
    welded
}

/// Drops positions that no triangle has, in place, and keeps the order of the others; their new numbers, by the old ones.
pub(super) fn drop_unused(positions: &mut Vec<DVec3>, triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let mut number = vec![NONE; positions.len()];
    for &v in triangles.as_flattened() {
        number[v as usize] = 0;
    }
    let mut count = 0;
    for (v, n) in number.iter_mut().enumerate().filter(|(_, n)| **n != NONE) {
        *n = id(count);
        positions[count] = positions[v];
        count += 1;
    }
    positions.truncate(count);
    positions.shrink_to_fit();
    for v in triangles.as_flattened_mut() {
        *v = number[*v as usize];
    }
    number
}

/// Position bits with −0 made +0.
fn bits(p: DVec3) -> [u64; 3] {
    (p + DVec3::ZERO).to_array().map(f64::to_bits)
}

/// Mixes three words; equal words give equal hashes, that is all that correctness needs.
fn hash(words: [u64; 3]) -> u64 {
    words.into_iter().fold(0, |h: u64, w| {
        let x = (h ^ w).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x ^ x >> 29
    })
}

/// For every position the first one with the same bits.
fn first_equal(positions: &[DVec3]) -> Vec<u32> {
    /// Runs of equal hashes longer than this are sorted by position, lest crafted input take quadratic time.
    const LONG: usize = 32;
    let mut order: Vec<(u64, u32)> = positions
        .par_iter()
        .enumerate()
        .map(|(i, &p)| (hash(bits(p)), id(i)))
        .collect();
    order.par_sort_unstable();
    let mut first: Vec<u32> = (0..id(positions.len())).collect();
    let at = |i: u32| bits(positions[i as usize]);
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        if run.len() > LONG {
            let mut members: Vec<u32> = run.iter().map(|r| r.1).collect();
            members.sort_unstable_by_key(|&i| (at(i), i));
            for same in members.chunk_by(|&a, &b| at(a) == at(b)) {
                for &i in same {
                    first[i as usize] = same[0];
                }
            }
        } else {
            for (k, &(_, i)) in run.iter().enumerate() {
                if let Some(&(_, earlier)) = run[..k].iter().find(|&&(_, j)| at(j) == at(i)) {
                    first[i as usize] = earlier;
                }
            }
        }
    }
    first
}

/// For every position the first of those that it is joined to by steps of at most `tolerance`.
///
/// Cells are four tolerances wide in eight grids, shifted by half a cell along each set of axes, so two close points
/// share a cell in at least one of them.
fn first_within(positions: &[DVec3], tolerance: f64) -> Vec<u32> {
    /// Points of a cell that each point is compared to; more lie there only if nearly all coincide.
    const WINDOW: usize = 16;
    let mut sets = UnionFind::new(positions.len());
    if tolerance <= 0.0 {
        return (0..id(positions.len())).collect();
    }
    for grid in 0..8_u32 {
        let shift = DVec3::new(
            f64::from(grid & 1),
            f64::from(grid >> 1 & 1),
            f64::from(grid >> 2 & 1),
        ) / 2.0;
        let cell = |p: DVec3| hash(bits((p / (4.0 * tolerance) + shift).floor()));
        let mut order: Vec<(u64, u32)> = positions
            .par_iter()
            .enumerate()
            .map(|(i, &p)| (cell(p), id(i)))
            .collect();
        order.par_sort_unstable();
        for run in order.chunk_by(|a, b| a.0 == b.0) {
            for (k, &(_, i)) in run.iter().enumerate() {
                for &(_, j) in run[k + 1..].iter().take(WINDOW) {
                    if positions[i as usize].distance(positions[j as usize]) <= tolerance {
                        sets.union(i, j);
                    }
                }
            }
        }
    }
    (0..id(positions.len())).map(|i| sets.find(i)).collect()
}

#[cfg(test)]
mod tests;
