//! Which vertex of a simplified mesh each vertex of the original has become.
//!
//! A mesh that edges were collapsed in is the original with each vertex at the place of the one that it was collapsed to: triangles with two
//! corners at one place are gone, and those left are the simplified mesh's. So a surface can move from the one to the other without a
//! jump (Hoppe, "Progressive Meshes", 1996). The simplifier does not say what it collapsed to what, but it is found again. At
//! first every vertex goes to the nearest along edges that was kept. The simplifier keeps triangles, and corners of triangles, in order,
//! so those left are matched with those that they came of, in order, such that as many corners as can be have become what is thought;
//! corners of matched triangles have become those of their matches, and the others go to the nearest such; then vertices around faults (triangles
//! that the simplified mesh does not have, and its own that nothing has become) go where fewer are left. Both are done again while there are fewer.
//!
//! Limit: what is found need not be without faults; then both meshes differ in the triangles around.

use super::became::Became;
use super::shape::{Shape, point};
use crate::mesh::adjacency::id;
use marquetry_format::LatticePoint;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// How often all of it is done, at most.
const ROUNDS: usize = 6;
/// Matches of all triangles left, at most.
const MATCHES: usize = 12;
/// Sweeps over all vertices, at most.
const SWEEPS: usize = 12;
/// No vertex.
const NONE: u32 = u32::MAX;

/// What the vertices of `fine` have become in `coarse`, whose vertices are some of them, and its triangles in the order of those that they came of.
pub(super) fn traced(fine: &Shape, coarse: &Shape) -> Became {
    let mut trace = Trace::new(fine, coarse);
    trace.flood();
    let (mut best, mut least) = (trace.became.clone(), trace.all_faults());
    for _ in 0..ROUNDS {
        if least == 0 {
            break;
        }
        trace.match_all();
        trace.sweep_all();
        let faults = trace.all_faults();
        if faults >= least {
            break;
        }
        (best, least) = (trace.became.clone(), faults);
    }
    trace.became = best;
    let places = trace.places.iter().zip(&trace.became);
    let known = places.filter(|(_, became)| **became != NONE);
    Became::others(
        known
            .map(|(&place, &became)| (place, trace.places[became as usize]))
            .collect(),
    )
}

struct Trace {
    /// Of all vertices, each place once.
    places: Vec<LatticePoint>,
    /// Corners by number of the place.
    triangles: Vec<[u32; 3]>,
    /// By place: the triangles around.
    around: Vec<Vec<u32>>,
    is_kept: Vec<bool>,
    /// By place: the place that it has become.
    became: Vec<u32>,
    /// Corners of the simplified mesh, in order.
    left: Vec<[u32; 3]>,
    /// Of the simplified mesh, the least corner first: how often a triangle has become it.
    wanted: HashMap<[u32; 3], u32>,
}

impl Trace {
    fn new(fine: &Shape, coarse: &Shape) -> Self {
        let (places, number_of) = fine.places();
        let numbers: HashMap<LatticePoint, u32> = places.iter().copied().zip(0..).collect();
        let triangles: Vec<[u32; 3]> = (fine.triangles.iter())
            .map(|t| t.map(|v| number_of[v as usize]))
            .collect();
        let mut around = vec![Vec::new(); places.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for &v in corners {
                around[v as usize].push(id(t));
            }
        }
        let kept = |v: u32| numbers.get(&coarse.vertices[v as usize].0).copied();
        let corners = |t: &[u32; 3]| {
            let [a, b, c] = t.map(kept);
            Some([a?, b?, c?])
        };
        let left: Vec<[u32; 3]> = coarse.triangles.iter().filter_map(corners).collect();
        let mut trace = Self {
            became: vec![NONE; places.len()],
            is_kept: vec![false; places.len()],
            places,
            triangles,
            around,
            wanted: left.iter().map(|&t| (from_least(t), 0)).collect(),
            left,
        };
        for &v in trace.left.as_flattened() {
            trace.is_kept[v as usize] = true;
            trace.became[v as usize] = v;
        }
        trace
    }

