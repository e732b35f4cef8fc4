//! Voronoi cells of seed vertices, and the seeds that make regions round.
//!
//! Lloyd's iteration on a graph: distances are shortest paths along mesh edges (Dijkstra), cells are connected because
//! they are made of path trees. Limit: path lengths exceed geodesic ones by up to 15 % on regular grids.

use super::complex::id;
use super::surface::Surface;
use crate::mesh::{ManifoldMesh, NONE};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

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
        let mut front = BinaryHeap::new();
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
            front.push(Reverse((start.to_bits(), seed)));
        }
        spread(surface, &mut front, &mut self.distances, |from, to| {
            let label = self.labels[from as usize];
            let old = std::mem::replace(&mut self.labels[to as usize], label);
            if let Some(touched) = self.touched.get_mut(old as usize) {
                *touched = true;
            }
            true
        });
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

/// Dijkstra from what is in `front` (non-negative distances as bits, which order alike). `allow` is told of every step
/// that would shorten a distance, and may refuse it.
fn spread(
    surface: &Surface,
    front: &mut BinaryHeap<Reverse<(u64, u32)>>,
    distances: &mut [f64],
    mut allow: impl FnMut(u32, u32) -> bool,
) {
    while let Some(Reverse((bits, v))) = front.pop() {
        let distance = f64::from_bits(bits);
        if distance > distances[v as usize] {
            continue;
        }
        for &w in surface.neighbours(v) {
            let through = distance + surface.length(v, w);
            if through < distances[w as usize] && allow(v, w) {
                distances[w as usize] = through;
                front.push(Reverse((through.to_bits(), w)));
            }
        }
    }
}

/// Distance of every vertex, inside its region, to the region's border and to open borders.
pub(super) fn depths(surface: &Surface, labels: &[u32]) -> Vec<f64> {
    let mut depths = vec![f64::INFINITY; labels.len()];
    let mut front = BinaryHeap::new();
    for v in surface.components.iter().flatten().copied() {
        let label = labels[v as usize];
        let at_border = surface.loop_of[v as usize] != NONE
            || surface
                .neighbours(v)
                .iter()
                .any(|&w| labels[w as usize] != label);
        if at_border {
            depths[v as usize] = 0.0;
            front.push(Reverse((0, v)));
        }
    }
    spread(surface, &mut front, &mut depths, |from, to| {
        labels[from as usize] == labels[to as usize]
    });
    depths
}

/// Lengths of shortest paths from `starts` that stay in one region; infinite in regions without a start.
pub(super) fn within(surface: &Surface, labels: &[u32], starts: &[u32]) -> Vec<f64> {
    let mut distances = vec![f64::INFINITY; labels.len()];
    let mut front = BinaryHeap::new();
    for &start in starts {
        distances[start as usize] = 0.0;
        front.push(Reverse((0, start)));
    }
    spread(surface, &mut front, &mut distances, |from, to| {
        labels[from as usize] == labels[to as usize]
    });
    distances
}

/// A seed for each region: far from its border, yet near its centroid. With `bias` 1 distances begin at the rim of the
/// circle that fits into the region, so that cells keep their sizes; with 0 all begin alike.
pub(super) fn centres(surface: &Surface, labels: &[u32], regions: u32, bias: f64) -> Vec<Seed> {
    let mut means = vec![super::contract::Cell::default(); regions as usize];
    let depths = depths(surface, labels);
    let members = || surface.components.iter().flatten().copied();
    for v in members() {
        let label = labels[v as usize];
        let mean = &mut means[label as usize];
        *mean = if mean.area > 0.0 {
            mean.merged(surface.cells[v as usize])
        } else {
            surface.cells[v as usize]
        };
    }
    let mut best = vec![(f64::NEG_INFINITY, NONE); regions as usize];
    for v in members() {
        let label = labels[v as usize] as usize;
        // A lone centroid may lie nearest to the wrong side of a finger; depth alone says nothing along a strip.
        let score = depths[v as usize]
            - 0.5
                * surface.cells[v as usize]
                    .centroid
                    .distance(means[label].centroid);
        if score > best[label].0 || best[label].1 == NONE {
            best[label] = (score, v);
        }
    }
    let seeds = best.into_iter().map(|(_, v)| v).filter(|&v| v != NONE);
    let deepest = seeds
        .clone()
        .map(|v| depths[v as usize])
        .fold(0.0, f64::max);
    seeds
        .map(|vertex| Seed {
            vertex,
            start: bias * (deepest - depths[vertex as usize]),
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
