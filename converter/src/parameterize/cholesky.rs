//! Sparse L·D·Lᵀ of symmetric positive definite matrices, refactorized often.
//!
//! The multifrontal method of Duff & Reid, "The multifrontal solution of indefinite sparse symmetric linear equations",
//! 1983: the unknowns of one separator of a nested dissection are eliminated together, in a dense matrix that holds their
//! equations and what is left for those they touch; that rest is added to the matrix of the next separator. So nearly all arithmetic
//! is on columns that lie side by side. It has a fixed order and no instructions chosen at run time: the result is the same
//! bits on every machine.
//!
//! Limits: one thread; a separator counts as dense, which on planar graphs it nearly is.

use super::dissection::{self, Order};
use super::edges::NONE;
use glam::DVec2;

/// Unknowns eliminated together.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    /// Place of the first one.
    first: usize,
    /// Their number.
    columns: usize,
    /// Equations: theirs and those that they touch later, which are `rows[touched..]`.
    height: usize,
    /// Where the places of the equations that they touch later start, in `Cholesky::touched`.
    touched: usize,
    /// Where their columns of the factor start; each is `height` long.
    factor: usize,
}

impl Block {
    /// Number of later equations.
    fn later(&self) -> usize {
        self.height - self.columns
    }
}

/// Pattern and factor of a matrix.
#[derive(Debug, Default)]
pub(super) struct Cholesky {
    blocks: Vec<Block>,
    /// For every block those whose rest is added to its matrix: `children[child_starts[b]..child_starts[b + 1]]`.
    child_starts: Vec<usize>,
    children: Vec<u32>,
    /// Places of later equations, ascending in every block.
    touched: Vec<u32>,
    /// Where each of them is in the matrix of the block that the rest is added to.
    above: Vec<u32>,
    /// Where the diagonal entry of every place is in the factor.
    diagonal: Vec<u32>,
    /// Before the factorization what the matrix has there.
    factor: Vec<f64>,
    pivots: Vec<f64>,
}

impl Cholesky {
    /// Analyses a matrix of `count` unknowns with off-diagonal entries at `pairs`, each given once.
    ///
    /// Returns also the place of every unknown in the order chosen, and of every pair among the entries.
    pub(super) fn analyse(count: u32, pairs: &[[u32; 2]]) -> (Self, Vec<u32>, Vec<u32>) {
        let Order { places, blocks } = dissection::order(count, pairs);
        let n = count as usize;
        let ends = blocks.iter().skip(1).chain([&count]);
        let mut matrix = Self {
            blocks: blocks
                .iter()
                .zip(ends)
                .map(|(&first, &end)| Block {
                    first: first as usize,
                    columns: (end - first) as usize,
                    ..Block::default()
                })
                .collect(),
            pivots: vec![0.0; n],
            ..Self::default()
        };
        let mut block_of = vec![0u32; n];
        for (b, block) in (0u32..).zip(&matrix.blocks) {
            block_of[block.first..block.first + block.columns].fill(b);
        }
        let placed: Vec<[u32; 2]> = pairs
            .iter()
            .map(|&[a, b]| {
                let (a, b) = (places[a as usize], places[b as usize]);
                [a.min(b), a.max(b)]
            })
            .collect();
        matrix.find_pattern(&placed, &block_of);
        let slots = placed
            .iter()
            .map(|&[column, row]| {
                let block = matrix.blocks[block_of[column as usize] as usize];
                let column = column as usize - block.first;
                let row = matrix.row(&block, row);
                index(block.factor + column * block.height + row)
            })
            .collect();
        (matrix, places, slots)
    }

