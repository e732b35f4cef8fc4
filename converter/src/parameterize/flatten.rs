//! A triangulated disk onto any convex polygon, given where its border goes.

use super::edges::Edges;
use super::tutte::{self, System};
use glam::{DVec2, DVec3};

/// Which weights a flattening uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weights {
    /// Clamped cotangents: little distortion.
    Cotangent,
    /// All one: no flips but by rounding.
    Uniform,
}

/// Positions of all vertices: `fixed` ones as given, each other the weighted mean of its neighbours (Tutte 1963).
pub(crate) fn flatten(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    fixed: &[Option<DVec2>],
    weights: Weights,
) -> Vec<DVec2> {
    let edges = Edges::of(triangles);
    let values = match weights {
        Weights::Cotangent => tutte::cotangent_weights(positions, triangles, &edges),
        Weights::Uniform => tutte::uniform_weights(&edges),
    };
    let on_side: Vec<bool> = fixed.iter().map(Option::is_some).collect();
    let mut uv: Vec<DVec2> = fixed.iter().map(|p| p.unwrap_or(DVec2::ZERO)).collect();
    let mut system = System::of(&edges, &on_side);
    system.solve(&edges, &values, &mut uv);
    system.refine(&edges, &values, &mut uv);
    uv
}