    /// Every vertex of which it is not thought what it became becomes what the nearest along edges did of which it is.
    fn flood(&mut self) {
        let mut queue: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
        let thought = self.became.iter().enumerate();
        for (v, &became) in thought.filter(|(_, became)| **became != NONE) {
            queue.push(Reverse((0, id(v), became)));
        }
        let mut is_reached = vec![false; self.places.len()];
        while let Some(Reverse((length, v, became))) = queue.pop() {
            if std::mem::replace(&mut is_reached[v as usize], true) {
                continue;
            }
            self.became[v as usize] = became;
            for &t in &self.around[v as usize] {
                for next in self.triangles[t as usize] {
                    if !is_reached[next as usize] {
                        let [from, to] = [v, next].map(|v| point(self.places[v as usize]));
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "lengths on the lattice"
                        )]
                        let edge = (16.0 * from.distance(to)) as u64;
                        queue.push(Reverse((length + edge, next, became)));
                    }
                }
            }
        }
        self.count_all();
    }

    /// Triangles by number of those left that came of them, both ascending: of all such matches one with the most corners that have become what is thought
    /// (kept ones, which cannot be wrong, twice). A heaviest increasing subsequence.
    fn matched(&self) -> Vec<(u32, u32)> {
        let mut by_corner = vec![Vec::new(); 3 * self.places.len()];
        for (t, corners) in (0..).zip(&self.triangles) {
            for (k, &v) in corners.iter().enumerate() {
                let became = self.became[v as usize];
                if became != NONE {
                    by_corner[3 * became as usize + k].push(t);
                }
            }
        }
        // Matches so far: triangle, the one left, corners of the best chain that ends here, the link before.
        let mut links: Vec<(u32, u32, u32, u32)> = Vec::new();
        // By how many triangles come first: the best chain among them, in a binary indexed tree.
        let mut best = vec![NONE; self.triangles.len() + 1];
        let corners_of = |links: &[(u32, u32, u32, u32)], link: u32| {
            links.get(link as usize).map_or(0, |link| link.2)
        };
        let mut candidates = Vec::new();
        for (number, left) in (0..).zip(&self.left) {
            candidates.clear();
            for (k, &corner) in left.iter().enumerate() {
                candidates.extend_from_slice(&by_corner[3 * corner as usize + k]);
            }
            candidates.sort_unstable();
            candidates.dedup();
            let ends_before = links.len();
            for &t in &candidates {
                let Some(corners) = self.agreement(t, *left) else {
                    continue;
                };
                let (mut before, mut at) = (NONE, t as usize);
                while at > 0 {
                    if corners_of(&links, best[at]) > corners_of(&links, before) {
                        before = best[at];
                    }
                    at &= at - 1;
                }
                links.push((t, number, corners + corners_of(&links, before), before));
            }
            for link in ends_before..links.len() {
                let (t, _, corners, _) = links[link];
                let mut at = t as usize + 1;
                while at < best.len() {
                    if corners > corners_of(&links, best[at]) {
                        best[at] = id(link);
                    }
                    at += at & at.wrapping_neg();
                }
            }
        }
        let mut chain = Vec::new();
        let last = (0..id(links.len())).max_by_key(|&link| corners_of(&links, link));
        let mut next = last.unwrap_or(NONE);
        while let Some(&(t, number, _, before)) = links.get(next as usize) {
            chain.push((t, number));
            next = before;
        }
        chain.reverse();
        chain
    }

    /// Corners of a triangle that have become those of `left`, kept ones twice; `None` where one was kept and is not there.
    fn agreement(&self, t: u32, left: [u32; 3]) -> Option<u32> {
        let mut corners = 0;
        for (v, corner) in self.triangles[t as usize].into_iter().zip(left) {
            let is_same = self.became[v as usize] == corner;
            match (self.is_kept[v as usize], is_same) {
                (true, false) => return None,
                (is_kept, true) => corners += 1 + u32::from(is_kept),
                (false, false) => {}
            }
        }
        Some(corners)
    }

    /// Matches while that leaves fewer faults, at least once.
    fn match_all(&mut self) {
        let mut least = usize::MAX;
        for _ in 0..MATCHES {
            let before = self.became.clone();
            self.believe(&self.matched());
            self.flood();
            let faults = self.all_faults();
            if faults >= least {
                self.became = before;
                self.count_all();
                break;
            }
            least = faults;
        }
    }

    /// Sweeps while that gets anywhere.
    fn sweep_all(&mut self) {
        for sweep in 0..SWEEPS {
            if !self.sweep(sweep % 2 == 1) {
                break;
            }
        }
    }

    /// What the corners of matched triangles have become is what most say; of the other vertices nothing is thought but of the kept ones.
    fn believe(&mut self, matched: &[(u32, u32)]) {
        let mut votes: Vec<(u32, u32)> = Vec::with_capacity(3 * matched.len());
        for &(t, number) in matched {
            votes.extend(
                self.triangles[t as usize]
                    .into_iter()
                    .zip(self.left[number as usize]),
            );
        }
        votes.sort_unstable();
        for (became, &is_kept) in self.became.iter_mut().zip(&self.is_kept) {
            if !is_kept {
                *became = NONE;
            }
        }
        let mut most = (NONE, 0);
        for same in votes.chunk_by(|a, b| a == b) {
            let (v, corner) = same[0];
            if v != most.0 || same.len() > most.1 {
                self.became[v as usize] = corner;
                most = (v, same.len());
            }
        }
    }

    fn count_all(&mut self) {
        self.wanted.values_mut().for_each(|count| *count = 0);
        for t in 0..self.triangles.len() {
            self.count(t, 1);
        }
    }

    /// Triangles that nobody wants or that another has become as well, and those wanted that none has become.
    fn all_faults(&self) -> usize {
        let now = (0..self.triangles.len()).filter_map(|t| self.now(t));
        let wrong = now.filter(|now| self.wanted.get(now) != Some(&1)).count();
        wrong + self.wanted.values().filter(|count| **count == 0).count()
    }

    /// What a triangle has become; `None` where that is flat.
    fn now(&self, t: usize) -> Option<[u32; 3]> {
        let [a, b, c] = self.triangles[t].map(|v| self.became[v as usize]);
        (a != b && b != c && c != a).then(|| from_least([a, b, c]))
    }

    /// Counts a triangle in, or out with -1.
    fn count(&mut self, t: usize, by: i32) {
        if let Some(count) = self.now(t).and_then(|now| self.wanted.get_mut(&now)) {
            *count = count.wrapping_add_signed(by);
        }
    }

    /// Faults that the triangles around `v` have: those that nobody wants or that another has become as well, less those wanted that one has become.
    fn faults(&mut self, v: u32) -> i32 {
        let around = std::mem::take(&mut self.around[v as usize]);
        for &t in &around {
            self.count(t as usize, -1);
        }
        let mut faults = 0;
        for &t in &around {
            if let Some(now) = self.now(t as usize) {
                faults += match self.wanted.get(&now) {
                    Some(0) => -1,
                    _ => 1,
                };
            }
            self.count(t as usize, 1);
        }
        self.around[v as usize] = around;
        faults
    }

    fn becomes(&mut self, v: u32, became: u32) {
        let around = std::mem::take(&mut self.around[v as usize]);
        for &t in &around {
            self.count(t as usize, -1);
        }
        self.became[v as usize] = became;
        for &t in &around {
            self.count(t as usize, 1);
        }
        self.around[v as usize] = around;
    }

    /// Lets every vertex that was not kept become what leaves the fewest faults around it, of what its neighbours have become; of equal ones another than now
    /// if it `wanders`. Whether there may be more to gain.
    fn sweep(&mut self, wanders: bool) -> bool {
        let mut changes = false;
        for v in 0..id(self.places.len()) {
            if self.is_kept[v as usize] || self.became[v as usize] == NONE {
                continue;
            }
            let is_sound = self.around[v as usize].iter().all(|&t| {
                let now = self.now(t as usize);
                now.is_none_or(|now| self.wanted.get(&now) == Some(&1))
            });
            if is_sound {
                continue;
            }
            let own = self.became[v as usize];
            let mut choices: Vec<u32> = (self.around[v as usize].iter())
                .flat_map(|&t| self.triangles[t as usize])
                .map(|neighbour| self.became[neighbour as usize])
                .collect();
            choices.sort_unstable();
            choices.dedup();
            let mut best = (self.faults(v), !wanders, own);
            for choice in choices {
                if choice == own || choice == NONE {
                    continue;
                }
                self.becomes(v, choice);
                let faults = self.faults(v);
                if faults < best.0 || (faults == best.0 && !best.1) {
                    best = (faults, true, choice);
                }
            }
            self.becomes(v, best.2);
            changes |= best.2 != own;
        }
        changes
    }
}

