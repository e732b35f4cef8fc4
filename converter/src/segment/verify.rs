//! Exact check that labels are the dual of a triangulation.
//!
//! Nothing but counting on K, the mesh with every boundary loop closed by a cone: a region's cell is a disk iff its
//! vertices are connected and their full subcomplex has Euler characteristic 1 (the cell retracts to it); arcs are
//! counted by their ends, the triangles with three labels. Shares no code with the contraction.

use super::{Segmentation, complex::id};
use crate::mesh::{ManifoldMesh, NONE};
use thiserror::Error;

/// Why labels are not a valid segmentation. Region `regions + l` is boundary loop `l`, loops numbered by smallest vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Violation {
    /// One label a vertex and one crossing a half-edge are needed.
    #[error("segmentation has {labels} labels and {crossings} crossings, made for another mesh")]
    Size {
        /// Labels found.
        labels: usize,
        /// Crossings found.
        crossings: usize,
    },
    /// A label that is no region.
    #[error("vertex {vertex} has label {label}, which is no region")]
    Label {
        /// The vertex.
        vertex: u32,
        /// Its label.
        label: u32,
    },
    /// A region that is empty or not connected.
    #[error("region {region} has {pieces} pieces, not 1")]
    Pieces {
        /// The region.
        region: u32,
        /// Its connected pieces.
        pieces: u32,
    },
    /// The region's cell is not a disk.
    #[error("region {region} has Euler characteristic {characteristic}, not 1")]
    NotADisk {
        /// The region.
        region: u32,
        /// Euler characteristic of its cell.
        characteristic: i64,
    },
    /// Two regions meet in other than one arc.
    #[error("regions {regions:?} meet in arcs with {ends} ends, not 2")]
    Arcs {
        /// The two regions.
        regions: [u32; 2],
        /// Ends of their common arcs.
        ends: u32,
    },
    /// Three regions meet in more than one point.
    #[error("regions {regions:?} meet in more than one triangle")]
    Triple {
        /// The three regions.
        regions: [u32; 3],
    },
    /// A region with fewer than three neighbours.
    #[error("region {region} has {neighbours} neighbours, not 3 or more")]
    Neighbours {
        /// The region.
        region: u32,
        /// Number of its neighbours.
        neighbours: u32,
    },
    /// A border crossing outside its range, or different on both sides.
    #[error("crossing of half-edge {half_edge} is out of range or disagrees with its twin")]
    Crossing {
        /// The half-edge.
        half_edge: u32,
    },
}

/// Checks all that [`Segmentation`] promises.
///
/// # Errors
/// The first [`Violation`] found.
pub fn verify(mesh: &ManifoldMesh, segmentation: &Segmentation) -> Result<(), Violation> {
    let Segmentation {
        labels,
        regions,
        crossings,
    } = segmentation;
    if labels.len() != mesh.positions.len() || crossings.len() != mesh.triangles.len() * 3 {
        return Err(Violation::Size {
            labels: labels.len(),
            crossings: crossings.len(),
        });
    }
    for &vertex in mesh.triangles.as_flattened() {
        let label = labels[vertex as usize];
        if label >= *regions {
            return Err(Violation::Label { vertex, label });
        }
    }
    for (region, pieces) in pieces(mesh, labels, *regions).into_iter().enumerate() {
        if pieces != 1 {
            return Err(Violation::Pieces {
                region: id(region),
                pieces,
            });
        }
    }
    if let Some(&fault) = faults(mesh, &loops(mesh), labels, &vec![true; *regions as usize]).first()
    {
        return Err(fault);
    }
    for (h, &f) in crossings.iter().enumerate() {
        let twin = mesh.twins[h];
        let agrees = twin == NONE || (f + crossings[twin as usize] - 1.0).abs() < 1e-6;
        let [u, v] = ends(mesh, h);
        let in_range = if labels[u as usize] == labels[v as usize] {
            f.to_bits() == 0.5_f32.to_bits()
        } else {
            (0.05..=0.95).contains(&f)
        };
        if !agrees || !in_range {
            return Err(Violation::Crossing { half_edge: id(h) });
        }
    }
    Ok(())
}

/// Start and end vertex of half-edge `h`.
fn ends(mesh: &ManifoldMesh, h: usize) -> [u32; 2] {
    let t = mesh.triangles[h / 3];
    [t[h % 3], t[(h % 3 + 1) % 3]]
}

/// Boundary loop of every vertex, loops numbered by smallest vertex.
fn loops(mesh: &ManifoldMesh) -> Vec<u32> {
    let mut sets = Sets::new(mesh.positions.len());
    let mut open = vec![false; mesh.positions.len()];
    for (h, _) in mesh
        .twins
        .iter()
        .enumerate()
        .filter(|&(_, &twin)| twin == NONE)
    {
        let [u, v] = ends(mesh, h);
        sets.join(u, v);
        open[u as usize] = true;
        open[v as usize] = true;
    }
    let mut of_root = vec![NONE; open.len()];
    let mut loop_of = vec![NONE; open.len()];
    let mut count = 0;
    for v in (0..id(open.len())).filter(|&v| open[v as usize]) {
        let root = sets.root(v) as usize;
        if of_root[root] == NONE {
            of_root[root] = count;
            count += 1;
        }
        loop_of[v as usize] = of_root[root];
    }
    loop_of
}

