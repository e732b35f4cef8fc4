//! Normals of the samples of the finest surface.
//!
//! A sample's normal lights a whole cell, so it is the mean of the source's over the cells around it, weighted by area and by a
//! tent that falls to zero at the next samples (the bilinear hat function), not what the source happens to have at one
//! place: a pit of a few triangles would else be a dark spot as wide as two cells. Where cells are hardly larger than triangles the
//! mean would show their facets, and what is between the vertices' normals is taken as it is. Samples of one point share their normal
//! across borders.
//!
//! Triangles around samples that have too few of them are passed over, which saves most of the work where the image is finer than
//! the source.

use super::leaves::{Leaf, Points};
use super::survey::window_of;
use crate::mesh::NONE;
use crate::resample::{Sampler, SourcePoint};
use glam::{DVec2, DVec3, Vec3};
use marquetry_format::octahedral;
use rayon::prelude::*;

/// A mean shorter than this part of what was summed says nothing: folds, and plates seen from both sides.
const CANCELLED: f64 = 0.3;

/// Up to the first number of triangles around a sample the mean counts nothing, from the second on it is all.
const TRIANGLES: [f64; 2] = [12.0, 24.0];

/// Fewer triangles than this at a sample on a leaf's side are passed over: what is summed there over all leaves that share it
/// stays below the first of [`TRIANGLES`].
const ON_A_SIDE: u32 = 3;

/// What boxes are widened by, in cells, against rounding.
const MARGIN: f64 = 1e-6;

/// A sum of normals.
#[derive(Debug, Clone, Copy)]
struct Sum {
    normal: DVec3,
    /// Of the normals' lengths.
    length: f64,
    /// Triangles that they are of.
    triangles: f64,
    /// The last of them.
    last: u32,
}

impl Default for Sum {
    fn default() -> Self {
        Self {
            normal: DVec3::ZERO,
            length: 0.0,
            triangles: 0.0,
            last: NONE,
        }
    }
}

impl Sum {
    /// Adds a point; those of one triangle follow each other.
    fn add(&mut self, point: &SourcePoint, weight: f64) {
        if self.last != point.triangle {
            self.last = point.triangle;
            self.triangles += 1.0;
        }
        self.normal += point.normal * weight;
        self.length += point.normal.length() * weight;
    }

    /// The mean, as long as it counts, 0..=1.
    fn mean(self) -> DVec3 {
        let [none, all] = TRIANGLES;
        let counts = ((self.triangles - none) / (all - none)).clamp(0.0, 1.0);
        if self.normal.length() > CANCELLED * self.length {
            self.normal.normalize_or_zero() * counts
        } else {
            DVec3::ZERO
        }
    }
}

/// The octahedral normals of every leaf's samples.
///
/// `sampled` are the normals at the samples' own places, leaf by leaf.
pub(super) fn filtered(
    samplers: &[Sampler<'_>],
    leaves: &[Leaf],
    points: &Points,
    sampled: &[&[[u8; 2]]],
) -> Vec<Vec<[u8; 2]>> {
    let by_sample: Vec<Sum> = leaves
        .par_iter()
        .flat_map_iter(|&leaf| sums(samplers, leaf))
        .collect();
    let means: Vec<DVec3> = (0..points.len())
        .into_par_iter()
        .map(|point| {
            let mut sum = Sum::default();
            for (sample, part) in points.samples(point) {
                let own = by_sample[sample];
                sum.normal += own.normal * part;
                sum.length += own.length * part;
                sum.triangles += own.triangles;
            }
            sum.mean()
        })
        .collect();
    leaves
        .par_iter()
        .zip(sampled)
        .map(|(leaf, sampled)| {
            points.of_sample[leaf.range()]
                .iter()
                .zip(*sampled)
                .map(|(between, &sampled)| {
                    let mean = between.of(&means).as_vec3();
                    if mean == Vec3::ZERO {
                        return sampled;
                    }
                    let rest = (1.0 - mean.length()).max(0.0);
                    let own = Vec3::from_array(octahedral::decode(sampled)) * rest;
                    octahedral::encode((mean + own).normalize_or(mean).to_array())
                })
                .collect()
        })
        .collect()
}

/// What the source adds to each sample of a leaf.
fn sums(samplers: &[Sampler<'_>], leaf: Leaf) -> Vec<Sum> {
    let cells = leaf.cells();
    let mut sums = vec![Sum::default(); (cells + 1).pow(2)];
    let sampler = &samplers[leaf.node.chart.0 as usize];
    let triangles = crowded(&sampler.boxes(window_of(leaf)), cells);
    sampler.visit_points_of(window_of(leaf), &triangles, |point| {
        let most = (cells - 1) as f64;
        let cell = point.place.floor().clamp(DVec2::ZERO, DVec2::splat(most));
        let within = point.place - cell;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the cells of a leaf"
        )]
        let first = cell.y as usize * (cells + 1) + cell.x as usize;
        for (upper, along_v) in [(0, 1.0 - within.y), (1, within.y)] {
            for (right, along_u) in [(0, 1.0 - within.x), (1, within.x)] {
                let weight = point.area * along_u * along_v;
                sums[first + upper * (cells + 1) + right].add(point, weight);
            }
        }
    });
    sums
}

