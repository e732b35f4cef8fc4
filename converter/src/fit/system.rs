//! The normal equations of the fit, leaf by leaf.
//!
//! A point of the source lies over one triangle of the image, so it couples that triangle's three corners: with itself and
//! with its neighbours to the right, above and across the diagonal a sample has four symmetric 3 × 3 blocks. Leaves are
//! assembled and multiplied by themselves; points sum over their samples.

use super::Problem;
use crate::atlas::leaves::{Leaf, Points};
use crate::atlas::survey::window_of;
use crate::resample::Estimate;
use glam::DVec3;
use rayon::prelude::*;

/// Weight of the distance to the source's point itself, beside that to its tangent plane.
const POINT_TO_POINT: f64 = 0.02;
/// A sample that hardly any source lies around stays: its diagonal is raised by this, in mean weights of a sample.
const DAMPING: f64 = 1e-3;

/// A symmetric 3 × 3 block: xx, xy, xz, yy, yz, zz.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Block([f32; 6]);

impl Block {
    fn add(&mut self, factor: f64, terms: [f64; 6]) {
        for (own, term) in self.0.iter_mut().zip(terms) {
            *own += narrow(factor * term);
        }
    }

    fn times(&self, v: DVec3) -> DVec3 {
        let [xx, xy, xz, yy, yz, zz] = self.0.map(f64::from);
        DVec3::new(
            xx * v.x + xy * v.y + xz * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z,
        )
    }

    fn sum(self, other: Self, factor: f64) -> Self {
        let mut sum = self;
        sum.add(factor, other.0.map(f64::from));
        sum
    }

    /// The inverse, or zero where there is none.
    fn inverse(self) -> Self {
        let [xx, xy, xz, yy, yz, zz] = self.0.map(f64::from);
        let (a, b, c) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * a + xy * b + xz * c;
        if determinant.is_nan() || determinant <= 0.0 {
            return Self::default();
        }
        let mut inverse = Self::default();
        inverse.add(
            1.0 / determinant,
            [
                a,
                b,
                c,
                xx * zz - xz * xz,
                xy * xz - xx * yz,
                xx * yy - xy * xy,
            ],
        );
        inverse
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "sums of f32 terms decide nothing but how well the fit converges"
)]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The blocks of one sample.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    own: Block,
    right: Block,
    above: Block,
    across: Block,
}

/// The system: [`System::apply`] times the moves are [`System::right_hand`].
pub(super) struct System<'a> {
    leaves: &'a [Leaf],
    points: &'a Points,
    rows: Vec<Vec<Row>>,
    inverses: Vec<Block>,
    right_hand: Vec<DVec3>,
    damping: f64,
    before: Vec<Estimate>,
}

