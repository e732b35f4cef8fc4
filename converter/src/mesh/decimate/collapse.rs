//! Edge collapses in a block of triangles, the shortest edges first.

use super::super::NONE;
use super::super::adjacency::id;
use super::change::{Change, opposite};
use super::quadric::Quadric;
use glam::{DVec3, Vec3};
use marquetry_evaluation::distance::Bvh;

/// What collapses may do; lengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Edges from this length on stay.
    pub(super) edge: f64,
    /// Root of the mean squared distance from the planes and normals of all triangles merged at a vertex.
    pub(super) rms: f64,
    /// What a unit of normal is in that.
    pub(super) normals: f64,
    /// Guaranteed distance.
    pub(super) bound: f64,
    /// Whether some of the vertices taken away are measured.
    pub(super) notes_gone: bool,
}

/// A block after its collapses.
#[derive(Debug, Default)]
pub(super) struct Collapsed {
    /// Triangles that are left, vertices numbered as before.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Those of its vertices that went to other places.
    pub(super) moved: Vec<Moved>,
    /// Bound of the distance between what was and what is.
    pub(super) bound: f64,
    /// Some of the vertices that were taken away.
    pub(super) gone: Vec<DVec3>,
    /// Sum of their squared distances from what is left.
    pub(super) squares: f64,
}

/// A vertex that several became.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    pub(super) vertex: u32,
    pub(super) place: DVec3,
    /// The mean of those that there were, as they go on to there; of length 1 or zero.
    pub(super) normal: Vec3,
}

/// Rounds of collapses, at most; the last ones find little.
const MOST_ROUNDS: u32 = 16;
/// A round with fewer collapses than one for so many vertices is the last.
const FEWEST: usize = 500;
/// One of so many vertices taken away is noted.
const NOTED: usize = 8;

/// Collapses short edges of `triangles`; vertices that are shared or on borders stay where they are. Without `normals` of all vertices these
/// count for nothing.
pub(super) fn collapse(
    positions: &[DVec3],
    normals: &[Vec3],
    triangles: &[[u32; 3]],
    is_shared: impl Fn(u32) -> bool,
    limits: Limits,
) -> Collapsed {
    let mut ids: Vec<u32> = triangles.as_flattened().to_vec();
    ids.sort_unstable();
    ids.dedup();
    let origin = ids.first().map_or(DVec3::ZERO, |&v| positions[v as usize]);
    let places: Vec<DVec3> = ids
        .iter()
        .map(|&v| positions[v as usize] - origin)
        .collect();
    let local = |v: u32| ids.binary_search(&v).map_or(NONE, id);
    let own: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(local)).collect();
    let normals: Vec<DVec3> = (ids.iter())
        .map(|&v| {
            normals
                .get(v as usize)
                .map_or(DVec3::ZERO, |n| limits.normals * n.as_dvec3())
        })
        .collect();
    let mut block = Block::new(places, &normals, own, limits);
    for (v, &global) in ids.iter().enumerate() {
        block.held[v] = is_shared(global) || !block.is_inside(id(v));
    }
    let before = block.positions.clone();
    block.run();

    let mut collapsed = Collapsed::default();
    let mut left = vec![false; ids.len()];
    let alive: Vec<[u32; 3]> = (block.triangles.iter().copied())
        .filter(|t| t[0] != NONE)
        .collect();
    for &v in alive.as_flattened() {
        left[v as usize] = true;
    }
    if limits.notes_gone
        && let Ok(tree) = Bvh::new(&block.positions, &alive)
    {
        for v in (0..ids.len()).filter(|&v| !left[v]).step_by(NOTED) {
            let closest = tree.closest(before[v], f64::INFINITY);
            collapsed.squares += closest.map_or(0.0, |closest| closest.distance2);
            collapsed.gone.push(before[v] + origin);
        }
    }
    for (v, &global) in ids.iter().enumerate().filter(|&(v, _)| left[v]) {
        if block.positions[v] != before[v] {
            let place = block.positions[v];
            collapsed.moved.push(Moved {
                vertex: global,
                place: place + origin,
                normal: block.quadrics[v].normal(place).as_vec3(),
            });
        }
    }
    collapsed.triangles = alive.iter().map(|t| t.map(|v| ids[v as usize])).collect();
    let largest = block.errors.iter().copied().fold(0.0, f32::max);
    collapsed.bound = f64::from(largest);
    collapsed
}

/// The ends of an edge, ordered by its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    /// Bits of the length, as f32: ordered like the length.
    length: u32,
    ends: [u32; 2],
}

/// Triangles that edges are collapsed of.
pub(super) struct Block {
    pub(super) positions: Vec<DVec3>,
    /// Those taken away have no corners.
    pub(super) triangles: Vec<[u32; 3]>,
    /// A corner (3 × triangle + number) of each vertex; those of triangles taken away may be among them.
    first: Vec<u32>,
    /// By corner, the next one of its vertex.
    following: Vec<u32>,
    pub(super) quadrics: Vec<Quadric>,
    /// By triangle, bound of its distance from the source.
    pub(super) errors: Vec<f32>,
    pub(super) held: Vec<bool>,
    /// By vertex, the last round in which a triangle around it changed.
    changed: Vec<u32>,
    pub(super) limits: Limits,
}

