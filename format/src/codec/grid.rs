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

    /// The samples of row `j`.
    pub(crate) fn row(&self, j: usize) -> &[T] {
        debug_assert!(j < self.side);
        let first = j * self.side;
        self.samples
            .get(first..first + self.side)
            .unwrap_or_default()
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
        let side = 2 * self.side - 1;
        let mut samples = vec![T::default(); side * side];
        for (finer, own) in samples
            .chunks_mut(2 * side)
            .zip(self.samples.chunks(self.side))
        {
            for (finer, &own) in finer.iter_mut().step_by(2).zip(own) {
                *finer = own;
            }
        }
        Self { side, samples }
    }

    /// The quarter that quadrant (`right`, `upper`) covers of a grid of `values` at `resolution`, at the same density.
    pub(crate) fn quarter<S: Copy>(
        resolution: u8,
        values: &[S],
        (right, upper): (bool, bool),
        sample: impl Fn(S) -> T,
    ) -> Option<Self> {
        let whole = side_of(resolution);
        let (half, side) = (whole / 2, whole / 2 + 1);
        let (first, row) = (if right { half } else { 0 }, if upper { half } else { 0 });
        let mut samples = Vec::with_capacity(side * side);
        for values in values.chunks_exact(whole).skip(row).take(side) {
            samples.extend(values.get(first..first + side)?.iter().map(|&s| sample(s)));
        }
        (values.len() == count_of(resolution)).then_some(Self { side, samples })
    }

    /// Visits the odd samples in coding order: odd along u only, odd along v only, odd along both; each row by row.
    ///
    /// `value` is told the sample, its value and what it is predicted to be, and gives the value that it then has. Samples odd along both
    /// axes are predicted from the other odd samples, too.
    pub(crate) fn visit_odd<E>(
        &mut self,
        mut value: impl FnMut(Odd, T, T::Code) -> Result<T, E>,
    ) -> Result<(), E> {
        let mut both = vec![[0; 3]; self.side];
        let (even, odd) = both.split_at_mut(self.side / 2 + 1);
        for j in (0..self.side).step_by(2) {
            self.along_row(j, odd);
            self.visit_row([1, j], odd, 4, &mut value)?;
        }
        for j in (1..self.side).step_by(2) {
            self.across_rows(j, 0, even);
            self.visit_row([0, j], even, 4, &mut value)?;
        }
        for j in (1..self.side).step_by(2) {
            self.along_row(j, odd);
            self.across_rows(j, 1, even);
            for (along, &across) in odd.iter_mut().zip(&*even) {
                *along = sum(*along, across, |along, across| along + across);
            }
            self.visit_row([1, j], odd, 5, &mut value)?;
        }
        Ok(())
    }

    /// Visits every second sample of row `j` from the `first`, predicted from `sums` with weights of total `2^log_weight`.
    fn visit_row<E>(
        &mut self,
        [first, j]: [usize; 2],
        sums: &[[i32; 3]],
        log_weight: u32,
        value: &mut impl FnMut(Odd, T, T::Code) -> Result<T, E>,
    ) -> Result<(), E> {
        for (i, &sum) in (first..self.side).step_by(2).zip(sums) {
            let even = self.get(i - first, j - j % 2);
            let predicted = T::lower(sum, log_weight, even);
            let found = value(Odd { i, j }, self.get(i, j), predicted)?;
            self.set(i, j, found);
        }
        Ok(())
    }

    /// 16 times the interpolation at the odd samples of row `j` of the even ones.
    fn along_row(&self, j: usize, sums: &mut [[i32; 3]]) {
        let row = self.row(j);
        if let (&[a, _, b], [sum]) = (row, &mut *sums) {
            *sum = two(a.lift(), b.lift());
        }
        if let (&[a, _, b, _, c, ..], [first, inner @ .., last]) = (row, sums) {
            *first = three(a.lift(), b.lift(), c.lift());
            for (sum, line) in inner.iter_mut().zip(row.windows(7).step_by(2)) {
                if let &[a, _, b, _, c, _, d] = line {
                    *sum = four([a, b, c, d].map(T::lift));
                }
            }
            if let [.., a, _, b, _, c] = *row {
                *last = three(c.lift(), b.lift(), a.lift());
            }
        }
    }

    /// 16 times the interpolation between rows at odd row `j`, at every second sample from the `first`.
    fn across_rows(&self, j: usize, first: usize, sums: &mut [[i32; 3]]) {
        let lift = |row: &[T], i: usize| row.get(i).copied().unwrap_or_default().lift();
        let (b, c) = (self.row(j - 1), self.row(j + 1));
        match (j >= 3, j + 3 < self.side) {
            (true, true) => {
                let (a, d) = (self.row(j - 3), self.row(j + 3));
                fill(sums, first, |i| four([a, b, c, d].map(|row| lift(row, i))));
            }
            (false, true) => {
                let d = self.row(j + 3);
                fill(sums, first, |i| three(lift(b, i), lift(c, i), lift(d, i)));
            }
            (true, false) => {
                let a = self.row(j - 3);
                fill(sums, first, |i| three(lift(c, i), lift(b, i), lift(a, i)));
            }
            (false, false) => fill(sums, first, |i| two(lift(b, i), lift(c, i))),
        }
    }
}

