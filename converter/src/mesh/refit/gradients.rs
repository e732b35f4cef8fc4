//! Conjugate gradients (Hestenes & Stiefel, 1952), for a vector at each vertex.

use glam::DVec3;

/// Steps, at most, and the part of the residual that is left at the last.
const STEPS: u32 = 20;
const LEFT: f64 = 1e-3;

/// What `apply`, which is symmetric and positive definite, makes `wanted` of; `preconditioned` is about its inverse.
pub(super) fn solve(
    wanted: &[DVec3],
    preconditioned: impl Fn(&[DVec3]) -> Vec<DVec3>,
    apply: impl Fn(&[DVec3], &mut [DVec3]),
) -> Vec<DVec3> {
    let mut found = vec![DVec3::ZERO; wanted.len()];
    let mut residual = wanted.to_vec();
    let mut way = preconditioned(&residual);
    let mut square = dot(&residual, &way);
    let enough = LEFT * LEFT * square;
    let mut applied = vec![DVec3::ZERO; found.len()];
    for _ in 0..STEPS {
        if square <= enough || square <= 0.0 {
            break;
        }
        apply(&way, &mut applied);
        let length = square / dot(&way, &applied);
        for v in 0..found.len() {
            found[v] += length * way[v];
            residual[v] -= length * applied[v];
        }
        let next = preconditioned(&residual);
        let next_square = dot(&residual, &next);
        for (way, next) in way.iter_mut().zip(next) {
            *way = next + *way * (next_square / square);
        }
        square = next_square;
    }
    found
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
