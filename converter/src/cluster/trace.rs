//! Which vertex of a simplified mesh each vertex of the original has become.
//!
//! A mesh that edges were collapsed in is the original with each vertex at the place of the one that it was collapsed to: triangles with two
//! corners at one place are gone, and those left are the simplified mesh's. So a surface can move from the one to the other without a
//! jump (Hoppe, "Progressive Meshes", 1996). The simplifier does not say what it collapsed to what, but it is found again: every
//! vertex goes to the nearest along edges that was kept, and where a triangle comes out that the simplified mesh does not have, or one of
//! its own does not, vertices around there go where fewer such are left, while that gets anywhere.
//!
//! Limit: what is found need not be without faults; then both meshes differ in the triangles around.

use super::shape::{Shape, point};
use crate::mesh::adjacency::id;
use marquetry_format::LatticePoint;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Sweeps over all vertices, at most.
const SWEEPS: usize = 12;
/// No vertex.
const NONE: u32 = u32::MAX;

/// What vertices have become, by place.
#[derive(Debug, Default)]
pub(super) struct Became {
    /// `None`: every one itself.
    places: Option<HashMap<LatticePoint, LatticePoint>>,
}

impl Became {
    /// Nothing was collapsed.
    pub(super) fn itself() -> Self {
        Self { places: None }
    }

    /// The place that a vertex at `place` has become; `None` where that is not known.
    pub(super) fn of(&self, place: LatticePoint) -> Option<LatticePoint> {
        match &self.places {
            Some(places) => places.get(&place).copied(),
            None => Some(place),
        }
    }

    /// Vertices of `coarse` were moved as well, after it was made.
    pub(super) fn and_moved(&mut self, moved: &HashMap<LatticePoint, LatticePoint>) {
        for place in self.places.iter_mut().flat_map(HashMap::values_mut) {
            *place = moved.get(place).copied().unwrap_or(*place);
        }
    }
}

/// What the vertices of `fine` have become in `coarse`, whose vertices are some of them.
pub(super) fn traced(fine: &Shape, coarse: &Shape) -> Became {
    let mut trace = Trace::new(fine, coarse);
    trace.start();
    for sweep in 0..SWEEPS {
        if !trace.sweep(sweep % 2 == 1) {
            break;
        }
    }
    let places = trace.places.iter().zip(&trace.became);
    let known = places.filter(|(_, became)| **became != NONE);
    Became {
        places: Some(
            known
                .map(|(&place, &became)| (place, trace.places[became as usize]))
                .collect(),
        ),
    }
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
            Some(from_least([a?, b?, c?]))
        };
        let wanted: HashMap<[u32; 3], u32> = (coarse.triangles.iter())
            .filter_map(corners)
            .map(|t| (t, 0))
            .collect();
        let mut is_kept = vec![false; places.len()];
        for &v in wanted.keys().flatten() {
            is_kept[v as usize] = true;
        }
        Self {
            became: vec![NONE; places.len()],
            places,
            triangles,
            around,
            is_kept,
            wanted,
        }
    }

    /// Every vertex becomes the nearest along edges.
    fn start(&mut self) {
        let mut queue: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
        for (v, _) in self.is_kept.iter().enumerate().filter(|(_, kept)| **kept) {
            queue.push(Reverse((0, id(v), id(v))));
        }
        while let Some(Reverse((length, v, became))) = queue.pop() {
            if self.became[v as usize] != NONE {
                continue;
            }
            self.became[v as usize] = became;
            for &t in &self.around[v as usize] {
                for next in self.triangles[t as usize] {
                    if self.became[next as usize] == NONE {
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
        for t in 0..self.triangles.len() {
            self.count(t, 1);
        }
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
        // With everything at what it has become there are the triangles of the simplified mesh, and hardly others.
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
        let same = got
            .iter()
            .filter(|t| wanted.binary_search(t).is_ok())
            .count();
        assert!(50 * same >= 49 * wanted.len(), "{same} of {}", wanted.len());
        assert!(got.len() <= wanted.len() + wanted.len() / 50);
    }

    #[test]
    fn what_is_moved_later_is_moved_in_it() {
        let fine = hills(|v| v);
        let mut became = traced(&fine, &fine);
        let (from, to) = (fine.vertices[5].0, [1, 2, 3]);
        assert_eq!(became.of(from), Some(from));
        became.and_moved(&HashMap::from([(from, to)]));
        assert_eq!(became.of(from), Some(to));
        assert_eq!(became.of(fine.vertices[6].0), Some(fine.vertices[6].0));
        assert_eq!(became.of([9, 9, 9]), None);
        assert_eq!(Became::itself().of([9, 9, 9]), Some([9, 9, 9]));
    }
}