/// Connected pieces of every region.
pub(super) fn pieces(mesh: &ManifoldMesh, labels: &[u32], regions: u32) -> Vec<u32> {
    let mut pieces = vec![0; regions as usize];
    let mut used = vec![false; labels.len()];
    let mut sets = Sets::new(labels.len());
    for &v in mesh.triangles.as_flattened() {
        if !std::mem::replace(&mut used[v as usize], true) {
            pieces[labels[v as usize] as usize] += 1;
        }
    }
    for t in &mesh.triangles {
        for (u, v) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let label = labels[u as usize];
            if label == labels[v as usize] && sets.join(u, v) {
                pieces[label as usize] -= 1;
            }
        }
    }
    pieces
}

/// Violations of what connected regions promise, as far as a `watched` region is involved. `loop_of` gives every vertex its
/// boundary loop or [`NONE`].
pub(super) fn faults(
    mesh: &ManifoldMesh,
    loop_of: &[u32],
    labels: &[u32],
    watched: &[bool],
) -> Vec<Violation> {
    let regions = id(watched.len());
    let loop_count = loop_of
        .iter()
        .filter(|&&l| l != NONE)
        .max()
        .map_or(0, |l| l + 1);
    let mut characteristic = vec![0_i64; watched.len()];
    let mut used = vec![false; labels.len()];
    let mut pairs = Vec::new();
    let mut triples = Vec::new();
    let mut add_pair = |a: u32, b: u32| pairs.push([a.min(b), a.max(b)]);
    for (t, twins) in mesh.triangles.iter().zip(mesh.twins.chunks_exact(3)) {
        let l = t.map(|v| labels[v as usize]);
        if !l.iter().any(|&label| watched[label as usize]) {
            continue;
        }
        for k in 0..3 {
            let (u, v, open) = (t[k], t[(k + 1) % 3], twins[k] == NONE);
            let (a, b) = (l[k], l[(k + 1) % 3]);
            if !std::mem::replace(&mut used[u as usize], true) {
                characteristic[a as usize] += 1;
                if loop_of[u as usize] != NONE {
                    add_pair(a, regions + loop_of[u as usize]);
                }
            }
            if a != b {
                add_pair(a, b);
                if open {
                    triples.push([a, b, regions + loop_of[u as usize]]);
                }
            } else if open || u < v {
                // An inner edge is seen from both sides, in opposite directions.
                characteristic[a as usize] -= 1;
            }
        }
        if l[0] == l[1] && l[1] == l[2] {
            characteristic[l[0] as usize] += 1;
        } else if l[0] != l[1] && l[1] != l[2] && l[2] != l[0] {
            triples.push(l);
        }
    }
    let mut faults = Vec::new();
    for (region, &characteristic) in characteristic.iter().enumerate() {
        if watched[region] && characteristic != 1 {
            faults.push(Violation::NotADisk {
                region: id(region),
                characteristic,
            });
        }
    }
    meetings(pairs, triples, loop_count, watched, &mut faults);
    faults
}

/// Checks how regions meet: `pairs` at edges, `triples` in triangles.
fn meetings(
    mut pairs: Vec<[u32; 2]>,
    mut triples: Vec<[u32; 3]>,
    loop_count: u32,
    watched: &[bool],
    faults: &mut Vec<Violation>,
) {
    let is_watched = |region: u32| watched.get(region as usize).copied().unwrap_or(false);
    for t in &mut triples {
        t.sort_unstable();
    }
    triples.sort_unstable();
    for two in triples.windows(2) {
        if two[0] == two[1] {
            faults.push(Violation::Triple { regions: two[0] });
        }
    }
    // A loop is beside regions that were not looked at unless all were.
    let all = watched.iter().all(|&watched| watched);
    let mut arc_ends: Vec<[u32; 2]> = triples
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [a, c], [b, c]])
        .collect();
    arc_ends.sort_unstable();
    pairs.sort_unstable();
    pairs.dedup();
    let mut neighbours = vec![0_u32; watched.len() + loop_count as usize];
    let mut at = 0;
    for pair in pairs {
        let start = at;
        while arc_ends.get(at) == Some(&pair) {
            at += 1;
        }
        if at - start != 2 && pair.into_iter().any(is_watched) {
            faults.push(Violation::Arcs {
                regions: pair,
                ends: id(at - start),
            });
        }
        for region in pair {
            neighbours[region as usize] += 1;
        }
    }
    for (region, &neighbours) in neighbours.iter().enumerate() {
        if neighbours < 3 && watched.get(region).copied().unwrap_or(all) {
            faults.push(Violation::Neighbours {
                region: id(region),
                neighbours,
            });
        }
    }
}

/// Disjoint sets of vertices.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..id(count)).collect())
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            let above = self.0[v as usize];
            self.0[v as usize] = self.0[above as usize];
            v = above;
        }
        v
    }

    /// Joins two sets; whether they were two.
    fn join(&mut self, u: u32, v: u32) -> bool {
        let (u, v) = (self.root(u), self.root(v));
        self.0[u.max(v) as usize] = u.min(v);
        u != v
    }
}