impl Block {
    fn new(
        positions: Vec<DVec3>,
        normals: &[DVec3],
        triangles: Vec<[u32; 3]>,
        limits: Limits,
    ) -> Self {
        let mut first = vec![NONE; positions.len()];
        let mut following = vec![NONE; 3 * triangles.len()];
        let mut quadrics = vec![Quadric::default(); positions.len()];
        for (t, corners) in triangles.iter().enumerate() {
            let plane = Quadric::of(
                corners.map(|v| positions[v as usize]),
                corners.map(|v| normals[v as usize]),
            );
            for (k, &v) in corners.iter().enumerate() {
                let corner = id(3 * t + k);
                following[corner as usize] = first[v as usize];
                first[v as usize] = corner;
                quadrics[v as usize] += plane;
            }
        }
        Self {
            errors: vec![0.0; triangles.len()],
            held: vec![false; positions.len()],
            changed: vec![0; positions.len()],
            positions,
            triangles,
            first,
            following,
            quadrics,
            limits,
        }
    }

    /// The triangles around a vertex.
    pub(super) fn around(&self, v: u32, star: &mut Vec<u32>) {
        star.clear();
        let mut corner = self.first[v as usize];
        while corner != NONE {
            if self.triangles[corner as usize / 3][corner as usize % 3] == v {
                star.push(corner / 3);
            }
            corner = self.following[corner as usize];
        }
    }

    /// Whether the triangles around a vertex close around it, once.
    fn is_inside(&self, v: u32) -> bool {
        let mut star = Vec::new();
        self.around(v, &mut star);
        let edges: Vec<[u32; 2]> = (star.iter())
            .map(|&t| opposite(self.triangles[t as usize], v))
            .collect();
        let Some(&[start, mut at]) = edges.first() else {
            return false;
        };
        let mut steps = 1;
        while at != start && steps <= edges.len() {
            let mut onward = edges.iter().filter(|e| e[0] == at);
            let (Some(edge), None) = (onward.next(), onward.next()) else {
                return false;
            };
            at = edge[1];
            steps += 1;
        }
        at == start && steps == edges.len()
    }

    /// Collapses short edges in rounds, the shortest first; what a collapse touched waits for the next round.
    fn run(&mut self) {
        let mut change = Change::default();
        let mut edges = Vec::new();
        for round in 1..=MOST_ROUNDS {
            self.short_edges(round, &mut edges);
            edges.sort_unstable();
            let mut collapses = 0;
            for &Edge { ends: [a, b], .. } in &edges {
                if self.changed[a as usize] == round || self.changed[b as usize] == round {
                    continue;
                }
                let is_held = self.held[b as usize];
                let (kept, gone) = if is_held { (b, a) } else { (a, b) };
                if change.plan(self, kept, gone) {
                    self.apply(&change, kept, gone, round);
                    collapses += 1;
                }
            }
            if collapses * FEWEST < self.positions.len() {
                break;
            }
        }
    }

    /// The edges that may go in a round: short ones around which something changed in the one before.
    fn short_edges(&self, round: u32, edges: &mut Vec<Edge>) {
        edges.clear();
        let is_new = |v: u32| self.changed[v as usize] + 1 >= round;
        for &[a, b, c] in self.triangles.iter().filter(|t| t[0] != NONE) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                // The other triangle of the edge has it the other way round.
                if from > to || !(is_new(from) || is_new(to)) {
                    continue;
                }
                let both_held = self.held[from as usize] && self.held[to as usize];
                let length = self.positions[from as usize].distance(self.positions[to as usize]);
                if length < self.limits.edge && !both_held {
                    edges.push(Edge {
                        length: as_bits(length),
                        ends: [from, to],
                    });
                }
            }
        }
    }

    fn apply(&mut self, change: &Change, kept: u32, gone: u32, round: u32) {
        self.positions[kept as usize] = change.place;
        let gone_quadric = self.quadrics[gone as usize];
        self.quadrics[kept as usize] += gone_quadric;
        for &t in &change.of_gone {
            let corners = &mut self.triangles[t as usize];
            if corners.contains(&kept) {
                *corners = [NONE; 3];
                continue;
            }
            for (k, v) in corners.iter_mut().enumerate() {
                if *v == gone {
                    *v = kept;
                    let corner = id(3 * t as usize + k);
                    self.following[corner as usize] = self.first[kept as usize];
                    self.first[kept as usize] = corner;
                }
            }
            self.errors[t as usize] = change.error;
        }
        self.first[gone as usize] = NONE;
        if !self.held[kept as usize] {
            for &t in &change.of_kept {
                self.errors[t as usize] = change.error;
            }
        }
        for &v in change.ring.iter().chain([&kept]) {
            self.changed[v as usize] = round;
        }
    }
}

/// The bits of a length at least 0, ordered like it.
#[expect(
    clippy::cast_possible_truncation,
    reason = "an order is all that is asked for"
)]
fn as_bits(length: f64) -> u32 {
    (length as f32).to_bits()
}
