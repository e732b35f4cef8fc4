//! Points spread evenly over the area of a mesh.
//!
//! The triangles' areas are laid end to end and cut into equal strata, one sample each at a place drawn from a
//! counter: neighbours in the triangle order give neighbours in the sample order, and any range of samples can
//! be made by itself.

use super::Mesh;
use glam::DVec3;
use std::ops::Range;

/// Chosen once, so that reports can be compared with one another.
const SEED: u64 = 0x6d61_7271_7565_7472;

/// Sizes laid end to end and cut into equal strata, one sample each.
pub(super) struct Strata {
    /// Size up to the end of each piece.
    to: Vec<f64>,
    samples: u64,
}

impl Strata {
    /// Of pieces of these sizes.
    pub(super) fn new(sizes: impl Iterator<Item = f64>, samples: u64) -> Self {
        let mut all = 0.0;
        let up_to = |size: f64| {
            all += size;
            all
        };
        Self {
            to: sizes.map(up_to).collect(),
            samples,
        }
    }

    /// Samples there are; none where nothing has a size.
    pub(super) fn len(&self) -> usize {
        match self.to.last() {
            Some(&all) if all > 0.0 && all.is_finite() => {
                usize::try_from(self.samples).unwrap_or(usize::MAX)
            }
            _ => 0,
        }
    }

    /// Calls `visit` with the piece of each sample of `range`, and the first of two counters to draw its place from.
    pub(super) fn for_each(&self, range: Range<usize>, mut visit: impl FnMut(usize, u64)) {
        let total = self.to.last().copied().unwrap_or(0.0);
        let mut piece = usize::MAX;
        for sample in range {
            let counter = sample as u64 * 3;
            let place = (sample as f64 + unit(counter)) / self.samples as f64 * total;
            if piece == usize::MAX {
                piece = self.to.partition_point(|&to| to <= place);
            }
            // Strictly greater, so a piece without size is never sampled.
            while piece < self.to.len() && self.to[piece] <= place {
                piece += 1;
            }
            if piece >= self.to.len() {
                // Rounding carried the sample past the end: the last piece with a size holds the end.
                piece = self.to.partition_point(|&to| to < total);
            }
            visit(piece, counter + 1);
        }
    }
}

/// Area-stratified samples of a mesh.
pub(super) struct AreaSampler<'a> {
    mesh: Mesh<'a>,
    strata: Strata,
}

impl<'a> AreaSampler<'a> {
    /// Indices of `mesh` must be in range.
    pub(super) fn new(mesh: Mesh<'a>, samples: u64) -> Self {
        let areas = (0..mesh.triangles.len()).map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            0.5 * (b - a).cross(c - a).length()
        });
        Self {
            mesh,
            strata: Strata::new(areas, samples),
        }
    }

    /// Samples there are; none on a mesh without area.
    pub(super) fn len(&self) -> usize {
        self.strata.len()
    }

    /// Calls `visit` with the triangle and the place of each sample of `range`.
    pub(super) fn for_each(&self, range: Range<usize>, mut visit: impl FnMut(usize, DVec3)) {
        self.strata.for_each(range, |triangle, counter| {
            let [a, b, c] = self.mesh.corners(triangle);
            let (mut u, mut v) = (unit(counter), unit(counter + 1));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            visit(triangle, a + (b - a) * u + (c - a) * v);
        });
    }
}

/// A number in [0, 1) that depends on `counter` alone (`SplitMix64`: Steele, Lea & Flood, 2014).
pub(super) fn unit(counter: u64) -> f64 {
    let mut z = counter
        .wrapping_add(1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(SEED);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::closest_point;

    fn two_triangles() -> ([DVec3; 6], [[u32; 3]; 3]) {
        // Areas 0.5, 0, 1.5.
        let p = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::new(10.0, 0.0, 0.0),
            DVec3::new(13.0, 0.0, 0.0),
            DVec3::new(10.0, 1.0, 0.0),
        ];
        (p, [[0, 1, 2], [0, 0, 1], [3, 4, 5]])
    }

    #[test]
    fn samples_fall_on_triangles_in_proportion_to_area() {
        let (positions, triangles) = two_triangles();
        let mesh = Mesh {
            positions: &positions,
            triangles: &triangles,
        };
        let sampler = AreaSampler::new(mesh, 1000);
        let mut counts = [0; 3];
        sampler.for_each(0..sampler.len(), |triangle, point| {
            counts[triangle] += 1;
            assert!(closest_point(mesh.corners(triangle), point).distance(point) < 1e-12);
        });
        assert_eq!(counts, [250, 0, 750]);
    }

    #[test]
    fn any_range_gives_the_same_samples() {
        let (positions, triangles) = two_triangles();
        let sampler = AreaSampler::new(
            Mesh {
                positions: &positions,
                triangles: &triangles,
            },
            100,
        );
        let mut whole = Vec::new();
        sampler.for_each(0..100, |triangle, point| whole.push((triangle, point)));
        let mut parts = Vec::new();
        for start in (0..100).step_by(7) {
            sampler.for_each(start..(start + 7).min(100), |triangle, point| {
                parts.push((triangle, point));
            });
        }
        assert_eq!(whole, parts);
    }

    #[test]
    fn mesh_without_area_has_no_samples() {
        let positions = [DVec3::ONE; 3];
        let sampler = AreaSampler::new(
            Mesh {
                positions: &positions,
                triangles: &[[0, 1, 2]],
            },
            10,
        );
        assert_eq!(sampler.len(), 0);
    }
}
