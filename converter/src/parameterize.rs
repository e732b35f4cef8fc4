//! Patches onto the unit square.
//!
//! A convex-combination map with positive weights onto a convex boundary is one to one (Tutte 1963; Floater,
//! "One-to-one piecewise linear mappings over triangulations", 2003), provided that no interior edge joins two vertices
//! of one side: such chords are split first. Weights start as clamped cotangents (Pinkall & Polthier 1993) and are then
//! divided by the stretch around their ends (Yoshizawa, Belyaev & Seidel, "A fast and simple stretch-minimizing mesh
//! parametrization", 2004); the best of the maps by L² stretch (Sander et al. 2001) is kept.
//!
//! What the theorem promises of real numbers is checked on the rounded ones: every face is certified by an exact
//! predicate. Where no map from cotangents passes, reweighted or not, uniform weights are the next start, and then uniform
//! weights with iterative refinement.
//!
//! Limits: the shapes of the sides are the borders', so a very uneven border stretches the map whatever the weights. Deep
//! protrusions shrink exponentially in (u, v); reweighting spreads them again, but where it does not suffice
//! [`Parametrization::flipped`] says so.

mod branches;
mod certify;
mod cholesky;
mod chords;
mod dissection;
mod edges;
mod flatten;
mod stretch;
#[cfg(test)]
pub(crate) mod test_patches;
#[cfg(test)]
mod tests;
mod tutte;

use crate::atlas::patch::{Border, Patch};
use glam::DVec2;

pub(crate) use certify::orientation;
pub(crate) use edges::Edges;
pub(crate) use flatten::{Flat, Weights, flatten};

/// Stretch reweights tried; later ones rarely gain a percent and can start to oscillate.
const REWEIGHTS: usize = 3;

/// Reweights while the stretch is above [`POOR_STRETCH`]: there each still gains much.
const REWEIGHTS_IF_POOR: usize = 16;

/// A stretch that more reweights are spent on.
const POOR_STRETCH: f64 = 2.0;

/// A stretch that tells of a protrusion shrunk beyond what reweighting can mend.
const LOST_STRETCH: f64 = 20.0;

/// Reweights tried to save a map with flipped faces. Along a tube each lowers the exponent of its shrinking to 0.41 of
/// what it was, as far as digits reach.
const RESCUES: usize = 6;

/// A reweight that gains less than this fraction of the stretch is the last one.
const WORTHWHILE_GAIN: f64 = 2e-3;

/// How a patch lies on the unit square.
#[derive(Debug, Clone, Default)]
pub struct Parametrization {
    /// (u, v) of every vertex of the patch, in [0, 1]²; side vertices lie exactly on their side at their border's parameter.
    pub uv: Vec<DVec2>,
    /// Triangles whose orientation in (u, v) is not strictly positive (exact predicate); 0 when certified.
    pub flipped: u32,
    /// Mean L² stretch, 1 = isometric up to scale; 0 where the patch has no area.
    pub stretch: f64,
}

/// Parametrizes `patch`; may split chords, so vertices and triangles may be added to it.
///
/// Side vertices go to their border's parameters, so two patches that share a border agree on them.
pub fn parameterize(patch: &mut Patch, borders: &[Border]) -> Parametrization {
    let mut edges = Edges::of(&patch.triangles);
    if chords::split(patch, &edges) {
        edges = Edges::of(&patch.triangles);
    }
    let mut uv = vec![DVec2::splat(0.5); patch.positions.len()];
    let on_side = place_sides(patch, borders, &mut uv);
    let metric = stretch::Metric::of(&patch.positions, &patch.triangles);
    let mut best = Best::default();
    if on_side.iter().all(|&on| on) {
        let flipped = certify::count_flipped(&patch.triangles, &uv);
        best.offer(&uv, flipped, metric.stretch(&patch.triangles, &uv));
        return best.take();
    }
    let mut system = tutte::System::of(&edges, &on_side);
    let mut weights = tutte::cotangent_weights(&patch.positions, &patch.triangles, &edges);
    relax(
        patch,
        &edges,
        &mut system,
        &metric,
        &mut weights,
        &mut uv,
        &mut best,
    );
    if best.is_certified() && best.stretch() < LOST_STRETCH {
        return best.take();
    }
    weights = branches::weights(&edges, &on_side);
    relax(
        patch,
        &edges,
        &mut system,
        &metric,
        &mut weights,
        &mut uv,
        &mut best,
    );
    if best.is_certified() {
        return best.take();
    }
    weights = tutte::uniform_weights(&edges);
    system.solve(&edges, &weights, &mut uv);
    system.refine(&edges, &weights, &mut uv);
    let flipped = certify::count_flipped(&patch.triangles, &uv);
    best.offer(&uv, flipped, metric.stretch(&patch.triangles, &uv));
    best.take()
}

