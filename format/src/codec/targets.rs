//! Morph targets: where every sample lies on the parent's surface.
//!
//! An odd sample's target is the mean of its two neighbours of the coarser resolution, rounded down: exactly
//! what the coarser triangulation, whose cell diagonals run from (i, j) to (i + 1, j + 1), has there. The mean
//! does not depend on the order of the two, so both charts of a shared border compute the same.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "indices stay in a grid of at most 2^5 + 1 samples a side, values below 2^21 are averaged"
)]

use super::grid::Grid;
use super::sample::{Normal, Sample};

/// A value whose mean with another is its target's.
pub(crate) trait Target: Sample {
    /// Mean of two neighbours; `own` where they say nothing.
    fn mean(a: Self, b: Self, own: Self) -> Self;
}

impl Target for super::sample::Position {
    fn mean(Self([a, b, c]): Self, Self([d, e, f]): Self, _: Self) -> Self {
        Self([(a + d) >> 1, (b + e) >> 1, (c + f) >> 1])
    }
}

impl Target for Normal {
    fn mean(a: Self, b: Self, own: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (a.lift(), b.lift());
        Self::lower([a + d, b + e, c + f], 1, own)
    }
}

impl Target for super::sample::Colour {
    fn mean(Self(a): Self, Self(b): Self, _: Self) -> Self {
        let [(a, d), (b, e), (c, f)] = [(a[0], b[0]), (a[1], b[1]), (a[2], b[2])];
        Self([(a, d), (b, e), (c, f)].map(|(x, y)| ((u16::from(x) + u16::from(y)) >> 1) as u8))
    }
}

/// Targets of a root's or the base's samples at `resolution`: each sample's at the resolution that introduces it.
pub(crate) fn of_root<T: Target>(samples: &Grid<T>, resolution: u8) -> Vec<T> {
    let side = samples.side();
    let mut targets = Vec::with_capacity(side * side);
    for j in 0..side {
        for i in 0..side {
            let steps = (i | j).trailing_zeros();
            targets.push(if steps >= u32::from(resolution) {
                samples.get(i, j)
            } else {
                let (a, b) = neighbours(i, j, steps);
                T::mean(
                    samples.get(a.0, a.1),
                    samples.get(b.0, b.1),
                    samples.get(i, j),
                )
            });
        }
    }
    targets
}

/// Targets of a child's samples: even ones from `parent`, its quadrant one resolution coarser, odd ones between.
pub(crate) fn of_child<T: Target>(samples: &Grid<T>, parent: &Grid<T>) -> Vec<T> {
    let side = samples.side();
    let mut targets = Vec::with_capacity(side * side);
    for j in 0..side {
        for i in 0..side {
            targets.push(if (i | j) & 1 == 0 {
                parent.get(i / 2, j / 2)
            } else {
                let (a, b) = neighbours(i, j, 0);
                T::mean(
                    parent.get(a.0 / 2, a.1 / 2),
                    parent.get(b.0 / 2, b.1 / 2),
                    samples.get(i, j),
                )
            });
        }
    }
    targets
}

/// The two neighbours at distance `2^steps` of a sample that is odd at that distance.
fn neighbours(i: usize, j: usize, steps: u32) -> ((usize, usize), (usize, usize)) {
    let di = (i >> steps & 1) << steps;
    let dj = (j >> steps & 1) << steps;
    ((i - di, j - dj), (i + di, j + dj))
}

#[cfg(test)]
mod tests {
    use super::super::grid::side_of;
    use super::super::sample::Position;
    use super::*;

    fn bumpy(resolution: u8) -> Grid<Position> {
        let side = side_of(resolution) as i32;
        let samples = (0..side * side).map(|k| {
            let (i, j) = (k % side, k / side);
            Position([i * 64, j * 64, (i * i * 31 + j * j * 17 + i * j * 5) % 127])
        });
        Grid::new(resolution, samples.collect()).unwrap()
    }

    #[test]
    fn root_targets_lie_between_samples_of_the_resolution_before() {
        let grid = bumpy(3);
        let targets = of_root(&grid, 3);
        let at = |i: usize, j: usize| targets[j * 9 + i];
        for corner in [(0, 0), (8, 0), (0, 8), (8, 8)] {
            assert_eq!(at(corner.0, corner.1), grid.get(corner.0, corner.1));
        }
        // (4, 0) comes with resolution 1, (2, 6) with 2, (3, 5) with 3.
        assert_eq!(
            at(4, 0),
            Position::mean(grid.get(0, 0), grid.get(8, 0), Position::default())
        );
        assert_eq!(
            at(2, 6),
            Position::mean(grid.get(0, 4), grid.get(4, 8), Position::default())
        );
        assert_eq!(
            at(3, 5),
            Position::mean(grid.get(2, 4), grid.get(4, 6), Position::default())
        );
        assert_eq!(
            at(4, 1),
            Position::mean(grid.get(4, 0), grid.get(4, 2), Position::default())
        );
    }

    #[test]
    fn child_targets_are_the_parents_surface() {
        let parent = bumpy(5);
        let quarter = parent.quarter(true, false);
        let mut child = quarter.finer();
        for odd in super::super::grid::odd_samples(33) {
            child.set(odd.i, odd.j, Position([9; 3]));
        }
        let targets = of_child(&child, &quarter);
        for j in 0..33 {
            for i in 0..33 {
                let target = targets[j * 33 + i];
                match (i % 2, j % 2) {
                    (0, 0) => assert_eq!(target, parent.get(16 + i / 2, j / 2)),
                    _ => assert_eq!(
                        target,
                        Position::mean(
                            parent.get(16 + i / 2, j / 2),
                            parent.get(16 + i.div_ceil(2), j.div_ceil(2)),
                            Position::default()
                        )
                    ),
                }
            }
        }
    }

    #[test]
    fn means_do_not_depend_on_the_order() {
        let codes = [
            Normal([200, 90]),
            Normal([10, 10]),
            Normal([0, 255]),
            Normal([128, 127]),
        ];
        for a in codes {
            for b in codes {
                assert_eq!(
                    Normal::mean(a, b, Normal::default()),
                    Normal::mean(b, a, Normal::default())
                );
            }
        }
    }
}
