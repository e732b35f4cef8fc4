//! Voronoi cells of seed vertices, and the seeds that make regions round.
//!
//! Lloyd's iteration on a graph: distances are shortest paths along mesh edges (`front`), cells are connected because
//! they are made of path trees. Limit: path lengths exceed geodesic ones by up to 15 % on regular grids.

use super::complex::id;
use super::contract::Cell;
use super::front::Front;
use super::surface::Surface;
use crate::mesh::{ManifoldMesh, NONE};
use rayon::prelude::*;

/// Where a cell grows from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seed {
    /// The vertex.
    pub(super) vertex: u32,
    /// Its distance to begin with, not negative.
    pub(super) start: f64,
}

/// The nearest seed of every vertex.
#[derive(Debug, Clone)]
pub(super) struct Voronoi {
    /// Seed vertices.
    pub(super) seeds: Vec<u32>,
    /// Index of the nearest seed, or [`NONE`].
    pub(super) labels: Vec<u32>,
    /// Distance to it.
    pub(super) distances: Vec<f64>,
    /// Cells that changed since this was last reset.
    pub(super) touched: Vec<bool>,
}

impl Voronoi {
    /// Cells of `seeds`.
    pub(super) fn of(surface: &Surface, seeds: &[Seed]) -> Self {
        let count = surface.cells.len();
        let mut voronoi = Self {
            seeds: Vec::new(),
            labels: vec![NONE; count],
            distances: vec![f64::INFINITY; count],
            touched: Vec::new(),
        };
        voronoi.add(surface, seeds.iter().copied());
        voronoi
    }

    /// Adds seeds; they take over what is nearer to them.
    pub(super) fn add(&mut self, surface: &Surface, seeds: impl IntoIterator<Item = Seed>) {
        let mut front = Front::new(surface);
        for Seed {
            vertex: seed,
            start,
        } in seeds
        {
            let label = id(self.seeds.len());
            self.seeds.push(seed);
            self.touched.push(true);
            self.distances[seed as usize] = start;
            if let Some(touched) = self.touched.get_mut(self.labels[seed as usize] as usize) {
                *touched = true;
            }
            self.labels[seed as usize] = label;
            front.push(start, seed);
        }
        front.spread(
            |v| surface.edges_from(v),
            &mut self.distances,
            |from, to| {
                let label = self.labels[from as usize];
                let old = std::mem::replace(&mut self.labels[to as usize], label);
                if let Some(touched) = self.touched.get_mut(old as usize) {
                    *touched = true;
                }
                true
            },
        );
    }

    /// The farthest vertex of every cell, and its distance.
    pub(super) fn farthest(&self) -> Vec<(f64, u32)> {
        let mut farthest = vec![(0.0, NONE); self.seeds.len()];
        for (v, (&label, &distance)) in self.labels.iter().zip(&self.distances).enumerate() {
            if label != NONE && distance > farthest[label as usize].0 {
                farthest[label as usize] = (distance, id(v));
            }
        }
        farthest
    }
}

/// Lengths of shortest paths from `starts` that stay in one region; infinite in regions without a start.
pub(super) fn within(surface: &Surface, labels: &[u32], starts: &[u32]) -> Vec<f64> {
    let mut distances = vec![f64::INFINITY; labels.len()];
    let mut front = Front::new(surface);
    for &start in starts {
        distances[start as usize] = 0.0;
        front.push(0.0, start);
    }
    front.spread(
        |v| surface.edges_from(v),
        &mut distances,
        |from, to| labels[from as usize] == labels[to as usize],
    );
    distances
}

/// Vertices by region.
struct Regions<'a> {
    surface: &'a Surface,
    labels: &'a [u32],
    starts: Vec<u32>,
    /// Along the components' curves, region by region.
    members: Vec<u32>,
    /// Where every vertex is among the members of its region.
    place: Vec<u32>,
}

impl<'a> Regions<'a> {
    fn of(surface: &'a Surface, labels: &'a [u32], regions: u32) -> Self {
        let mut starts = vec![0_u32; regions as usize + 1];
        let vertices = || surface.components.iter().flatten().copied();
        for v in vertices() {
            starts[labels[v as usize] as usize + 1] += 1;
        }
        for region in 0..regions as usize {
            starts[region + 1] += starts[region];
        }
        let mut next = starts.clone();
        let mut members = vec![NONE; starts[regions as usize] as usize];
        let mut place = vec![NONE; labels.len()];
        for v in vertices() {
            let region = labels[v as usize] as usize;
            members[next[region] as usize] = v;
            place[v as usize] = next[region] - starts[region];
            next[region] += 1;
        }
        Self {
            surface,
            labels,
            starts,
            members,
            place,
        }
    }