/// Fills `sums` with those at every second place from the `first`.
fn fill(sums: &mut [[i32; 3]], first: usize, of: impl Fn(usize) -> [i32; 3]) {
    for (sum, i) in sums.iter_mut().zip((first..).step_by(2)) {
        *sum = of(i);
    }
}

/// 16 times what lies between four samples of a line.
fn four([a, b, c, d]: [[i32; 3]; 4]) -> [i32; 3] {
    let (inner, outer) = (sum(b, c, |b, c| 9 * (b + c)), sum(a, d, |a, d| a + d));
    sum(inner, outer, |inner, outer| inner - outer)
}

/// 16 times what lies between the first two of three samples from the end of a line.
fn three(a: [i32; 3], b: [i32; 3], c: [i32; 3]) -> [i32; 3] {
    let near = sum(a, b, |a, b| 6 * a + 12 * b);
    sum(near, c, |near, c| near - 2 * c)
}

/// 16 times what lies between the two samples of a line.
fn two(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    sum(a, b, |a, b| 8 * (a + b))
}

fn sum([a, b, c]: [i32; 3], [d, e, f]: [i32; 3], of: impl Fn(i32, i32) -> i32) -> [i32; 3] {
    [of(a, d), of(b, e), of(c, f)]
}

#[cfg(test)]
mod tests {
    use super::super::sample::Position;
    use super::*;

    fn plane(resolution: u8, f: impl Fn(i32, i32) -> [i32; 3]) -> Grid<Position> {
        Grid::from_fn(side_of(resolution), |i, j| Position(f(i as i32, j as i32)))
    }

    /// The odd samples of a grid, each with its value and its prediction.
    fn odd_samples(mut grid: Grid<Position>) -> Vec<(Odd, Position, Position)> {
        let mut odd_samples = Vec::new();
        let Ok(()) = grid.visit_odd(|odd, own, predicted| {
            odd_samples.push((odd, own, predicted));
            Ok::<_, std::convert::Infallible>(own)
        });
        odd_samples
    }

    #[test]
    fn every_odd_sample_comes_once_and_after_what_it_needs() {
        for resolution in 1..=5 {
            let side = side_of(resolution);
            let mut seen = vec![false; side * side];
            for (index, seen) in seen.iter_mut().enumerate() {
                *seen = ((index % side) | (index / side)) & 1 == 0;
            }
            for (Odd { i, j }, ..) in odd_samples(plane(resolution, |i, j| [i, j, 0])) {
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
        for (odd, own, predicted) in odd_samples(plane(4, |i, j| {
            [16 * i * i, 16 * j * j + 3 * i, 16 * i * j]
        })) {
            // (−1 9 9 −1)/16 is exact on cubics, the 3-tap ends on quadratics.
            assert_eq!(predicted, own, "{odd:?}");
        }
    }

    #[test]
    fn samples_are_predicted_from_what_was_found() {
        // What is found is one more than what is predicted: where both axes' neighbours are found, so is their one more.
        let mut grid = plane(3, |_, _| [100; 3]);
        let Ok(()) = grid.visit_odd(|odd, _, Position(predicted)| {
            let both = odd.i % 2 + odd.j % 2 == 2;
            assert_eq!(predicted, [if both { 101 } else { 100 }; 3], "{odd:?}");
            Ok::<_, std::convert::Infallible>(Position([101; 3]))
        });
    }

    #[test]
    fn prediction_is_the_same_from_both_ends() {
        let noise = |i: i32, j: i32| {
            let h = (i * 7919 + j * 104_729) % 1009;
            [h, h * h % 997, (h + i) % 31]
        };
        let forward = odd_samples(plane(5, noise));
        let backward = odd_samples(plane(5, |i, j| noise(32 - i, 32 - j)));
        for (odd, _, predicted) in forward {
            let across = Odd {
                i: 32 - odd.i,
                j: 32 - odd.j,
            };
            let found = backward.iter().find(|(odd, ..)| *odd == across);
            assert_eq!(found.unwrap().2, predicted, "{odd:?}");
        }
    }

    #[test]
    fn coarser_undoes_finer_and_quarters_meet() {
        let grid = plane(4, |i, j| [i, j, i * j]);
        assert_eq!(grid.finer().coarser(1), grid);
        let quarter = |right| Grid::quarter(4, grid.samples(), (right, true), |p| p).unwrap();
        let (left, right) = (quarter(false), quarter(true));
        for j in 0..left.side() {
            assert_eq!(left.get(left.side() - 1, j), right.get(0, j));
            assert_eq!(right.get(3, j), grid.get(8 + 3, 8 + j));
        }
    }
}
