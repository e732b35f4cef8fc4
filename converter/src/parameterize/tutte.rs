//! Convex-combination maps: the linear system, its weights, its solution.
//!
//! Weights are symmetric and positive, so the matrix is a symmetric positive definite M-matrix. Its pattern is ordered and
//! analysed once and refactorized for every set of weights.

use super::cholesky::Cholesky;
use super::edges::{Edges, NONE};
use glam::{DVec2, DVec3};

/// Bounds of a cotangent weight: an equilateral edge has 0.58. Below the lower one a map is no longer safe from flips
/// by rounding; above the upper one needles glue their ends together.
const COTANGENT_RANGE: [f64; 2] = [0.02, 20.0];

/// Bounds of a weight after any number of reweights: along a deep tube they fall by a constant factor a ring.
const WEIGHT_RANGE: [f64; 2] = [1e-200, 1e6];

/// Rounds of iterative refinement; each gains several digits, and the third changes nothing.
const REFINEMENTS: usize = 3;

/// The mean of the cotangents opposite every edge, clamped.
pub(super) fn cotangent_weights(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    edges: &Edges,
) -> Vec<f64> {
    let mut weights = vec![0.0; edges.ends.len()];
    for (corners, ids) in triangles.iter().zip(&edges.of_triangle) {
        let [a, b, c] = corners.map(|vertex| positions[vertex as usize]);
        let doubled_area = (b - a).cross(c - a).length();
        let half_cotangent = |apex: DVec3, from: DVec3, to: DVec3| {
            let cotangent = 0.5 * (from - apex).dot(to - apex) / doubled_area;
            if cotangent.is_nan() {
                0.0
            } else {
                cotangent.clamp(-COTANGENT_RANGE[1], COTANGENT_RANGE[1])
            }
        };
        weights[ids[0] as usize] += half_cotangent(c, a, b);
        weights[ids[1] as usize] += half_cotangent(a, b, c);
        weights[ids[2] as usize] += half_cotangent(b, c, a);
    }
    for weight in &mut weights {
        *weight = weight.clamp(COTANGENT_RANGE[0], COTANGENT_RANGE[1]);
    }
    weights
}

/// Tutte's weights: 1 for every edge.
pub(super) fn uniform_weights(edges: &Edges) -> Vec<f64> {
    vec![1.0; edges.ends.len()]
}

/// Divides every weight by the stretch at both its ends.
///
/// Yoshizawa et al. divide the weight that pulls i towards j by the stretch at j alone; dividing all of row i by the
/// stretch at i as well changes no solution and keeps the matrix symmetric.
pub(super) fn divide_by_stretch(edges: &Edges, around: &[f64], weights: &mut [f64]) {
    for (weight, &[a, b]) in weights.iter_mut().zip(&edges.ends) {
        let divided = *weight / (around[a as usize] * around[b as usize]);
        *weight = divided.clamp(WEIGHT_RANGE[0], WEIGHT_RANGE[1]);
    }
}

/// The equations of the interior vertices: each is the weighted mean of its neighbours.
#[derive(Debug)]
pub(super) struct System {
    /// Unknown of every vertex, [`NONE`] for those on a side.
    unknown: Vec<u32>,
    /// Where the entry of an edge between two unknowns is kept, else [`NONE`].
    entry: Vec<u32>,
    cholesky: Cholesky,
    right: Vec<DVec2>,
}

impl System {
    pub(super) fn of(edges: &Edges, on_side: &[bool]) -> Self {
        let mut count = 0u32;
        let mut unknown: Vec<u32> = on_side
            .iter()
            .map(|&fixed| {
                if fixed {
                    return NONE;
                }
                count += 1;
                count - 1
            })
            .collect();
        let mut pairs = Vec::with_capacity(edges.ends.len());
        let mut entry = vec![NONE; edges.ends.len()];
        for (slot, &[a, b]) in entry.iter_mut().zip(&edges.ends) {
            let (a, b) = (unknown[a as usize], unknown[b as usize]);
            if a != NONE && b != NONE {
                *slot = 0;
                pairs.push([a, b]);
            }
        }
        let (cholesky, order, slots) = Cholesky::analyse(count, &pairs);
        for (slot, place) in entry.iter_mut().filter(|slot| **slot != NONE).zip(slots) {
            *slot = place;
        }
        for id in unknown.iter_mut().filter(|id| **id != NONE) {
            *id = order[*id as usize];
        }
        Self {
            unknown,
            entry,
            cholesky,
            right: vec![DVec2::ZERO; count as usize],
        }
    }

    /// Moves the unknowns of `uv` to their solution; the others are given.
    pub(super) fn solve(&mut self, edges: &Edges, weights: &[f64], uv: &mut [DVec2]) {
        self.cholesky.clear();
        self.right.fill(DVec2::ZERO);
        for ((&[a, b], &weight), &entry) in edges.ends.iter().zip(weights).zip(&self.entry) {
            let (ua, ub) = (self.unknown[a as usize], self.unknown[b as usize]);
            if ua != NONE {
                self.cholesky.add_diagonal(ua, weight);
                if ub == NONE {
                    self.right[ua as usize] += weight * uv[b as usize];
                }
            }
            if ub != NONE {
                self.cholesky.add_diagonal(ub, weight);
                if ua == NONE {
                    self.right[ub as usize] += weight * uv[a as usize];
                }
            }
            if entry != NONE {
                self.cholesky.set(entry, -weight);
            }
        }
        self.cholesky.factorize();
        self.cholesky.solve(&mut self.right);
        for (place, &id) in uv.iter_mut().zip(&self.unknown) {
            if id != NONE {
                *place = self.right[id as usize];
            }
        }
    }

    /// Improves a solution of the weights last solved for; residuals are sums of differences, so they keep their digits.
    pub(super) fn refine(&mut self, edges: &Edges, weights: &[f64], uv: &mut [DVec2]) {
        for _ in 0..REFINEMENTS {
            self.right.fill(DVec2::ZERO);
            for (&[a, b], &weight) in edges.ends.iter().zip(weights) {
                let pull = weight * (uv[b as usize] - uv[a as usize]);
                let (ua, ub) = (self.unknown[a as usize], self.unknown[b as usize]);
                if ua != NONE {
                    self.right[ua as usize] += pull;
                }
                if ub != NONE {
                    self.right[ub as usize] -= pull;
                }
            }
            self.cholesky.solve(&mut self.right);
            for (place, &id) in uv.iter_mut().zip(&self.unknown) {
                if id != NONE {
                    *place += self.right[id as usize];
                }
            }
        }
    }
}