impl<'a> System<'a> {
    pub(super) fn new(problem: &Problem<'a>) -> Self {
        let assembled: Vec<(Vec<Row>, Vec<DVec3>, Estimate)> = problem
            .leaves
            .par_iter()
            .map(|&leaf| assemble(problem, leaf))
            .collect();
        let area: f64 = assembled.iter().map(|(_, _, before)| before.area).sum();
        let mut system = Self {
            leaves: problem.leaves,
            points: problem.points,
            rows: Vec::with_capacity(assembled.len()),
            inverses: Vec::new(),
            right_hand: Vec::new(),
            damping: DAMPING * area / problem.target.powi(2) / problem.points.len().max(1) as f64,
            before: Vec::with_capacity(assembled.len()),
        };
        let mut by_sample = Vec::with_capacity(problem.points.of_sample.len());
        for (rows, right, before) in assembled {
            system.before.push(before);
            system.rows.push(rows);
            by_sample.extend(right);
        }
        system.right_hand = system.gather(|sample| by_sample[sample]);
        let starts: Vec<&Row> = system.rows.iter().flatten().collect();
        system.inverses = (0..problem.points.len())
            .into_par_iter()
            .map(|point| {
                let mut block = Block::default();
                block.add(system.damping, [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
                for (sample, part) in problem.points.samples(point) {
                    block = block.sum(starts[sample].own, part * part);
                }
                block.inverse()
            })
            .collect();
        system
    }

    pub(super) fn right_hand(&self) -> &[DVec3] {
        &self.right_hand
    }

    /// Errors by leaf, of the samples before they move.
    pub(super) fn before(&self) -> &[Estimate] {
        &self.before
    }

    /// The product with the points' moves.
    pub(super) fn apply(&self, moves: &[DVec3]) -> Vec<DVec3> {
        let by_leaf: Vec<Vec<DVec3>> = self
            .leaves
            .par_iter()
            .zip(&self.rows)
            .map(|(leaf, rows)| {
                let own: Vec<DVec3> = self.points.of_sample[leaf.range()]
                    .iter()
                    .map(|between| between.of(moves))
                    .collect();
                product(rows, &own, leaf.cells() + 1)
            })
            .collect();
        let flat: Vec<DVec3> = by_leaf.into_iter().flatten().collect();
        let mut result = self.gather(|sample| flat[sample]);
        result
            .par_iter_mut()
            .zip(moves)
            .for_each(|(result, &by)| *result += by * self.damping);
        for (point, result) in result.iter_mut().enumerate() {
            if self.points.open[point] {
                *result = DVec3::ZERO;
            }
        }
        result
    }

    /// The preconditioner: every point by itself.
    pub(super) fn precondition(&self, residual: &[DVec3]) -> Vec<DVec3> {
        residual
            .par_iter()
            .zip(&self.inverses)
            .map(|(&residual, inverse)| inverse.times(residual))
            .collect()
    }

    /// Sums over the points' samples; zero for points that stay.
    fn gather(&self, by_sample: impl Fn(usize) -> DVec3 + Sync) -> Vec<DVec3> {
        (0..self.points.len())
            .into_par_iter()
            .map(|point| {
                if self.points.open[point] {
                    return DVec3::ZERO;
                }
                self.points
                    .samples(point)
                    .map(|(sample, part)| by_sample(sample) * part)
                    .sum()
            })
            .collect()
    }
}

/// A leaf's blocks and right-hand sides, and its error as sampled.
fn assemble(problem: &Problem<'_>, leaf: Leaf) -> (Vec<Row>, Vec<DVec3>, Estimate) {
    let image = problem.image(leaf, problem.sampled);
    let side = leaf.cells() + 1;
    let mut rows = vec![Row::default(); side * side];
    let mut right = vec![DVec3::ZERO; side * side];
    let mut before = Estimate::default();
    let sampler = &problem.samplers[leaf.node.chart.0 as usize];
    sampler.visit_points(window_of(leaf), |point| {
        let corners = Corners::over(point.place, side);
        let [a, b, c] = corners.at;
        let [wa, wb, wc] = corners.weights;
        let gap = point.surface - (image[a] * wa + image[b] * wb + image[c] * wc);
        let n = point.normal;
        // In squares of the target, single precision has room for any unit of length.
        let area = point.area / problem.target.powi(2);
        let terms = [
            n.x * n.x + POINT_TO_POINT,
            n.x * n.y,
            n.x * n.z,
            n.y * n.y + POINT_TO_POINT,
            n.y * n.z,
            n.z * n.z + POINT_TO_POINT,
        ]
        .map(|term| term * area);
        let pull = (n * n.dot(gap) + gap * POINT_TO_POINT) * area;
        for (at, weight) in corners.at.into_iter().zip(corners.weights) {
            rows[at].own.add(weight * weight, terms);
            right[at] += pull * weight;
        }
        // From the first corner the cell's diagonal leads to the last of the lower half, to the second of the upper.
        rows[a].across.add(wa * corners.far_weight(), terms);
        if corners.upper {
            rows[a].above.add(wa * wc, terms);
            rows[c].right.add(wc * wb, terms);
        } else {
            rows[a].right.add(wa * wb, terms);
            rows[b].above.add(wb * wc, terms);
        }
        before.add(point.area, n.dot(gap));
    });
    (rows, right, before)
}

/// The triangle of a leaf over a place: (i,j) (i+1,j) (i+1,j+1) below the diagonal, (i,j) (i+1,j+1) (i,j+1) above it.
pub(super) struct Corners {
    pub(super) at: [usize; 3],
    pub(super) weights: [f64; 3],
    upper: bool,
}

impl Corners {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts saturate; NaN becomes 0"
    )]
    pub(super) fn over(place: glam::DVec2, side: usize) -> Self {
        let last = side - 2;
        let (x, y) = ((place.x as usize).min(last), (place.y as usize).min(last));
        let (u, v) = (place.x - x as f64, place.y - y as f64);
        let first = y * side + x;
        if v > u {
            Self {
                at: [first, first + side + 1, first + side],
                weights: [1.0 - v, u, v - u],
                upper: true,
            }
        } else {
            Self {
                at: [first, first + 1, first + side + 1],
                weights: [1.0 - u, u - v, v],
                upper: false,
            }
        }
    }

    fn far_weight(&self) -> f64 {
        self.weights[if self.upper { 1 } else { 2 }]
    }
}

/// A leaf's blocks times its samples' moves.
fn product(rows: &[Row], moves: &[DVec3], side: usize) -> Vec<DVec3> {
    let mut result = vec![DVec3::ZERO; rows.len()];
    for (at, row) in rows.iter().enumerate() {
        let (i, j) = (at % side, at / side);
        result[at] += row.own.times(moves[at]);
        let mut couple = |block: &Block, other: usize| {
            result[at] += block.times(moves[other]);
            result[other] += block.times(moves[at]);
        };
        if i + 1 < side {
            couple(&row.right, at + 1);
        }
        if j + 1 < side {
            couple(&row.above, at + side);
        }
        if i + 1 < side && j + 1 < side {
            couple(&row.across, at + side + 1);
        }
    }
    result
}
