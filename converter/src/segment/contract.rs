//! Bottom-up grouping of cells by edge contraction, cheapest merge first.
//!
//! Ward's linkage (Ward, "Hierarchical grouping to optimize an objective function", 1963) in (x, s·n): position, and normal
//! scaled by the side s of a region of mean area; a merge costs what it adds to the area-weighted variance. Every merge
//! obeys the link condition of [`super::complex`], so whatever the shape, the result is the dual of a triangulation.
//!
//! Large inputs first go through rounds of greedy matching along a Morton curve, then one heap decides. A merge refused
//! there is dropped; it is pushed again only by the contraction that may have made it possible: of two cells whose
//! common neighbours are the pair (one common neighbour less), or beside a cell whose degree fell to the cap.
//! Limit: greedy; the count stays above the goal where topology or the caps forbid every merge left.

use super::complex::{Complex, id};
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Up to this many cells the heap alone decides.
const HEAP_CELLS: usize = 20_000;
/// Regions below this share of the mean area are merged even below the goal.
const SMALL: f64 = 0.1;

/// Area-weighted mean of a piece of surface.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cell {
    /// Mean position.
    pub(super) centroid: DVec3,
    /// Mean normal, length 0 to 1.
    pub(super) normal: DVec3,
    /// Area, positive.
    pub(super) area: f64,
}

impl Cell {
    /// Both cells as one.
    pub(super) fn merged(self, other: Self) -> Self {
        let area = self.area + other.area;
        let share = other.area / area;
        Self {
            centroid: self.centroid + (other.centroid - self.centroid) * share,
            normal: self.normal + (other.normal - self.normal) * share,
            area,
        }
    }
}

/// Cells of a closed surface, merged step by step. Cells from `cells.len()` on are virtual: they never merge.
#[derive(Debug)]
pub(super) struct Partition {
    complex: Complex,
    cells: Vec<Cell>,
    /// Cell that each cell was merged into, or itself.
    into: Vec<u32>,
    /// Grows with every merge into the cell.
    version: Vec<u32>,
    locked: Vec<bool>,
}

/// How many regions a component should become.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// Wanted number of regions.
    pub(super) regions: usize,
    /// Mean area of a region then.
    pub(super) mean_area: f64,
}

/// What a merge may make.
#[derive(Debug, Clone, Copy)]
struct Caps {
    degree: u32,
    /// In mean areas.
    area: f64,
    /// Only merges of a cell below [`SMALL`].
    small_only: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Merge {
    /// Bits of a non-negative `f32`, which order as it does.
    cost: u32,
    cells: [u32; 2],
    versions: u32,
}

impl Partition {
    /// Starts with every cell on its own.
    pub(super) fn new(complex: Complex, cells: Vec<Cell>) -> Self {
        let into = (0..id(cells.len())).collect();
        let version = vec![0; cells.len()];
        let locked = vec![false; cells.len()];
        Self {
            complex,
            cells,
            into,
            version,
            locked,
        }
    }

    /// Keeps a cell from being merged.
    pub(super) fn lock(&mut self, cell: u32) {
        self.locked[cell as usize] = true;
    }

    /// Cell that holds each original cell.
    pub(super) fn into_holders(mut self) -> Vec<u32> {
        for start in 0..id(self.into.len()) {
            let mut root = start;
            while self.into[root as usize] != root {
                root = self.into[root as usize];
            }
            let mut v = start;
            while v != root {
                v = std::mem::replace(&mut self.into[v as usize], root);
            }
        }
        self.into
    }

    /// Merges the `members` of one component, which has `virtuals` virtual cells besides, down to the goal.
    pub(super) fn reduce(&mut self, mut members: Vec<u32>, virtuals: usize, goal: Goal) {
        let enough = HEAP_CELLS.max(goal.regions * 64);
        while members.len() > enough {
            let before = members.len();
            self.match_once(&mut members, goal, enough);
            if members.len() * 20 > before * 19 {
                break;
            }
        }
        let caps = |degree, area, small_only| Caps {
            degree,
            area,
            small_only,
        };
        let n = goal.regions;
        let stages = [
            (n * 4, n * 4, caps(24, 1.0, false)),
            (n * 2, n * 2, caps(16, 1.5, false)),
            (n, n, caps(10, 2.5, false)),
            // Stuck well above the goal: rather larger and many-sided regions than many.
            (n * 5 / 4, n, caps(12, 4.0, false)),
            (n * 2, n * 3 / 2, caps(16, 8.0, false)),
            (n * 3, n * 2, caps(24, 1e30, false)),
            (0, 0, caps(24, 4.0, true)),
        ];
        for (above, stop, caps) in stages {
            if members.len() > above {
                self.drain(&mut members, virtuals, stop, caps, goal);
            }
        }
    }