/// The triangles that add to a sample which may have enough of them, given all that touch a leaf and their boxes.
fn crowded(boxes: &[(u32, [DVec2; 2])], cells: usize) -> Vec<u32> {
    let side = cells + 1;
    // Samples of the cells that a box lies in, first and last, along u and v.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the cells of a leaf; NaN becomes 0"
    )]
    let samples = |[low, high]: [DVec2; 2]| {
        let last = (cells - 1) as f64;
        let first = (low - MARGIN)
            .floor()
            .clamp(DVec2::ZERO, DVec2::splat(last));
        let end = (high + MARGIN)
            .floor()
            .clamp(DVec2::ZERO, DVec2::splat(last));
        [
            [first.x as usize, end.x as usize + 1],
            [first.y as usize, end.y as usize + 1],
        ]
    };
    // Triangles at every sample, from the corners of boxes: sums over all before, along both axes.
    let mut changes = vec![0i32; (side + 1).pow(2)];
    for &(_, bounds) in boxes {
        let [[x0, x1], [y0, y1]] = samples(bounds);
        changes[y0 * (side + 1) + x0] += 1;
        changes[y0 * (side + 1) + x1 + 1] -= 1;
        changes[(y1 + 1) * (side + 1) + x0] -= 1;
        changes[(y1 + 1) * (side + 1) + x1 + 1] += 1;
    }
    sum_up(&mut changes, side + 1);
    // Crowded samples before each, along both axes.
    let mut before = vec![0i32; (side + 1).pow(2)];
    for y in 0..side {
        for x in 0..side {
            let ends = usize::from(x % cells == 0) + usize::from(y % cells == 0);
            let least = [TRIANGLES[0], f64::from(ON_A_SIDE), 1.0][ends];
            let is_crowded = f64::from(changes[y * (side + 1) + x]) >= least;
            before[(y + 1) * (side + 1) + x + 1] = i32::from(is_crowded);
        }
    }
    sum_up(&mut before, side + 1);
    let near_crowd = |bounds: [DVec2; 2]| {
        let [[x0, x1], [y0, y1]] = samples(bounds);
        let at = |x: usize, y: usize| before[y * (side + 1) + x];
        at(x1 + 1, y1 + 1) - at(x0, y1 + 1) - at(x1 + 1, y0) + at(x0, y0) > 0
    };
    boxes
        .iter()
        .filter(|&&(_, bounds)| near_crowd(bounds))
        .map(|&(triangle, _)| triangle)
        .collect()
}

/// Sums of all values before and at each place, along both axes of a square grid.
fn sum_up(values: &mut [i32], side: usize) {
    for at in 0..values.len() {
        let left = if at % side > 0 { values[at - 1] } else { 0 };
        let below = if at >= side { values[at - side] } else { 0 };
        let both = if at % side > 0 && at >= side {
            values[at - side - 1]
        } else {
            0
        };
        values[at] += left + below - both;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atlas::depth::Depth;
    use crate::atlas::leaves::leaves_of;
    use crate::parameterize::Parametrization;
    use crate::parameterize::test_patches::bumpy;
    use crate::resample::Window;

    const CELLS: usize = 48;

    /// Normals of a sheet over the unit square, `resolution` cells a side, where those at the samples' own places are +z.
    fn normals(height: impl Fn(f64, f64) -> f64, resolution: u8) -> Vec<Vec3> {
        let patch = bumpy(CELLS, 0.0, 1, height);
        let uv = patch.positions.iter().map(|p| p.truncate()).collect();
        let parametrization = Parametrization {
            uv,
            flipped: 0,
            stretch: 1.0,
        };
        let leaves = leaves_of(&Depth {
            roots: vec![resolution],
            ..Depth::default()
        });
        let points = Points::new(&[[None; 4]], &leaves);
        let up = vec![octahedral::encode([0.0, 0.0, 1.0]); points.of_sample.len()];
        let samplers = [Sampler::new(&patch, &parametrization)];
        let found = filtered(&samplers, &leaves, &points, &[&up]);
        let vector = |&code: &[u8; 2]| Vec3::from_array(octahedral::decode(code));
        found[0].iter().map(vector).collect()
    }

    #[test]
    fn a_pit_of_a_few_triangles_is_no_dark_spot() {
        // A pit of one vertex, as deep as a triangle is long, exactly at a sample.
        let pit = |x: f64, y: f64| {
            if (x - 0.5).hypot(y - 0.5) < 0.01 {
                -0.02
            } else {
                0.0
            }
        };
        let found = normals(pit, 3);
        let least = found.iter().map(|n| n.z).fold(1.0, f32::min);
        assert!(least > 0.98, "{least}");
    }

    #[test]
    fn a_slope_is_met() {
        let slope = Vec3::new(-0.5, 0.0, 1.0).normalize_or(Vec3::Z);
        for normal in normals(|x, _| 0.5 * x, 3) {
            assert!(normal.dot(slope) > 0.999, "{normal}");
        }
    }

    #[test]
    fn cells_smaller_than_triangles_keep_what_was_sampled() {
        for normal in normals(|x, _| 0.5 * x, 7) {
            assert!(normal.z > 0.999, "{normal}");
        }
    }

    #[test]
    fn triangles_around_samples_with_too_few_of_them_are_passed_over() {
        let patch = bumpy(CELLS, 0.0, 1, |_, _| 0.0);
        let uv = patch.positions.iter().map(|p| p.truncate()).collect();
        let parametrization = Parametrization {
            uv,
            flipped: 0,
            stretch: 1.0,
        };
        let sampler = Sampler::new(&patch, &parametrization);
        let crowded = |resolution: u8| {
            let boxes = sampler.boxes(Window::whole(resolution));
            assert_eq!(boxes.len(), patch.triangles.len());
            crowded(&boxes, 1 << resolution)
        };
        // 18 triangles a cell, then a third of one; on the sides there may be enough together with the neighbour's.
        assert_eq!(crowded(4).len(), patch.triangles.len());
        assert!(crowded(7).len() < patch.triangles.len() / 5);
    }
}
