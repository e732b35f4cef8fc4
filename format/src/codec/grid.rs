//! Square grids of samples and the prediction of a grid's odd samples from the next coarser grid.
//!
//! Interpolating subdivision as a predictor: Deslauriers & Dubuc, "Symmetric iterative interpolation
//! processes", 1989 (the 4-tap rule (−1 9 9 −1)/16); used for surface residuals by Guskov et al., "Normal
//! Meshes", 2000. Every rule reads the same from both ends of a line, and a sample on the border of the grid
//! is predicted from that border alone.

#![allow(
    clippy::arithmetic_side_effects,
    reason = "a side is at most 2^5 + 1 samples, a lifted component below 2^22 and the weights of a sum at most 40"
)]

use super::sample::Sample;

/// Samples of a square, row by row; `side` = 2^r + 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Grid<T> {
    side: usize,
    samples: Vec<T>,
}

/// A sample that the next coarser grid does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Odd {
    pub(crate) i: usize,
    pub(crate) j: usize,
}

/// Samples a side at resolution `resolution`.
pub(crate) fn side_of(resolution: u8) -> usize {
    (1usize << resolution.min(30)).saturating_add(1)
}

/// Samples of a grid at resolution `resolution`.
pub(crate) fn count_of(resolution: u8) -> usize {
    side_of(resolution).saturating_mul(side_of(resolution))
}

/// The odd samples of a grid in coding order: odd along u only, odd along v only, odd along both; each row by row.
pub(crate) fn odd_samples(side: usize) -> impl Iterator<Item = Odd> {
    let rows = move |first_i: usize, first_j: usize| {
        (first_j..side)
            .step_by(2)
            .flat_map(move |j| (first_i..side).step_by(2).map(move |i| Odd { i, j }))
    };
    rows(1, 0).chain(rows(0, 1)).chain(rows(1, 1))
}

impl<T: Sample> Grid<T> {
    /// A grid at `resolution`; `None` when `samples` are not as many as it has.
    pub(crate) fn new(resolution: u8, samples: Vec<T>) -> Option<Self> {
        let side = side_of(resolution);
        (samples.len() == count_of(resolution)).then_some(Self { side, samples })
    }

    pub(crate) fn side(&self) -> usize {
        self.side
    }

    pub(crate) fn get(&self, i: usize, j: usize) -> T {
        debug_assert!(i < self.side && j < self.side);
        self.samples
            .get(j * self.side + i)
            .copied()
            .unwrap_or_default()
    }

    pub(crate) fn set(&mut self, i: usize, j: usize, value: T) {
        debug_assert!(i < self.side && j < self.side);
        if let Some(sample) = self.samples.get_mut(j * self.side + i) {
            *sample = value;
        }
    }

    pub(crate) fn samples(&self) -> &[T] {
        &self.samples
    }

    fn from_fn(side: usize, mut sample: impl FnMut(usize, usize) -> T) -> Self {
        let mut samples = Vec::with_capacity(side * side);
        for j in 0..side {
            samples.extend((0..side).map(|i| sample(i, j)));
        }
        Self { side, samples }
    }

    /// Every `2^steps`-th sample: the same surface, `steps` resolutions coarser.
    pub(crate) fn coarser(&self, steps: u32) -> Self {
        Self::from_fn(((self.side - 1) >> steps) + 1, |i, j| {
            self.get(i << steps, j << steps)
        })
    }

    /// One resolution finer; odd samples are yet to be set.
    pub(crate) fn finer(&self) -> Self {
        Self::from_fn(2 * self.side - 1, |i, j| {
            if i % 2 == 0 && j % 2 == 0 {
                self.get(i / 2, j / 2)
            } else {
                T::default()
            }
        })
    }

    /// The quarter of the grid that quadrant (`right`, `upper`) covers, at the same density.
    pub(crate) fn quarter(&self, right: bool, upper: bool) -> Self {
        let half = (self.side - 1) / 2;
        let (i0, j0) = (if right { half } else { 0 }, if upper { half } else { 0 });
        Self::from_fn(half + 1, |i, j| self.get(i0 + i, j0 + j))
    }