/// The same triangle, its least corner first.
fn from_least([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 24;

    /// A hilly square of SIDE² vertices; vertices `at` moved to where they are told to.
    fn hills(at: impl Fn(u32) -> u32) -> Shape {
        let vertex = |v: u32| {
            let [x, y] = [at(v) % SIDE, at(v) / SIDE];
            (
                [100 * x + 7 * y, 90 * y, 10 * (x * x + 3 * y) % 170],
                [0; 2],
                [0; 3],
            )
        };
        let mut shape = Shape::default();
        for k in 0..(SIDE - 1).pow(2) {
            let a = k / (SIDE - 1) * SIDE + k % (SIDE - 1);
            shape.triangle([a, a + 1, a + SIDE + 1].map(vertex));
            shape.triangle([a, a + SIDE + 1, a + SIDE].map(vertex));
        }
        shape
    }

    /// Collapses most vertices to a neighbour that was kept, at random; what each became.
    fn collapses() -> Vec<u32> {
        let mut seed = 7u64;
        let mut random = |below: u32| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            u32::try_from((seed >> 33) % u64::from(below)).unwrap()
        };
        let mut became: Vec<u32> = (0..SIDE * SIDE).collect();
        for _ in 0..400 {
            let (x, y) = (1 + random(SIDE - 2), 1 + random(SIDE - 2));
            let [dx, dy] = [[0, 1], [1, 0], [1, 2], [2, 1], [0, 0], [2, 2]][random(6) as usize];
            let (from, to) = (y * SIDE + x, (y + dy - 1) * SIDE + x + dx - 1);
            let is_whole = became[from as usize] == from
                && became[to as usize] == to
                && became.iter().filter(|&&v| v == from).count() == 1;
            if is_whole {
                became[from as usize] = to;
            }
        }
        became
    }

    #[test]
    fn collapses_are_found_again() {
        let became = collapses();
        let gone = (0..).zip(&became).filter(|(v, to)| v != *to).count();
        assert!(gone > 100, "{gone}");
        let (fine, coarse) = (hills(|v| v), hills(|v| became[v as usize]));
        let found = traced(&fine, &coarse);
        // With everything at what it has become there are the triangles of the simplified mesh and no others.
        let corners = |shape: &Shape, to: &dyn Fn(LatticePoint) -> LatticePoint| {
            let mut all: Vec<[LatticePoint; 3]> = (shape.triangles.iter())
                .map(|t| t.map(|v| to(shape.vertices[v as usize].0)))
                .filter(|[a, b, c]| a != b && b != c && c != a)
                .map(|[a, b, c]| {
                    let least = a.min(b).min(c);
                    if a == least {
                        [a, b, c]
                    } else if b == least {
                        [b, c, a]
                    } else {
                        [c, a, b]
                    }
                })
                .collect();
            all.sort_unstable();
            all
        };
        let wanted = corners(&coarse, &|place| place);
        let got = corners(&fine, &|place| found.of(place).unwrap());
        assert_eq!(got, wanted);
    }
}
