//! What a fit must not do, undone.
//!
//! Points move by half of their shortest edge at most: where the source's points say little, as in tunnels thinner than a
//! cell, the best fit is a spike. Where a triangle has turned over its corners go back to where they were sampled, and so
//! do those of triangles whose largest error has grown above the limit, and all points of a leaf whose RMS error has grown.

use super::system::Corners;
use super::{Fitted, Problem};
use crate::atlas::leaves::Leaf;
use crate::atlas::survey::{MAX_OVER_TARGET, window_of};
use crate::resample::Estimate;
use glam::DVec3;
use rayon::prelude::*;

/// Part of the shortest edge that a point may move.
const TRUST: f64 = 0.5;
/// Rounds of putting points back that harm; then whole leaves.
const ROUNDS: usize = 4;
/// In targets, what a leaf's RMS error may gain, squares added: rounding to the lattice alone adds 0.3.
const SLACK: f64 = 0.4;

/// Puts back what the fit made worse; `before` is every leaf's error as sampled.
pub(super) fn undo_harm(
    problem: &Problem<'_>,
    before: &[Estimate],
    mut positions: Vec<DVec3>,
) -> Fitted {
    hold_back(problem, &mut positions);
    let mut kept = vec![false; positions.len()];
    for round in 0..ROUNDS {
        let found: Vec<Vec<usize>> = problem
            .leaves
            .par_iter()
            .map(|&leaf| {
                let samples = turned(problem, leaf, &positions);
                if samples.is_empty() || round + 1 < ROUNDS {
                    samples
                } else {
                    leaf.range().collect()
                }
            })
            .collect();
        if !put_back(problem, &mut positions, &mut kept, &found) {
            break;
        }
    }
    // Leaves by what they are now; those that a point was put back in are looked at again.
    let mut now: Vec<Option<Estimate>> = vec![None; problem.leaves.len()];
    for round in 0..ROUNDS {
        let stored = problem.stored(&positions);
        let found: Vec<Vec<usize>> = now
            .par_iter_mut()
            .zip(problem.leaves)
            .zip(before)
            .map(|((now, &leaf), before)| {
                if now.is_some() {
                    return Vec::new();
                }
                let (after, spots) = inspect(problem, leaf, &stored, before);
                *now = Some(after);
                let allowed = before.squares + (SLACK * problem.target).powi(2) * before.area;
                if after.squares > allowed || round + 2 >= ROUNDS && !spots.is_empty() {
                    leaf.range().collect()
                } else {
                    spots
                }
            })
            .collect();
        if round + 1 == ROUNDS || !put_back(problem, &mut positions, &mut kept, &found) {
            break;
        }
        let touched = touched(problem, &kept, &found);
        for (now, touched) in now.iter_mut().zip(touched) {
            if touched {
                *now = None;
            }
        }
    }
    let squares = now.iter().flatten().map(|now| now.squares).sum();
    Fitted {
        positions: problem.stored(&positions),
        squares,
        kept: kept.iter().filter(|&&kept| kept).count() as u64,
    }
}

/// Puts the points of samples back; whether any had moved.
fn put_back(
    problem: &Problem<'_>,
    positions: &mut [DVec3],
    kept: &mut [bool],
    samples: &[Vec<usize>],
) -> bool {
    let mut any = false;
    for &sample in samples.iter().flatten() {
        let between = problem.points.of_sample[sample];
        for point in [between.0 as usize, between.1 as usize] {
            if !kept[point] && !problem.points.open[point] {
                any = true;
                kept[point] = true;
                positions[point] = problem.sampled[point];
            }
        }
    }
    any
}

/// By leaf, whether one of its points is among those just put back.
fn touched(problem: &Problem<'_>, kept: &[bool], samples: &[Vec<usize>]) -> Vec<bool> {
    let mut back = vec![false; kept.len()];
    for &sample in samples.iter().flatten() {
        let between = problem.points.of_sample[sample];
        back[between.0 as usize] = true;
        back[between.1 as usize] = true;
    }
    let of_leaf = |leaf: &Leaf| {
        problem.points.of_sample[leaf.range()]
            .iter()
            .any(|between| back[between.0 as usize] || back[between.1 as usize])
    };
    problem.leaves.par_iter().map(of_leaf).collect()
}

/// Shortens moves to the trust region.
fn hold_back(problem: &Problem<'_>, positions: &mut [DVec3]) {
    let edges: Vec<Vec<f64>> = problem
        .leaves
        .par_iter()
        .map(|&leaf| shortest_edges(&problem.image(leaf, problem.sampled), leaf.cells() + 1))
        .collect();
    let edges: Vec<f64> = edges.into_iter().flatten().collect();
    positions
        .par_iter_mut()
        .enumerate()
        .for_each(|(point, position)| {
            let sampled = problem.sampled[point];
            let edge = problem
                .points
                .samples(point)
                .map(|(sample, _)| edges[sample])
                .fold(f64::INFINITY, f64::min);
            let by = *position - sampled;
            let most = TRUST * edge;
            if !by.is_finite() {
                *position = sampled;
            } else if by.length() > most {
                *position = sampled + by * (most / by.length());
            }
        });
}

/// By sample, the shortest of the edges along rows and columns that meet there.
fn shortest_edges(image: &[DVec3], side: usize) -> Vec<f64> {
    let mut shortest = vec![f64::INFINITY; image.len()];
    for at in 0..image.len() {
        let right = (at % side + 1 < side).then_some(at + 1);
        let above = (at + side < image.len()).then_some(at + side);
        for other in [right, above].into_iter().flatten() {
            let length = image[at].distance(image[other]);
            shortest[at] = shortest[at].min(length);
            shortest[other] = shortest[other].min(length);
        }
    }
    shortest
}

/// Samples at triangles that have turned over.
fn turned(problem: &Problem<'_>, leaf: Leaf, positions: &[DVec3]) -> Vec<usize> {
    let before = problem.image(leaf, problem.sampled);
    let after = problem.image(leaf, positions);
    let side = leaf.cells() + 1;
    let mut found = Vec::new();
    for j in 0..side - 1 {
        for i in 0..side - 1 {
            let a = j * side + i;
            for corners in [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]] {
                let normal = |image: &[DVec3]| {
                    let [p, q, r] = corners.map(|corner| image[corner]);
                    (q - p).cross(r - p)
                };
                if normal(&before).dot(normal(&after)) < 0.0 {
                    found.extend(corners.map(|corner| leaf.first + corner));
                }
            }
        }
    }
    found
}

/// A leaf's error, and the samples around places where it is above both what it was anywhere and the limit.
fn inspect(
    problem: &Problem<'_>,
    leaf: Leaf,
    positions: &[DVec3],
    before: &Estimate,
) -> (Estimate, Vec<usize>) {
    let image = problem.image(leaf, positions);
    let most = before.worst.max(MAX_OVER_TARGET * problem.target);
    let mut estimate = Estimate::default();
    let mut spots = Vec::new();
    let sampler = &problem.samplers[leaf.node.chart.0 as usize];
    sampler.visit_points(window_of(leaf), |point| {
        let Corners { at, weights, .. } = Corners::over(point.place, leaf.cells() + 1);
        let [a, b, c] = at.map(|at| image[at]);
        let gap = a * weights[0] + b * weights[1] + c * weights[2] - point.surface;
        let height = gap.dot(point.normal);
        if height.abs() > most {
            spots.extend(at.map(|at| leaf.first + at));
        }
        estimate.add(point.area, height);
    });
    (estimate, spots)
}
