//! Where a surface lies, and how well it is to be shown.

use crate::atlas::quantize;
use crate::atlas::survey::MAX_OVER_TARGET;
use crate::mesh::decimate::Decimated;
use crate::mesh::{ManifoldMesh, bounds};
use glam::DVec3;
use marquetry_format::Lattice;
use std::collections::HashSet;

/// Units of the lattice from which on an edge is long.
const LONG: f64 = 16.0;

/// Where a surface lies, and how well it is to be shown.
pub(super) struct Frame {
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    /// Of the bounds.
    pub(super) diagonal: f64,
    /// RMS error wanted, as a length; without what decimation took of it.
    pub(super) target: f64,
    pub(super) lattice: Lattice,
    pub(super) has_colours: bool,
    /// How the surface came from the import.
    pub(super) decimated: Decimated,
}

impl Frame {
    pub(super) fn of(
        mesh: &ManifoldMesh,
        error_rel: f64,
        has_colours: bool,
        decimated: Decimated,
        without_charts: bool,
    ) -> Self {
        let (min, max) = bounds(&mesh.positions);
        let diagonal = (max - min).length();
        // Squares of what decimation and sampling do add up where they have nothing to do with each other; a bit more is left for
        // where they do, as a fit follows what decimation left.
        let counted = if without_charts { 1.0 } else { 2.0 };
        let target = (error_rel * diagonal).powi(2) - counted * decimated.rms.powi(2);
        let target = target.max(0.0).sqrt();
        Self {
            min,
            max,
            diagonal,
            target,
            // Decimation does not ask for more bits.
            lattice: quantize::lattice(min, max, error_rel * diagonal),
            has_colours,
            decimated,
        }
    }

    /// Whether most of `mesh` is thinner than the lattice tells, but long: triangles, by their longest edges, of which two corners become one and that
    /// no other triangle's corners hold. Clusters leave these out, which shortens the surface; charts keep them.
    pub(super) fn is_thread(&self, mesh: &ManifoldMesh) -> bool {
        let rounded = |t: &[u32; 3]| {
            t.map(|v| quantize::lattice_from_world(&self.lattice, mesh.positions[v as usize]))
        };
        let is_flat = |[a, b, c]: [[u32; 3]; 3]| a == b || b == c || c == a;
        let unit = unit(&self.lattice);
        let (mut all, mut flat) = (0.0, Vec::new());
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            all += longest;
            let corners = rounded(t);
            if longest > LONG * unit && is_flat(corners) {
                flat.push((longest, corners));
            }
        }
        let half_of_all = |lengths: f64| 2.0 * lengths > all;
        if !half_of_all(flat.iter().map(|(longest, _)| longest).sum()) {
            return false;
        }
        let others = mesh.triangles.iter().map(rounded);
        let held: HashSet<[u32; 3]> = others.filter(|&t| !is_flat(t)).flatten().collect();
        let is_held = |corners: &[[u32; 3]; 3]| corners.iter().all(|corner| held.contains(corner));
        let alone = flat.iter().filter(|(_, corners)| !is_held(corners));
        half_of_all(alone.map(|(longest, _)| longest).sum())
    }

    /// RMS error that leaves of clusters may have, a length, where `aim` is the part of the target that they are to keep: rounding to the
    /// lattice takes some of it.
    pub(super) fn trimmed_rms(&self, aim: f64) -> f64 {
        let unit = unit(&self.lattice);
        let rounding = unit.powi(2) / 12.0;
        ((aim * self.target).powi(2) - rounding).max(0.0).sqrt()
    }

    /// Bound of the distance that leaves of clusters may have, a length.
    pub(super) fn most_distance(&self) -> f64 {
        // What decimation did is part of what is found.
        let part = if self.decimated.triangles > 0 {
            0.5
        } else {
            1.0
        };
        part * MAX_OVER_TARGET * self.target + self.decimated.bound
    }
}

/// Length that coordinates on a lattice are multiples of.
fn unit(lattice: &Lattice) -> f64 {
    lattice.step * f64::from(1u32 << lattice.shift)
}

/// RMS distance that rounding to a lattice gives a surface of triangles longer than its steps, a length: each corner has a twelfth of the squared step along the
/// normal, and what lies between half of that.
pub(super) fn rounding(lattice: &Lattice) -> f64 {
    unit(lattice) / 24.0_f64.sqrt()
}
