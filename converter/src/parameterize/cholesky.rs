//! Sparse L·D·Lᵀ of small symmetric positive definite matrices, refactorized often.
//!
//! The up-looking factorization of Davis, "Algorithm 849: a concise sparse Cholesky factorization package", 2005, in
//! a nested dissection order. Plain scalar arithmetic in a fixed order: the result is the same bits on every machine, which
//! SIMD kernels chosen at run time do not promise, and for the few hundred unknowns of a patch little is faster.
//!
//! Limit: one thread and no supernodes, so beyond about 10⁶ unknowns a blocked solver would win.

use super::dissection;
use super::edges::NONE;
use glam::DVec2;

/// Pattern, values and factor of a matrix.
#[derive(Debug, Default)]
pub(super) struct Cholesky {
    /// Strictly upper entries by column: `rows[starts[k]..starts[k + 1]]`.
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
    diagonal: Vec<f64>,
    /// Elimination tree.
    parent: Vec<u32>,
    /// Factor by column: capacity in `factor_starts`, used so far in `factor_ends`.
    factor_starts: Vec<u32>,
    factor_ends: Vec<u32>,
    factor_rows: Vec<u32>,
    factor: Vec<f64>,
    pivots: Vec<f64>,
    row: Vec<f64>,
    pattern: Vec<u32>,
    mark: Vec<u32>,
}

impl Cholesky {
    /// Analyses a matrix of `count` unknowns with off-diagonal entries at `pairs`, each given once.
    ///
    /// Returns also the place of every unknown in the order chosen, and of every pair among the entries.
    pub(super) fn analyse(count: u32, pairs: &[[u32; 2]]) -> (Self, Vec<u32>, Vec<u32>) {
        let order = dissection::order(count, pairs);
        let n = count as usize;
        let mut starts = vec![0u32; n + 1];
        let placed = |pair: &[u32; 2]| {
            let (a, b) = (order[pair[0] as usize], order[pair[1] as usize]);
            (a.min(b), a.max(b) as usize)
        };
        for pair in pairs {
            starts[placed(pair).1 + 1] += 1;
        }
        for k in 0..n {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut rows = vec![0u32; pairs.len()];
        let mut slots = Vec::with_capacity(pairs.len());
        for pair in pairs {
            let (row, column) = placed(pair);
            rows[next[column] as usize] = row;
            slots.push(next[column]);
            next[column] += 1;
        }
        let mut matrix = Self {
            values: vec![0.0; rows.len()],
            starts,
            rows,
            diagonal: vec![0.0; n],
            parent: vec![NONE; n],
            factor_starts: vec![0; n + 1],
            factor_ends: vec![0; n],
            pivots: vec![0.0; n],
            row: vec![0.0; n],
            pattern: vec![0; n],
            mark: vec![NONE; n],
            ..Self::default()
        };
        matrix.build_tree();
        (matrix, order, slots)
    }

    /// Elimination tree and the number of entries in every column of the factor.
    fn build_tree(&mut self) {
        for k in 0..self.diagonal.len() {
            let id = place(k);
            self.mark[k] = id;
            for p in self.starts[k]..self.starts[k + 1] {
                let mut i = self.rows[p as usize] as usize;
                while self.mark[i] != id {
                    if self.parent[i] == NONE {
                        self.parent[i] = id;
                    }
                    self.factor_starts[i + 1] += 1;
                    self.mark[i] = id;
                    i = self.parent[i] as usize;
                }
            }
        }
        for k in 0..self.diagonal.len() {
            self.factor_starts[k + 1] += self.factor_starts[k];
        }
        let entries = self.factor_starts.last().map_or(0, |&end| end as usize);
        self.factor_rows = vec![0; entries];
        self.factor = vec![0.0; entries];
    }

    /// Sets all values to zero.
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
        self.diagonal.fill(0.0);
    }

    /// Adds to a diagonal value.
    pub(super) fn add_diagonal(&mut self, unknown: u32, value: f64) {
        self.diagonal[unknown as usize] += value;
    }

    /// Sets an off-diagonal value, in both triangles.
    pub(super) fn set(&mut self, slot: u32, value: f64) {
        self.values[slot as usize] = value;
    }

    /// Factorizes the present values.
    pub(super) fn factorize(&mut self) {
        let n = self.diagonal.len();
        self.mark.fill(NONE);
        self.factor_ends.copy_from_slice(&self.factor_starts[..n]);
        for k in 0..n {
            let top = self.scatter(k);
            let mut pivot = self.diagonal[k];
            for at in top..n {
                let i = self.pattern[at] as usize;
                let value = std::mem::take(&mut self.row[i]);
                let (start, end) = (self.factor_starts[i] as usize, self.factor_ends[i] as usize);
                for (&row, &entry) in self.factor_rows[start..end]
                    .iter()
                    .zip(&self.factor[start..end])
                {
                    self.row[row as usize] -= entry * value;
                }
                let entry = value / self.pivots[i];
                pivot -= entry * value;
                self.factor_rows[end] = place(k);
                self.factor[end] = entry;
                self.factor_ends[i] += 1;
            }
            self.row[k] = 0.0;
            self.pivots[k] = pivot;
        }
    }

    /// Spreads column `k` into `row`; its pattern in the factor, in topological order, is `pattern[result..]`.
    fn scatter(&mut self, k: usize) -> usize {
        let id = place(k);
        let mut top = self.diagonal.len();
        self.mark[k] = id;
        for p in self.starts[k] as usize..self.starts[k + 1] as usize {
            let mut i = self.rows[p] as usize;
            self.row[i] += self.values[p];
            let mut length = 0;
            while self.mark[i] != id {
                self.pattern[length] = place(i);
                length += 1;
                self.mark[i] = id;
                i = self.parent[i] as usize;
            }
            while length > 0 {
                length -= 1;
                top -= 1;
                self.pattern[top] = self.pattern[length];
            }
        }
        top
    }

    /// Solves for two right-hand sides at once, in place.
    pub(super) fn solve(&self, right: &mut [DVec2]) {
        let column = |k: usize| {
            let range = self.factor_starts[k] as usize..self.factor_ends[k] as usize;
            self.factor_rows[range.clone()]
                .iter()
                .zip(&self.factor[range])
        };
        for k in 0..right.len() {
            let value = right[k];
            for (&row, &entry) in column(k) {
                right[row as usize] -= entry * value;
            }
        }
        for k in (0..right.len()).rev() {
            let mut value = right[k] / self.pivots[k];
            for (&row, &entry) in column(k) {
                value -= entry * right[row as usize];
            }
            right[k] = value;
        }
    }
}

/// An index as it is stored; patches have fewer than 2^32 vertices.
fn place(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(NONE)
}
