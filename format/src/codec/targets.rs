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
use super::sample::{Colour, Normal, Position, Sample};

/// A value that a node stores, and whose mean with another is its target's.
pub(crate) trait Target: Sample {
    /// As [`PageSamples`](crate::PageSamples) has it.
    type Stored;

    /// The value; positions are multiples of `2^shift`.
    fn stored(self, shift: u8) -> Self::Stored;

    /// Mean of two neighbours, stored; `own` where they say nothing.
    fn mean(a: Self, b: Self, own: Self, shift: u8) -> Self::Stored;
}

impl Target for Position {
    type Stored = [u32; 3];

    fn stored(self, shift: u8) -> [u32; 3] {
        self.0.map(|c| (c << shift).cast_unsigned())
    }

    fn mean(Self([a, b, c]): Self, Self([d, e, f]): Self, _: Self, shift: u8) -> [u32; 3] {
        [a + d, b + e, c + f].map(|sum| (sum << shift >> 1).cast_unsigned())
    }
}

impl Target for Normal {
    type Stored = [u8; 2];

    fn stored(self, _: u8) -> [u8; 2] {
        self.code()
    }

    fn mean(a: Self, b: Self, own: Self, _: u8) -> [u8; 2] {
        let ([a, b, c], [d, e, f]) = (a.lift(), b.lift());
        Self::lower([a + d, b + e, c + f], 1, own)
    }
}

impl Target for Colour {
    type Stored = [u8; 3];

    fn stored(self, _: u8) -> [u8; 3] {
        self.0
    }

    fn mean(Self([a, b, c]): Self, Self([d, e, f]): Self, _: Self, _: u8) -> [u8; 3] {
        [a.midpoint(d), b.midpoint(e), c.midpoint(f)]
    }
}

/// Targets of a root's or the base's samples at `resolution`: each sample's at the resolution that introduces it.
pub(crate) fn of_root<T: Target>(samples: &Grid<T>, resolution: u8, shift: u8) -> Vec<T::Stored> {
    if resolution == 0 {
        return samples
            .samples()
            .iter()
            .map(|own| own.stored(shift))
            .collect();
    }
    let coarser = samples.coarser(1);
    let even = of_root(&coarser, resolution - 1, shift);
    between(samples, &coarser, even.into_iter(), shift)
}

/// Targets of a child's samples: even ones from `parent`, its quadrant one resolution coarser, odd ones between.
pub(crate) fn of_child<T: Target>(
    samples: &Grid<T>,
    parent: &Grid<T>,
    shift: u8,
) -> Vec<T::Stored> {
    let even = parent.samples().iter().map(|own| own.stored(shift));
    between(samples, parent, even, shift)
}

/// Targets of even samples as `even` has them, row by row, and of odd ones between the samples of `coarser`.
fn between<T: Target>(
    samples: &Grid<T>,
    coarser: &Grid<T>,
    mut even: impl Iterator<Item = T::Stored>,
    shift: u8,
) -> Vec<T::Stored> {
    let side = samples.side();
    let mut targets = Vec::with_capacity(side * side);
    for j in 0..side {
        let (before, after) = (coarser.row(j / 2), coarser.row(j.div_ceil(2)));
        for (i, &own) in samples.row(j).iter().enumerate() {
            let at = |row: &[T], i: usize| row.get(i).copied().unwrap_or_default();
            let told = if (i | j) & 1 == 0 { even.next() } else { None };
            targets.push(told.unwrap_or_else(|| {
                T::mean(at(before, i / 2), at(after, i.div_ceil(2)), own, shift)
            }));
        }
    }
    targets
}

#[cfg(test)]
mod tests {
    use super::super::grid::side_of;
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
        let targets = of_root(&grid, 3, 0);
        let at = |i: usize, j: usize| targets[j * 9 + i];
        for corner in [(0, 0), (8, 0), (0, 8), (8, 8)] {
            assert_eq!(
                at(corner.0, corner.1),
                grid.get(corner.0, corner.1).stored(0)
            );
        }
        // (4, 0) comes with resolution 1, (2, 6) with 2, (3, 5) with 3.
        assert_eq!(
            at(4, 0),
            Position::mean(grid.get(0, 0), grid.get(8, 0), Position::default(), 0)
        );
        assert_eq!(
            at(2, 6),
            Position::mean(grid.get(0, 4), grid.get(4, 8), Position::default(), 0)
        );
        assert_eq!(
            at(3, 5),
            Position::mean(grid.get(2, 4), grid.get(4, 6), Position::default(), 0)
        );
        assert_eq!(
            at(4, 1),
            Position::mean(grid.get(4, 0), grid.get(4, 2), Position::default(), 0)
        );
    }

    #[test]
    fn child_targets_are_the_parents_surface() {
        let parent = bumpy(5);
        let quarter = Grid::quarter(5, parent.samples(), (true, false), |p| p).unwrap();
        let mut child = quarter.finer();
        let Ok(()) = child.visit_odd(|_, _, _| Ok::<_, std::convert::Infallible>(Position([9; 3])));
        let targets = of_child(&child, &quarter, 0);
        for j in 0..33 {
            for i in 0..33 {
                let target = targets[j * 33 + i];
                match (i % 2, j % 2) {
                    (0, 0) => assert_eq!(target, parent.get(16 + i / 2, j / 2).stored(0)),
                    _ => assert_eq!(
                        target,
                        Position::mean(
                            parent.get(16 + i / 2, j / 2),
                            parent.get(16 + i.div_ceil(2), j.div_ceil(2)),
                            Position::default(),
                            0
                        )
                    ),
                }
            }
        }
    }

    #[test]
    fn means_do_not_depend_on_the_order() {
        let codes = [
            Normal::new([200, 90]),
            Normal::new([10, 10]),
            Normal::new([0, 255]),
            Normal::new([128, 127]),
        ];
        for a in codes {
            for b in codes {
                assert_eq!(
                    Normal::mean(a, b, Normal::default(), 0),
                    Normal::mean(b, a, Normal::default(), 0)
                );
            }
        }
    }
}
