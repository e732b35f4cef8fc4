//! A triangulated disk onto any convex polygon, given where its border goes.

use super::branches;
use super::edges::Edges;
use super::stretch::Metric;
use super::tutte::{self, System};
use glam::{DVec2, DVec3};

/// Which weights a flattening starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weights {
    /// Clamped cotangents, then divided by the stretch around their ends so many times, and where a protrusion stays
    /// shrunk up to the second number of times.
    Stretch(u32, u32),
    /// All one: no flips but by rounding.
    Uniform,
}

/// A flattened disk.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flat {
    /// Positions of all vertices.
    pub(crate) uv: Vec<DVec2>,
    /// Where the flattening has shrunk the surface most: an inner vertex, and how much wider its surroundings were
    /// in an isometry of the whole. `None` without inner vertices, or where nobody asked for stretch.
    pub(crate) tip: Option<(u32, f64)>,
    /// Part of the surface's area, 0..=1, that stays shrunk by more than [`LOST`].
    pub(crate) lost: f64,
}

/// What reweighting goes on for: shrinking by more than this (a length) loses detail.
const SHRUNK: f64 = 8.0;

/// Shrinking from which rounding hides what to reweight.
const LOST: f64 = 1e3;

/// Flattens: `fixed` vertices go as given, each other is the weighted mean of its neighbours (Tutte 1963).
pub(crate) fn flatten(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    fixed: &[Option<DVec2>],
    weights: Weights,
) -> Flat {
    let edges = Edges::of(triangles);
    let (mut values, reweights, most) = match weights {
        Weights::Stretch(reweights, most) => (
            tutte::cotangent_weights(positions, triangles, &edges),
            reweights,
            most,
        ),
        Weights::Uniform => (tutte::uniform_weights(&edges), 0, 0),
    };
    let on_side: Vec<bool> = fixed.iter().map(Option::is_some).collect();
    let mut uv: Vec<DVec2> = fixed.iter().map(|p| p.unwrap_or(DVec2::ZERO)).collect();
    let mut system = System::of(&edges, &on_side);
    let mut tip = None;
    let mut lost = 0.0;
    let mut is_solved = false;
    if most > 0 {
        let metric = Metric::of(positions, triangles);
        let mut around = Vec::new();
        for round in 0..most {
            system.solve(&edges, &values, &mut uv);
            metric.vertex_stretch(triangles, &uv, &mut around);
            tip = (0u32..)
                .zip(&around)
                .zip(&on_side)
                .filter(|&(_, &on_side)| !on_side)
                .map(|((v, &stretch), _)| (v, stretch))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            lost = metric.part(triangles, |v| around[v as usize] > LOST);
            if round >= reweights && tip.is_none_or(|(_, stretch)| stretch < SHRUNK) {
                is_solved = true;
                break;
            }
            if round == 0 && tip.is_some_and(|(_, stretch)| stretch > LOST) {
                values = branches::weights(&edges, &on_side);
            } else {
                tutte::divide_by_stretch(&edges, &around, &mut values);
            }
        }
    }
    if !is_solved {
        system.solve(&edges, &values, &mut uv);
    }
    system.refine(&edges, &values, &mut uv);
    Flat { uv, tip, lost }
}