    /// One round: every cell, along the curve, with its cheapest partner that has none yet.
    fn match_once(&mut self, members: &mut Vec<u32>, goal: Goal, enough: usize) {
        let mut taken = vec![false; self.cells.len()];
        let mut left = members.len();
        let mut partners: Vec<(u32, u32)> = Vec::new();
        for &u in &*members {
            if left <= enough {
                break;
            }
            if taken[u as usize] {
                continue;
            }
            partners.clear();
            for &v in self.complex.neighbours(u) {
                if self.is_real(v)
                    && !taken[v as usize]
                    && !self.locked[u as usize]
                    && !self.locked[v as usize]
                    && self.degree_merged(u, v) <= 24
                {
                    partners.push((self.cost(u, v, goal), v));
                }
            }
            partners.sort_unstable();
            let found = partners
                .iter()
                .find_map(|&(_, v)| self.complex.link(u, v).map(|common| (v, common)));
            if let Some((v, common)) = found {
                self.merge(u, v, common);
                taken[u as usize] = true;
                taken[v as usize] = true;
                left -= 1;
            }
        }
        members.retain(|&v| self.into[v as usize] == v);
    }

    /// Cheapest merges within `caps` until `stop` members are left or no merge is.
    fn drain(
        &mut self,
        members: &mut Vec<u32>,
        virtuals: usize,
        stop: usize,
        caps: Caps,
        goal: Goal,
    ) {
        let mut heap = BinaryHeap::new();
        for &u in &*members {
            for &v in self.complex.neighbours(u) {
                if u < v {
                    heap.extend(self.candidate(u, v, caps, goal));
                }
            }
        }
        let mut left = members.len();
        // A tetrahedron is the smallest closed surface.
        while left > stop && left + virtuals > 4 {
            let Some(Reverse(Merge {
                cells: [u, v],
                versions,
                ..
            })) = heap.pop()
            else {
                break;
            };
            if self.into[u as usize] != u
                || self.into[v as usize] != v
                || self.versions(u, v) != versions
                || self.degree_merged(u, v) > caps.degree
            {
                continue;
            }
            let Some(common) = self.complex.link(u, v) else {
                continue;
            };
            self.merge(u, v, common);
            left -= 1;
            for &w in self.complex.neighbours(u) {
                heap.extend(self.candidate(u, w, caps, goal));
            }
            let [a, b] = common;
            if self.complex.adjacent(a, b) {
                heap.extend(self.candidate(a, b, caps, goal));
            }
            for a in common.into_iter().filter(|&a| self.is_real(a)) {
                for &w in self.complex.neighbours(a) {
                    if w != u && self.degree_merged(a, w) == caps.degree {
                        heap.extend(self.candidate(a, w, caps, goal));
                    }
                }
            }
        }
        members.retain(|&v| self.into[v as usize] == v);
    }

    fn is_real(&self, v: u32) -> bool {
        (v as usize) < self.cells.len()
    }

    fn degree_merged(&self, u: u32, v: u32) -> u32 {
        (self.complex.degree(u) + self.complex.degree(v)).saturating_sub(4)
    }

    fn versions(&self, u: u32, v: u32) -> u32 {
        self.version[u as usize].wrapping_add(self.version[v as usize])
    }

    fn candidate(&self, u: u32, v: u32, caps: Caps, goal: Goal) -> Option<Reverse<Merge>> {
        if !self.is_real(u)
            || !self.is_real(v)
            || self.locked[u as usize]
            || self.locked[v as usize]
        {
            return None;
        }
        let (p, q) = (self.cells[u as usize].area, self.cells[v as usize].area);
        let allowed = p + q <= caps.area * goal.mean_area
            && (!caps.small_only || p.min(q) < SMALL * goal.mean_area);
        // Degrees are looked at when the merge is due; by then they may have fallen.
        allowed.then(|| {
            Reverse(Merge {
                cost: self.cost(u, v, goal),
                cells: [u.min(v), u.max(v)],
                versions: self.versions(u, v),
            })
        })
    }

    /// Added variance, in units of a mean region's, as ordered bits.
    fn cost(&self, u: u32, v: u32, goal: Goal) -> u32 {
        let (p, q) = (&self.cells[u as usize], &self.cells[v as usize]);
        let weight = p.area / (p.area + q.area) * q.area / goal.mean_area;
        let apart = p.centroid.distance_squared(q.centroid) / goal.mean_area
            + p.normal.distance_squared(q.normal);
        // Beyond 60 degrees between mean normals there is a crease between the two, or both are crumpled.
        let crease = 1.0 + 2.0 * (0.5 - p.normal.dot(q.normal)).max(0.0);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "infinity is as good as any cost beyond f32"
        )]
        let cost = (weight * apart * crease) as f32;
        cost.max(0.0).to_bits()
    }

    fn merge(&mut self, keep: u32, gone: u32, common: [u32; 2]) {
        self.complex.contract(keep, gone, common);
        self.cells[keep as usize] = self.cells[keep as usize].merged(self.cells[gone as usize]);
        self.into[gone as usize] = keep;
        self.version[keep as usize] = self.version[keep as usize].wrapping_add(1);
    }
}