/// Solves with `weights`, then with reweighted ones while that helps.
fn relax(
    patch: &Patch,
    edges: &Edges,
    system: &mut tutte::System,
    metric: &stretch::Metric,
    weights: &mut [f64],
    uv: &mut [DVec2],
    best: &mut Best,
) {
    let mut around = Vec::new();
    let (mut rescues, mut rounds) = (0, 0);
    loop {
        system.solve(edges, weights, uv);
        let flipped = certify::count_flipped(&patch.triangles, uv);
        let gains = best.offer(uv, flipped, metric.stretch(&patch.triangles, uv));
        // A reweight spreads what shrank to nothing, so it can also save a map that is not certified yet.
        if best.is_certified() {
            let most = if best.stretch() > POOR_STRETCH {
                REWEIGHTS_IF_POOR
            } else {
                REWEIGHTS
            };
            let lost = best.stretch() > LOST_STRETCH;
            if flipped > 0 || !gains && !lost || rounds >= most {
                return;
            }
            rounds += 1;
        } else {
            if rescues == RESCUES {
                return;
            }
            rescues += 1;
        }
        metric.vertex_stretch(&patch.triangles, uv, &mut around);
        tutte::divide_by_stretch(edges, &around, weights);
    }
}

/// Puts the side vertices on the square's sides; says which vertices these are.
fn place_sides(patch: &Patch, borders: &[Border], uv: &mut [DVec2]) -> Vec<bool> {
    let mut on_side = vec![false; uv.len()];
    for (side, vertices) in patch.sides.iter().enumerate() {
        let (border, forward) = patch.borders[side];
        let params = &borders[border as usize].params;
        for (k, &vertex) in vertices.iter().enumerate() {
            let last = vertices.len() - 1;
            let param = match k {
                0 => f64::from(u8::from(!forward)),
                k if k == last => f64::from(u8::from(forward)),
                k if forward => params[k],
                k => params[last - k],
            };
            // Sides 2 and 3 run down their coordinate, so there a reversed border is not reversed twice.
            let ascends = forward == (side < 2);
            let along = if ascends { param } else { 1.0 - param };
            uv[vertex as usize] = match side {
                0 => DVec2::new(along, 0.0),
                1 => DVec2::new(1.0, along),
                2 => DVec2::new(along, 1.0),
                _ => DVec2::new(0.0, along),
            };
            on_side[vertex as usize] = true;
        }
    }
    on_side
}

/// The best map so far: fewest flips, then least stretch.
#[derive(Default)]
struct Best {
    map: Option<Parametrization>,
}

impl Best {
    /// Keeps the map if it is better; true if it is so by a worthwhile margin.
    fn offer(&mut self, uv: &[DVec2], flipped: u32, stretch: f64) -> bool {
        let Some(best) = &mut self.map else {
            self.map = Some(Parametrization {
                uv: uv.to_vec(),
                flipped,
                stretch,
            });
            return true;
        };
        let better = flipped < best.flipped || (flipped == best.flipped && stretch < best.stretch);
        let worthwhile = flipped < best.flipped || stretch < best.stretch * (1.0 - WORTHWHILE_GAIN);
        if better {
            best.uv.copy_from_slice(uv);
            best.flipped = flipped;
            best.stretch = stretch;
        }
        better && worthwhile
    }

    fn is_certified(&self) -> bool {
        self.map.as_ref().is_some_and(|map| map.flipped == 0)
    }

    fn stretch(&self) -> f64 {
        self.map.as_ref().map_or(f64::INFINITY, |map| map.stretch)
    }

    fn take(self) -> Parametrization {
        self.map.unwrap_or_default()
    }
}
