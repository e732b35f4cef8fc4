//! Conjugate gradients (Hestenes and Stiefel, 1952), preconditioned point by point.
//!
//! The system is close to a mass matrix, whose condition does not grow with its size: some twenty iterations do, whatever
//! the number of unknowns. Sums are grouped by place, not by thread.

use super::system::System;
use glam::DVec3;
use rayon::prelude::*;

/// Iterations at most.
const ITERATIONS: u32 = 30;
/// Part of the residual's norm, as the preconditioner sees it, that may be left.
const TOLERANCE: f64 = 3e-3;
/// Terms of a sum that are added up at once.
const GROUP: usize = 4096;

/// The moves that solve the system, and the iterations it took.
pub(super) fn solve(system: &System<'_>) -> (Vec<DVec3>, u32) {
    let mut moves = vec![DVec3::ZERO; system.right_hand().len()];
    let mut residual = system.right_hand().to_vec();
    let mut preconditioned = system.precondition(&residual);
    let mut direction = preconditioned.clone();
    let mut norm = dot(&residual, &preconditioned);
    let enough = norm * TOLERANCE * TOLERANCE;
    let mut iterations = 0;
    while iterations < ITERATIONS && norm > enough {
        let applied = system.apply(&direction);
        let curvature = dot(&direction, &applied);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let step = norm / curvature;
        add(&mut moves, step, &direction);
        add(&mut residual, -step, &applied);
        preconditioned = system.precondition(&residual);
        let next = dot(&residual, &preconditioned);
        let ratio = next / norm;
        norm = next;
        direction
            .par_iter_mut()
            .zip(&preconditioned)
            .for_each(|(direction, &p)| *direction = p + *direction * ratio);
        iterations += 1;
    }
    (moves, iterations)
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(GROUP)
        .zip(b.par_chunks(GROUP))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum())
        .collect();
    parts.iter().sum()
}

fn add(to: &mut [DVec3], factor: f64, what: &[DVec3]) {
    to.par_iter_mut()
        .zip(what)
        .for_each(|(to, &what)| *to += what * factor);
}
