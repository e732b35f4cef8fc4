//! Fewer triangles where a mesh has far more than its conversion can use.
//!
//! A mesh of more than [`MANY`] triangles, or one that [`is_torn`], loses edges, the shortest first, that are shorter than those of
//! as many equal triangles on its area as are [`Goal::enough`]: one vertex takes the place of two, where the planes of the source's triangles ask for it
//! (Garland & Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997). A collapse must keep three promises: the
//! surface stays what it is topologically (the link condition of Dey, Edelsbrunner, Guha & Nekhayev, "Topology preserving edge
//! contraction", 1999), the mean square of the distance to the source's planes stays a small part of the target, and the
//! guaranteed distance stays within it (`change`). Detail that the target asks for therefore stays, however fine.
//!
//! It works block by block, runs of triangles along a Morton curve, with the vertices held that a block shares; a second pass
//! with other blocks takes what the first had to hold. Blocks are independent, so that any number of threads gives the same
//! mesh, and what one takes in memory does not grow with the mesh.
//!
//! Limits: border vertices and those of non-manifold edges stay; meshes with colours of vertices stay as they are.

mod aimed;
mod change;
mod collapse;
mod quadric;
#[cfg(test)]
mod tests;

pub use aimed::{Aimed, MOST_KEPT, aimed};

use super::adjacency::{EdgeTable, UnionFind, id};
use super::{NONE, WeldedMesh, bounds, weld};
use collapse::{Collapsed, Limits, Moved};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles up to which a mesh is left alone; about half as many are left of a larger one that is smooth.
pub const MANY: usize = 2_000_000;

/// Triangles from which on a mesh is asked whether it is torn.
const SOME: usize = 100_000;
/// A mesh is torn if it has fewer triangles than so many for each loop of edges that have not two.
const TRIANGLES_A_LOOP: usize = 1000;

/// How far decimation goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// Root of the mean squared distance to the planes of merged triangles, a length.
    pub rms: f64,
    /// Guaranteed distance of each pass, a length.
    pub bound: f64,
    /// Triangles that it stops at, about.
    pub enough: usize,
}

impl Goal {
    /// Of a mesh that charts are made of, for an RMS error of `target`, a length.
    pub fn for_charts(target: f64, enough: usize) -> Self {
        Self {
            rms: 0.2 * target,
            bound: 2.0 * target,
            enough,
        }
    }
}

/// Whether a mesh is so full of borders and non-manifold edges that it will be clusters: photogrammetry of what has no clear surface. Small
/// meshes are not, whatever they are.
pub fn is_torn(mesh: &WeldedMesh) -> bool {
    let triangles = &mesh.triangles;
    if triangles.len() < SOME {
        return false;
    }
    let mut sets = UnionFind::new(mesh.positions.len());
    let mut is_open = vec![false; mesh.positions.len()];
    let edges = EdgeTable::new(triangles, mesh.positions.len());
    for ends in edges.open(triangles) {
        sets.union(ends[0], ends[1]);
        for v in ends {
            is_open[v as usize] = true;
        }
    }
    let open = (0u32..).zip(&is_open).filter(|(_, is_open)| **is_open);
    let loops = open.filter(|&(v, _)| sets.find(v) == v).count();
    triangles.len() < TRIANGLES_A_LOOP * loops
}

/// Edges shorter than this, over the edge of equal triangles, are collapsed; the edges left are about as long as those.
const SHORT: f64 = 0.8;
/// Triangles of a block, at least and at most.
const LEAST_BLOCK: usize = 1 << 14;
const MOST_BLOCK: usize = 1 << 16;
/// Blocks of a mesh that has fewer triangles than so many of the largest: threads share them evenly.
const BLOCKS: usize = 16;

/// What decimation did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Decimated {
    /// Triangles taken away.
    pub triangles: usize,
    /// Area that was lost (gained, below 0) with them.
    pub area: f64,
    /// Upper bound of the Hausdorff distance between both meshes.
    pub bound: f64,
    /// RMS distance from the vertices taken away to the mesh that is left, the sum of both passes, each measured at one in
    /// eight of them; where it was [`aimed()`] that from samples of the source.
    pub rms: f64,
}