    /// Finds which equations every block touches, and the block that its rest goes to.
    fn find_pattern(&mut self, placed: &[[u32; 2]], block_of: &[u32]) {
        let count = self.blocks.len();
        // The matrix's own entries by block.
        let mut starts = vec![0usize; count + 1];
        let leaves = |&[column, row]: &[u32; 2]| {
            let block = block_of[column as usize];
            (block != block_of[row as usize]).then_some((block as usize, row))
        };
        for (block, _) in placed.iter().filter_map(leaves) {
            starts[block + 1] += 1;
        }
        for b in 0..count {
            starts[b + 1] += starts[b];
        }
        let mut own = vec![0u32; starts[count]];
        let mut next = starts.clone();
        for (block, row) in placed.iter().filter_map(leaves) {
            own[next[block]] = row;
            next[block] += 1;
        }
        // The last child of every block, and the one before each.
        let mut child_of = vec![NONE; count];
        let mut before = vec![NONE; count];
        let mut mark = vec![NONE; self.pivots.len()];
        let mut factor = 0;
        for (b, id) in (0..count).zip(0u32..) {
            let block = self.blocks[b];
            let end = block.first + block.columns;
            let start = self.touched.len();
            let mut add = |row: u32, touched: &mut Vec<u32>| {
                if row as usize >= end && mark[row as usize] != id {
                    mark[row as usize] = id;
                    touched.push(row);
                }
            };
            for &row in &own[starts[b]..starts[b + 1]] {
                add(row, &mut self.touched);
            }
            let mut at = child_of[b];
            while let Some(&child) = self.blocks.get(at as usize) {
                at = before[at as usize];
                for at in child.touched..child.touched + child.later() {
                    add(self.touched[at], &mut self.touched);
                }
            }
            self.touched[start..].sort_unstable();
            if let Some(&row) = self.touched.get(start) {
                let slot = &mut child_of[block_of[row as usize] as usize];
                before[b] = std::mem::replace(slot, id);
            }
            let block = &mut self.blocks[b];
            block.touched = start;
            block.height = block.columns + self.touched.len() - start;
            block.factor = factor;
            factor += block.columns * block.height;
        }
        self.factor = vec![0.0; factor];
        self.link(&child_of, &before);
    }

    /// Finds where the rest of every block goes, given the last child of every block and the one before each.
    fn link(&mut self, child_of: &[u32], before: &[u32]) {
        self.above = vec![0; self.touched.len()];
        self.child_starts.push(0);
        for (block, &last) in self.blocks.iter().zip(child_of) {
            let mut next = last;
            while let Some(&child) = self.blocks.get(next as usize) {
                self.children.push(next);
                next = before[next as usize];
                let range = child.touched..child.touched + child.later();
                let own = block.touched..block.touched + block.later();
                let mut at = own.start;
                for k in range {
                    let row = self.touched[k] as usize;
                    self.above[k] = if row < block.first + block.columns {
                        index(row - block.first)
                    } else {
                        while at < own.end && (self.touched[at] as usize) < row {
                            at += 1;
                        }
                        index(block.columns + at - own.start)
                    };
                }
            }
            self.child_starts.push(self.children.len());
            for k in 0..block.columns {
                self.diagonal
                    .push(index(block.factor + k * block.height + k));
            }
        }
    }

    /// Where the equation at place `row` is in a block's matrix.
    fn row(&self, block: &Block, row: u32) -> usize {
        if (row as usize) < block.first + block.columns {
            return row as usize - block.first;
        }
        let touched = &self.touched[block.touched..block.touched + block.later()];
        block.columns + touched.partition_point(|&other| other < row)
    }

    /// Sets all values to zero.
    pub(super) fn clear(&mut self) {
        self.factor.fill(0.0);
    }

    /// Adds to a diagonal value.
    pub(super) fn add_diagonal(&mut self, unknown: u32, value: f64) {
        self.factor[self.diagonal[unknown as usize] as usize] += value;
    }

    /// Sets an off-diagonal value, in both triangles.
    pub(super) fn set(&mut self, slot: u32, value: f64) {
        self.factor[slot as usize] = value;
    }

    /// Factorizes the present values, which it takes the place of.
    pub(super) fn factorize(&mut self) {
        // Lower triangles by column, like the factor.
        let mut rests: Vec<Vec<f64>> = vec![Vec::new(); self.blocks.len()];
        let mut free: Vec<Vec<f64>> = Vec::new();
        for (b, block) in self.blocks.iter().enumerate() {
            let (height, columns, later) = (block.height, block.columns, block.later());
            let panel = &mut self.factor[block.factor..block.factor + columns * height];
            let mut rest = free.pop().unwrap_or_default();
            rest.clear();
            rest.resize(later * later, 0.0);
            for &child in &self.children[self.child_starts[b]..self.child_starts[b + 1]] {
                let added = std::mem::take(&mut rests[child as usize]);
                let child = self.blocks[child as usize];
                let to = &self.above[child.touched..child.touched + child.later()];
                let (inside, outside) =
                    to.split_at(to.partition_point(|&k| (k as usize) < columns));
                for (j, &column) in inside.iter().enumerate() {
                    let from = &added[j * to.len()..(j + 1) * to.len()];
                    let target = &mut panel[column as usize * height..][..height];
                    add(&to[j..], &from[j..], 0, target);
                }
                for (j, &column) in (inside.len()..).zip(outside) {
                    let from = &added[j * to.len()..(j + 1) * to.len()];
                    let target = &mut rest[(column as usize - columns) * later..][..later];
                    add(&to[j..], &from[j..], columns, target);
                }
                free.push(added);
            }
            let pivots = &mut self.pivots[block.first..block.first + columns];
            eliminate(panel, height, pivots);
            for (four, pivots) in panel.chunks(4 * height).zip(pivots.chunks(4)) {
                subtract(four, height, columns, pivots, &mut rest, later);
            }
            rests[b] = rest;
        }
    }