    /// The vertex of a region that is best for its centre, and its distance to the region's border and to open borders.
    fn centre(&self, region: u32) -> Option<(u32, f64)> {
        let range =
            self.starts[region as usize] as usize..self.starts[region as usize + 1] as usize;
        let members = &self.members[range];
        let (first, others) = members.split_first()?;
        let cell = |&v: &u32| self.surface.cells[v as usize];
        let mean = others.iter().map(cell).fold(cell(first), Cell::merged);
        let mut best = (f64::NEG_INFINITY, *first, 0.0);
        for (&v, depth) in members.iter().zip(self.depths(region, members)) {
            // A lone centroid may lie nearest to the wrong side of a finger; depth alone says nothing along a strip.
            let score = depth - 0.5 * cell(&v).centroid.distance(mean.centroid);
            if score > best.0 {
                best = (score, v, depth);
            }
        }
        Some((best.1, best.2))
    }

    fn depths(&self, region: u32, members: &[u32]) -> Vec<f64> {
        let inside = |&w: &u32| self.labels[w as usize] == region;
        let mut depths = vec![f64::INFINITY; members.len()];
        let mut front = Front::new(self.surface);
        for ((at, &v), depth) in (0_u32..).zip(members).zip(&mut depths) {
            let is_open = self.surface.loop_of[v as usize] != NONE;
            if is_open || !self.surface.neighbours(v).iter().all(inside) {
                *depth = 0.0;
                front.push(0.0, at);
            }
        }
        let edges = |at: u32| {
            self.surface
                .edges_from(members[at as usize])
                .filter(|(w, _)| inside(w))
                .map(|(w, length)| (self.place[w as usize], length))
        };
        front.spread(edges, &mut depths, |_, _| true);
        depths
    }
}

/// Regions that are less deep than this part of the median grow to it: handles force some into the narrowest necks.
const LEAST_DEPTH: f64 = 0.35;

/// A seed for each region: far from its border, yet near its centroid. With `bias` 1 distances begin at the rim of the
/// circle that fits into the region, so that cells keep their sizes, but for the smallest; with 0 all begin alike.
pub(super) fn centres(surface: &Surface, labels: &[u32], regions: u32, bias: f64) -> Vec<Seed> {
    let by_region = Regions::of(surface, labels, regions);
    let centres: Vec<(u32, f64)> = (0..regions)
        .into_par_iter()
        .filter_map(|region| by_region.centre(region))
        .collect();
    let mut depths: Vec<f64> = centres.iter().map(|&(_, depth)| depth).collect();
    depths.sort_by(f64::total_cmp);
    let deepest = depths.last().copied().unwrap_or_default();
    let median = depths.get(depths.len() / 2).copied().unwrap_or_default();
    let least = LEAST_DEPTH * median;
    centres
        .into_iter()
        .map(|(vertex, depth)| Seed {
            vertex,
            start: bias * (deepest - depth.max(least)),
        })
        .collect()
}

/// Where borders cross the mesh's edges, by the distances of their ends to their own seeds.
pub(super) fn crossings(
    mesh: &ManifoldMesh,
    surface: &Surface,
    labels: &[u32],
    distances: &[f64],
) -> Vec<f32> {
    let mut crossings = vec![0.5_f32; mesh.triangles.len() * 3];
    for h in 0..crossings.len() {
        let t = mesh.triangles[h / 3];
        let (u, v, twin) = (t[h % 3], t[(h % 3 + 1) % 3], mesh.twins[h]);
        if labels[u as usize] == labels[v as usize] || (twin as usize) < h {
            continue;
        }
        let length = surface.length(u, v);
        let at = (distances[v as usize] - distances[u as usize] + length) / (2.0 * length);
        #[expect(clippy::cast_possible_truncation, reason = "a ratio near 0 to 1")]
        let at = if at.is_finite() {
            (at as f32).clamp(0.05, 0.95)
        } else {
            0.5
        };
        crossings[h] = at;
        if twin != NONE {
            crossings[twin as usize] = 1.0 - at;
        }
    }
    crossings
}