/// Decimates a mesh without colours as far as `goal` says. Also one in eight of the vertices that were taken away, for measurements.
pub fn decimate(mesh: &mut WeldedMesh, goal: Goal) -> (Decimated, Vec<DVec3>) {
    let Goal { rms, bound, enough } = goal;
    let mut decimated = Decimated::default();
    let mut gone = Vec::new();
    if mesh.triangles.len() <= enough || !mesh.colours.is_empty() {
        return (decimated, gone);
    }
    let before = (mesh.triangles.len(), area(mesh));
    // Of `enough` equilateral triangles.
    let edge = (4.0 / 3.0_f64.sqrt() * before.1 / enough.max(1) as f64).sqrt();
    let limits = Limits {
        edge: SHORT * edge,
        rms,
        normals: 0.0,
        bound,
        notes_gone: true,
    };
    for origin in [0.0, 0.6] {
        let pass = Pass::over(mesh, &[], limits, origin);
        decimated.bound += pass.bound;
        decimated.rms += pass.rms();
        mesh.triangles = pass.triangles;
        for moved in &pass.moved {
            mesh.positions[moved.vertex as usize] = moved.place;
        }
        if gone.is_empty() {
            // Those of the second pass are no vertices of the source.
            gone = pass.gone;
        }
    }
    weld::drop_unused(&mut mesh.positions, &mut mesh.triangles);
    decimated.triangles = before.0 - mesh.triangles.len();
    decimated.area = before.1 - area(mesh);
    (decimated, gone)
}

/// What collapses in all blocks of a mesh leave of it.
struct Pass {
    triangles: Vec<[u32; 3]>,
    moved: Vec<Moved>,
    /// Bound of the distance that the surface moved.
    bound: f64,
    /// Some of the vertices taken away, and the sum of their squared distances.
    gone: Vec<DVec3>,
    squares: f64,
}

impl Pass {
    /// Collapses edges of all blocks of `mesh`, on a curve whose cells start `origin` of the extent below it. `normals` are those of
    /// its vertices, or none.
    fn over(mesh: &WeldedMesh, normals: &[Vec3], limits: Limits, origin: f64) -> Self {
        /// Of a vertex that several blocks have.
        const SHARED: u32 = NONE - 1;
        let order = along_curve(mesh, origin);
        let block = (order.len().div_ceil(BLOCKS)).clamp(LEAST_BLOCK, MOST_BLOCK);
        let mut owner = vec![NONE; mesh.positions.len()];
        for (block, number) in order.chunks(block).zip(0..) {
            for &t in block {
                for v in mesh.triangles[t as usize] {
                    let owner = &mut owner[v as usize];
                    *owner = if *owner == NONE || *owner == number {
                        number
                    } else {
                        SHARED
                    };
                }
            }
        }
        let blocks: Vec<Collapsed> = order
            .par_chunks(block)
            .map(|block| {
                let triangles: Vec<[u32; 3]> =
                    block.iter().map(|&t| mesh.triangles[t as usize]).collect();
                let is_shared = |v: u32| owner[v as usize] == SHARED;
                collapse::collapse(&mesh.positions, normals, &triangles, is_shared, limits)
            })
            .collect();
        drop((order, owner));
        let mut pass = Self {
            triangles: Vec::with_capacity(blocks.iter().map(|b| b.triangles.len()).sum()),
            moved: Vec::with_capacity(blocks.iter().map(|b| b.moved.len()).sum()),
            bound: 0.0,
            gone: Vec::new(),
            squares: 0.0,
        };
        for block in blocks {
            pass.triangles.extend(block.triangles);
            pass.moved.extend(block.moved);
            pass.bound = pass.bound.max(block.bound);
            pass.squares += block.squares;
            pass.gone.extend(block.gone);
        }
        pass
    }

    /// RMS distance of the vertices taken away.
    fn rms(&self) -> f64 {
        (self.squares / self.gone.len().max(1) as f64).sqrt()
    }
}

/// All triangles in the order of a Morton curve through their centres.
fn along_curve(mesh: &WeldedMesh, origin: f64) -> Vec<u32> {
    const CELLS: f64 = 1024.0;
    let (low, high) = bounds(&mesh.positions);
    let extent = (high - low).max_element().max(f64::MIN_POSITIVE);
    let scale = CELLS / ((1.0 + origin) * extent);
    let mut keyed: Vec<u64> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .map(|(t, corners)| {
            let corners = corners.map(|v| mesh.positions[v as usize] - low);
            let cell = (corners.into_iter().sum::<DVec3>() / 3.0 + origin * extent) * scale;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped"
            )]
            let cell = cell
                .clamp(DVec3::ZERO, DVec3::splat(CELLS - 1.0))
                .to_array()
                .map(|c| c as u64);
            let code = spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2;
            code << 32 | u64::from(id(t))
        })
        .collect();
    keyed.par_sort_unstable();
    #[expect(clippy::cast_possible_truncation, reason = "the low half of the entry")]
    let order = keyed.into_iter().map(|entry| entry as u32).collect();
    order
}

/// The low ten bits, two zeros between each two.
fn spread(cell: u64) -> u64 {
    (0..10).fold(0, |code, bit| code | (cell >> bit & 1) << (3 * bit))
}

fn area(mesh: &WeldedMesh) -> f64 {
    super::account::total_area(&mesh.positions, &mesh.triangles)
}