    /// Solves for two right-hand sides at once, in place.
    pub(super) fn solve(&self, right: &mut [DVec2]) {
        let mut later = Vec::new();
        for block in &self.blocks {
            let touched = &self.touched[block.touched..block.touched + block.later()];
            later.clear();
            later.extend(touched.iter().map(|&row| right[row as usize]));
            let own = &mut right[block.first..block.first + block.columns];
            for (k, column) in self.columns(block).enumerate() {
                let (inside, outside) = column.split_at(block.columns);
                let value = own[k];
                for (other, &entry) in own[k + 1..].iter_mut().zip(&inside[k + 1..]) {
                    *other -= entry * value;
                }
                for (other, &entry) in later.iter_mut().zip(outside) {
                    *other -= entry * value;
                }
            }
            for (&row, &value) in touched.iter().zip(&later) {
                right[row as usize] = value;
            }
        }
        for block in self.blocks.iter().rev() {
            let touched = &self.touched[block.touched..block.touched + block.later()];
            later.clear();
            later.extend(touched.iter().map(|&row| right[row as usize]));
            let own = &mut right[block.first..block.first + block.columns];
            let pivots = &self.pivots[block.first..block.first + block.columns];
            for (k, column) in self.columns(block).enumerate().rev() {
                let (inside, outside) = column.split_at(block.columns);
                let sum = dot(&inside[k + 1..], &own[k + 1..]) + dot(outside, &later);
                own[k] = own[k] / pivots[k] - sum;
            }
        }
    }

    fn columns(
        &self,
        block: &Block,
    ) -> impl DoubleEndedIterator<Item = &[f64]> + ExactSizeIterator {
        self.factor[block.factor..block.factor + block.columns * block.height]
            .chunks_exact(block.height)
    }
}

/// Adds entries to a column whose first row is `first`.
fn add(rows: &[u32], entries: &[f64], first: usize, column: &mut [f64]) {
    for (&row, &entry) in rows.iter().zip(entries) {
        column[row as usize - first] += entry;
    }
}

/// Sum of products, in two parts that do not wait for each other.
fn dot(entries: &[f64], values: &[DVec2]) -> DVec2 {
    let mut sums = [DVec2::ZERO; 2];
    let (pairs, others) = (entries.chunks_exact(2), values.chunks_exact(2));
    let last = pairs.remainder().iter().zip(others.remainder());
    for (&entry, &value) in last {
        sums[0] += entry * value;
    }
    for (entry, value) in pairs.zip(others) {
        sums[0] += entry[0] * value[0];
        sums[1] += entry[1] * value[1];
    }
    sums[0] + sums[1]
}

/// Turns the columns of a block, each of `height`, into those of the factor.
fn eliminate(panel: &mut [f64], height: usize, pivots: &mut [f64]) {
    let columns = pivots.len();
    for first in (0..columns).step_by(4) {
        let last = (first + 4).min(columns);
        let (done, rest) = panel.split_at_mut(last * height);
        let four = &mut done[first * height..];
        for j in first..last {
            let (before, column) = four.split_at_mut((j - first) * height);
            for (own, &pivot) in before.chunks_exact(height).zip(&pivots[first..j]) {
                subtract_one(&mut column[j..height], &own[j..], own[j] * pivot);
            }
            pivots[j] = column[j];
            let scale = pivots[j].recip();
            for entry in &mut column[j + 1..height] {
                *entry *= scale;
            }
        }
        // The other columns of the block are a matrix like the rest, without its first rows.
        let pivots = &pivots[first..last];
        let mut at = last;
        for pair in rest.chunks_mut(2 * height) {
            subtract_from_pair(four, height, pivots, at, pair, height, at);
            at += 2;
        }
    }
}

/// Subtracts what up to four eliminated columns have for the later rows, those from `columns` on.
fn subtract(
    four: &[f64],
    height: usize,
    columns: usize,
    pivots: &[f64],
    rest: &mut [f64],
    later: usize,
) {
    for (k, pair) in (0..).step_by(2).zip(rest.chunks_mut((2 * later).max(1))) {
        subtract_from_pair(four, height, pivots, columns + k, pair, later, k);
    }
}

