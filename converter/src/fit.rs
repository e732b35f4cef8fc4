//! Moves samples so that the surface between them is as near to the source as it can be.
//!
//! Samples that lie on a curved surface leave the surface between them on one side of it; a least-squares fit has half the
//! error or less with the same triangles (Hoppe et al., "Mesh Optimization", 1993, fit vertices in this way). The points of all
//! leaves, those on shared borders once, are the unknowns of one sparse system: the squared distances of the source's points
//! to their tangent planes (Chen and Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), plus a small
//! part of the squared distances to the points themselves, which keeps samples from drifting along flat parts ([`system`]);
//! conjugate gradients solve it ([`conjugate`]).
//!
//! What must not happen is undone ([`guard`]): no point moves farther than half an edge, no triangle turns over, no leaf
//! gets worse. Points on open borders stay where they are.
//!
//! Limits: the correspondence of points and image is that of (u, v) and is not updated; triangles on borders beside coarser
//! leaves are taken to end in the middle of the coarser edges.

mod conjugate;
mod guard;
mod system;
#[cfg(test)]
mod tests;

use crate::atlas::leaves::{Leaf, Points};
use crate::resample::Sampler;
use glam::DVec3;
use rayon::prelude::*;

/// The leaves' images and what they are to fit.
pub(crate) struct Problem<'a> {
    /// By chart.
    pub(crate) samplers: &'a [Sampler<'a>],
    /// All leaves.
    pub(crate) leaves: &'a [Leaf],
    /// How their samples are joined.
    pub(crate) points: &'a Points,
    /// Sampled positions, by point.
    pub(crate) sampled: &'a [DVec3],
    /// Target RMS error, a length.
    pub(crate) target: f64,
    /// From a position to what is stored of it.
    pub(crate) stored: &'a (dyn Fn(DVec3) -> DVec3 + Sync),
}

/// What a fit did.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fitted {
    /// Positions by point, as they are stored.
    pub(crate) positions: Vec<DVec3>,
    /// Integral of the squared error over the source's area.
    pub(crate) squares: f64,
    /// Points that were put back to where they were sampled.
    pub(crate) kept: u64,
}

/// Positions of the points that fit the source best.
pub(crate) fn fit(problem: &Problem<'_>) -> Fitted {
    let system = system::System::new(problem);
    let (moves, _) = conjugate::solve(&system);
    let positions: Vec<DVec3> = problem
        .sampled
        .par_iter()
        .zip(&moves)
        .map(|(&sampled, &by)| sampled + by)
        .collect();
    guard::undo_harm(problem, system.before(), positions)
}

impl Problem<'_> {
    /// Values at a leaf's samples, given those at the points.
    pub(crate) fn image(&self, leaf: Leaf, values: &[DVec3]) -> Vec<DVec3> {
        self.points.of_sample[leaf.range()]
            .iter()
            .map(|between| between.of(values))
            .collect()
    }

    /// The points' positions as they are stored.
    fn stored(&self, positions: &[DVec3]) -> Vec<DVec3> {
        positions
            .par_iter()
            .map(|&position| (self.stored)(position))
            .collect()
    }
}