    /// Predicts an odd sample. Samples odd along both axes also use the other odd samples.
    pub(crate) fn predict(&self, Odd { i, j }: Odd) -> T {
        let along_u = || weighted(i, self.side, |i| self.get(i, j));
        let along_v = || weighted(j, self.side, |j| self.get(i, j));
        match (i % 2, j % 2) {
            (1, 0) => T::lower(along_u(), 4, self.get(i - 1, j)),
            (0, 1) => T::lower(along_v(), 4, self.get(i, j - 1)),
            _ => {
                let ([a, b, c], [d, e, f]) = (along_u(), along_v());
                T::lower([a + d, b + e, c + f], 5, self.get(i - 1, j - 1))
            }
        }
    }
}

/// 16 times the interpolation at odd `at` of the samples at its even neighbours on a line of `side` samples.
fn weighted<T: Sample>(at: usize, side: usize, sample: impl Fn(usize) -> T) -> [i32; 3] {
    let sum = |taps: &[(usize, i32)]| {
        let mut total = [0; 3];
        for &(position, weight) in taps {
            for (total, component) in total.iter_mut().zip(sample(position).lift()) {
                *total += weight * component;
            }
        }
        total
    };
    match (at >= 3, at + 3 < side) {
        (true, true) => sum(&[(at - 3, -1), (at - 1, 9), (at + 1, 9), (at + 3, -1)]),
        (false, true) => sum(&[(at - 1, 6), (at + 1, 12), (at + 3, -2)]),
        (true, false) => sum(&[(at - 3, -2), (at - 1, 12), (at + 1, 6)]),
        (false, false) => sum(&[(at - 1, 8), (at + 1, 8)]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::Position;
    use super::*;

    fn plane(resolution: u8, f: impl Fn(i32, i32) -> [i32; 3]) -> Grid<Position> {
        Grid::from_fn(side_of(resolution), |i, j| Position(f(i as i32, j as i32)))
    }

    #[test]
    fn every_odd_sample_comes_once_and_after_what_it_needs() {
        for resolution in 1..=5 {
            let side = side_of(resolution);
            let mut seen = vec![false; side * side];
            for (index, seen) in seen.iter_mut().enumerate() {
                *seen = ((index % side) | (index / side)) & 1 == 0;
            }
            for Odd { i, j } in odd_samples(side) {
                let along_u = i % 2 == 1;
                let (before, after) = if along_u {
                    (j * side + i - 1, j * side + i + 1)
                } else {
                    ((j - 1) * side + i, (j + 1) * side + i)
                };
                assert!(seen[before] && seen[after] && !seen[j * side + i]);
                seen[j * side + i] = true;
            }
            assert!(seen.iter().all(|&seen| seen));
        }
    }

    #[test]
    fn quadratics_are_predicted_exactly() {
        let fine = plane(4, |i, j| [16 * i * i, 16 * j * j + 3 * i, 16 * i * j]);
        for odd in odd_samples(fine.side()) {
            // (−1 9 9 −1)/16 is exact on cubics, the 3-tap ends on quadratics.
            assert_eq!(fine.predict(odd), fine.get(odd.i, odd.j), "{odd:?}");
        }
    }

    #[test]
    fn prediction_is_the_same_from_both_ends() {
        let noise = |i: i32, j: i32| {
            let h = (i * 7919 + j * 104_729) % 1009;
            [h, h * h % 997, (h + i) % 31]
        };
        let forward = plane(5, noise);
        let backward = plane(5, |i, j| noise(32 - i, 32 - j));
        for odd in odd_samples(33) {
            assert_eq!(
                forward.predict(odd),
                backward.predict(Odd {
                    i: 32 - odd.i,
                    j: 32 - odd.j
                })
            );
        }
    }

    #[test]
    fn coarser_undoes_finer_and_quarters_meet() {
        let grid = plane(4, |i, j| [i, j, i * j]);
        assert_eq!(grid.finer().coarser(1), grid);
        let (left, right) = (grid.quarter(false, true), grid.quarter(true, true));
        for j in 0..left.side() {
            assert_eq!(left.get(left.side() - 1, j), right.get(0, j));
        }
    }
}