/// Subtracts from one or two columns, of `length`, what up to four eliminated ones, of `height`, have for them. Row `at` of these is
/// row `first` of those, and the diagonal of the first.
fn subtract_from_pair(
    four: &[f64],
    height: usize,
    pivots: &[f64],
    at: usize,
    pair: &mut [f64],
    length: usize,
    first: usize,
) {
    if let (&[p, q, r, s], true) = (pivots, pair.len() == 2 * length) {
        let (a, rest) = four.split_at(height);
        let (b, rest) = rest.split_at(height);
        let (c, d) = rest.split_at(height);
        let from = [&a[at..], &b[at..], &c[at..], &d[at..height]];
        let factors = [0, 1].map(|k| {
            [
                from[0][k] * p,
                from[1][k] * q,
                from[2][k] * r,
                from[3][k] * s,
            ]
        });
        let (one, other) = pair.split_at_mut(length);
        subtract_four(&mut one[first..], &mut other[first..], from, factors);
        return;
    }
    for (k, target) in pair.chunks_mut(length).enumerate() {
        for (own, &pivot) in four.chunks_exact(height).zip(pivots) {
            subtract_one(
                &mut target[first + k..],
                &own[at + k..],
                own[at + k] * pivot,
            );
        }
    }
}

fn subtract_one(column: &mut [f64], from: &[f64], factor: f64) {
    for (entry, &other) in column.iter_mut().zip(from) {
        *entry -= other * factor;
    }
}

/// Subtracts multiples of four columns from two. By itself, so that the compiler knows that none is another.
#[inline(never)]
fn subtract_four(one: &mut [f64], two: &mut [f64], from: [&[f64]; 4], factors: [[f64; 4]; 2]) {
    let n = one.len();
    let two = &mut two[..n];
    let [a, b, c, d] = from.map(|column| &column[..n]);
    let [x, y] = factors;
    for i in 0..n {
        one[i] -= (a[i] * x[0] + b[i] * x[1]) + (c[i] * x[2] + d[i] * x[3]);
        two[i] -= (a[i] * y[0] + b[i] * y[1]) + (c[i] * y[2] + d[i] * y[3]);
    }
}

/// An index as it is stored; factors of patches have fewer than 2^32 entries.
fn index(at: usize) -> u32 {
    u32::try_from(at).unwrap_or(NONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Off-diagonal entries of a grid of triangles `m` wide, with a vertex that touches a whole row.
    fn grid(m: u32, n: u32) -> (u32, Vec<[u32; 2]>) {
        let mut pairs = Vec::new();
        for v in 0..m * n {
            let (i, j) = (v % m, v / m);
            if i + 1 < m {
                pairs.push([v + 1, v]);
            }
            if j + 1 < n {
                pairs.push([v, v + m]);
            }
            if i + 1 < m && j + 1 < n {
                pairs.push([v, v + m + 1]);
            }
        }
        pairs.extend((0..m).map(|i| [m * n, i]));
        (m * n + 1, pairs)
    }

    #[test]
    fn the_solution_is_that_of_the_equations() {
        for (count, pairs) in [grid(40, 25), grid(3, 1), grid(1, 200), (1, Vec::new())] {
            let (mut matrix, places, slots) = Cholesky::analyse(count, &pairs);
            let mut right: Vec<DVec2> = Vec::new();
            for round in 1..3u32 {
                let weight = |k: usize| f64::from((index(k) * 7919 * round) % 101 + 1);
                let solution = |v: u32| DVec2::new(weight(v as usize), f64::from(v));
                matrix.clear();
                right.clear();
                right.resize(count as usize, DVec2::ZERO);
                for v in 0..count {
                    let place = places[v as usize];
                    matrix.add_diagonal(place, 0.5);
                    right[place as usize] += 0.5 * solution(v);
                }
                for (k, (&[a, b], &slot)) in pairs.iter().zip(&slots).enumerate() {
                    let pull = weight(k) * (solution(a) - solution(b));
                    for (v, pull) in [(a, pull), (b, -pull)] {
                        matrix.add_diagonal(places[v as usize], weight(k));
                        right[places[v as usize] as usize] += pull;
                    }
                    matrix.set(slot, -weight(k));
                }
                matrix.factorize();
                matrix.solve(&mut right);
                for v in 0..count {
                    let found = right[places[v as usize] as usize];
                    assert!(found.distance(solution(v)) < 1e-9, "{v}: {found}");
                }
            }
        }
    }
}
