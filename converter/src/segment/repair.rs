//! Seeds added to Voronoi cells until they are the dual of a triangulation.
//!
//! As in the topological refinement of restricted Voronoi diagrams (Edelsbrunner & Shah, "Triangulating topological
//! spaces", 1997; farthest points as in Peyré & Cohen, "Geodesic remeshing using front propagation", 2006). It ends at the
//! latest when every vertex is a seed, which is the mesh itself.

use super::complex::id;
use super::surface::Surface;
use super::verify::{Violation, faults, pieces};
use super::voronoi::{Seed, Voronoi};
use crate::mesh::ManifoldMesh;

/// Rounds after which a component that is still invalid is given up; two or three dozen are normal for genus 100.
const ROUNDS: u32 = 200;

/// Adds seeds until the cells are valid. Returns the components that are still invalid.
pub(super) fn repair(mesh: &ManifoldMesh, surface: &Surface, voronoi: &mut Voronoi) -> Vec<u32> {
    let mut bad: Vec<Violation> = Vec::new();
    for _ in 0..ROUNDS {
        // What is not touched and was no part of a fault is as good as it was.
        for &region in bad.iter().flat_map(involved) {
            if let Some(touched) = voronoi.touched.get_mut(region as usize) {
                *touched = true;
            }
        }
        bad = faults(mesh, &surface.loop_of, &voronoi.labels, &voronoi.touched);
        bad.extend(bare_loops(surface, voronoi));
        if bad.is_empty() {
            bad = torn(mesh, voronoi);
        }
        let seeds = splits(surface, voronoi, &bad);
        if seeds.is_empty() {
            break;
        }
        voronoi.touched.fill(false);
        voronoi.add(
            surface,
            seeds.iter().map(|&vertex| Seed { vertex, start: 0.0 }),
        );
    }
    let regions = voronoi.seeds.len();
    let mut stubborn: Vec<u32> = bad
        .iter()
        .map(|fault| match involved(fault)[0] as usize {
            region if region < regions => surface.component_of[voronoi.seeds[region] as usize],
            beyond => surface.component_of[surface.loops[beyond - regions][0] as usize],
        })
        .collect();
    stubborn.sort_unstable();
    stubborn.dedup();
    stubborn
}

fn involved(fault: &Violation) -> &[u32] {
    match fault {
        Violation::Pieces { region, .. }
        | Violation::NotADisk { region, .. }
        | Violation::Neighbours { region, .. } => std::slice::from_ref(region),
        Violation::Arcs { regions, .. } => regions,
        Violation::Triple { regions } => regions,
        _ => &[0],
    }
}

/// Cells in pieces: rounding may leave a vertex behind where two seeds are equally near.
fn torn(mesh: &ManifoldMesh, voronoi: &Voronoi) -> Vec<Violation> {
    let pieces = pieces(mesh, &voronoi.labels, id(voronoi.seeds.len()));
    let torn = pieces
        .into_iter()
        .enumerate()
        .filter(|&(_, pieces)| pieces != 1);
    torn.map(|(region, pieces)| Violation::Pieces {
        region: id(region),
        pieces,
    })
    .collect()
}

/// Loops beside fewer than three cells.
fn bare_loops(surface: &Surface, voronoi: &Voronoi) -> Vec<Violation> {
    let first = id(voronoi.seeds.len());
    let mut beside = Vec::new();
    let mut bare = Vec::new();
    for (l, members) in surface.loops.iter().enumerate() {
        beside.clear();
        beside.extend(members.iter().map(|&v| voronoi.labels[v as usize]));
        beside.sort_unstable();
        beside.dedup();
        if beside.len() < 3 {
            bare.push(Violation::Neighbours {
                region: first + id(l),
                neighbours: id(beside.len()),
            });
        }
    }
    bare
}

/// New seeds: for each fault the farthest vertex of the widest cell involved.
fn splits(surface: &Surface, voronoi: &Voronoi, bad: &[Violation]) -> Vec<u32> {
    let farthest = voronoi.farthest();
    let mut seeds = Vec::new();
    for fault in bad {
        let regions = involved(fault);
        let widest = regions
            .iter()
            .filter_map(|&region| farthest.get(region as usize))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match (widest, fault) {
            (Some(&(distance, v)), _) if distance > 0.0 => seeds.push(v),
            (None, Violation::Neighbours { region, .. }) => {
                let members = &surface.loops[*region as usize - farthest.len()];
                let distance = |v: u32| voronoi.distances[v as usize];
                let far = members
                    .iter()
                    .copied()
                    .max_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(b.cmp(&a)));
                seeds.extend(far.filter(|&v| distance(v) > 0.0));
            }
            // Single vertices: their neighbours have to give.
            _ => {
                for seed in regions
                    .iter()
                    .filter_map(|&region| voronoi.seeds.get(region as usize))
                {
                    for &w in surface.neighbours(*seed) {
                        let (distance, v) = farthest[voronoi.labels[w as usize] as usize];
                        if distance > 0.0 {
                            seeds.push(v);
                        }
                    }
                }
            }
        }
    }
    seeds.sort_unstable();
    seeds.dedup();
    seeds
}
