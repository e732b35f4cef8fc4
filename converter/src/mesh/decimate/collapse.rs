//! Edge collapses in a block of triangles, with a guaranteed distance.
//!
//! What a collapse takes away and what it puts in its place have the same border. Both are projected along their mean normal;
//! where no triangle is turned over by that, each point of one has a point of the other above or below it, and their
//! distance along the normal is linear on every cell of the overlay of both: it is largest at a corner of the overlay, that
//! is at an inner vertex of either, or where edges cross. The same is true where what is taken away is folded, as
//! long as it does not reach over the border: it then has several points above or below one, and the farthest counts.
//! Such distances add up from collapse to collapse.

use super::super::NONE;
use super::super::adjacency::id;
use super::quadric::Quadric;
use glam::{DVec2, DVec3};
use marquetry_evaluation::distance::Bvh;

/// What collapses may do; lengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Edges from this length on stay.
    pub(super) edge: f64,
    /// Root of the mean squared distance from the planes of all triangles merged at a vertex.
    pub(super) rms: f64,
    /// Guaranteed distance.
    pub(super) bound: f64,
}

/// A block after its collapses.
#[derive(Debug, Default)]
pub(super) struct Collapsed {
    /// Triangles that are left, vertices numbered as before.
    pub(super) triangles: Vec<[u32; 3]>,
    /// New places of vertices that are left.
    pub(super) moved: Vec<(u32, DVec3)>,
    /// Bound of the distance between what was and what is.
    pub(super) bound: f64,
    /// Some of the vertices that were taken away.
    pub(super) gone: Vec<DVec3>,
    /// Sum of their squared distances from what is left.
    pub(super) squares: f64,
}

/// Most triangles around a vertex.
const MOST_AROUND: usize = 10;
/// Rounds of collapses, at most; the last ones find little.
const MOST_ROUNDS: u32 = 16;
/// A round with fewer collapses than one for so many vertices is the last.
const FEWEST: usize = 500;
/// Cosine of the angle between a triangle and the mean normal that a collapse may always leave.
const COSINE: f64 = 0.3;
/// One that it never goes below.
const LEAST_COSINE: f64 = 0.1;
/// Twice the area over the square of the longest edge that a collapse may always leave (0.87 of an equilateral triangle).
const SHAPE: f64 = 0.1;
/// One of so many vertices taken away is noted.
const NOTED: usize = 8;

/// Collapses short edges of `triangles`; vertices that are shared or on borders stay where they are.
pub(super) fn collapse(
    positions: &[DVec3],
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
    let mut block = Block::new(places, own, limits);
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
    if let Ok(tree) = Bvh::new(&block.positions, &alive) {
        for v in (0..ids.len()).filter(|&v| !left[v]).step_by(NOTED) {
            let closest = tree.closest(before[v], f64::INFINITY);
            collapsed.squares += closest.map_or(0.0, |closest| closest.distance2);
            collapsed.gone.push(before[v] + origin);
        }
    }
    for (v, &global) in ids.iter().enumerate().filter(|&(v, _)| left[v]) {
        if block.positions[v] != before[v] {
            collapsed.moved.push((global, block.positions[v] + origin));
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

struct Block {
    positions: Vec<DVec3>,
    /// Those taken away have no corners.
    triangles: Vec<[u32; 3]>,
    /// A corner (3 × triangle + number) of each vertex; those of triangles taken away may be among them.
    first: Vec<u32>,
    /// By corner, the next one of its vertex.
    following: Vec<u32>,
    quadrics: Vec<Quadric>,
    /// By triangle, bound of its distance from the source.
    errors: Vec<f32>,
    held: Vec<bool>,
    /// By vertex, the last round in which a triangle around it changed.
    changed: Vec<u32>,
    limits: Limits,
}

impl Block {
    fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>, limits: Limits) -> Self {
        let mut first = vec![NONE; positions.len()];
        let mut following = vec![NONE; 3 * triangles.len()];
        let mut quadrics = vec![Quadric::default(); positions.len()];
        for (t, corners) in triangles.iter().enumerate() {
            let plane = Quadric::of(corners.map(|v| positions[v as usize]));
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
    fn around(&self, v: u32, star: &mut Vec<u32>) {
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

/// A collapse that is being weighed.
#[derive(Debug, Default)]
struct Change {
    of_kept: Vec<u32>,
    of_gone: Vec<u32>,
    /// Vertices around what is put in.
    ring: Vec<u32>,
    /// Where the vertex that is left goes.
    place: DVec3,
    /// Bound of the distance from the source afterwards.
    error: f32,
    /// What is taken away, and what is put in its place.
    old: Patch,
    new: Patch,
    /// Of the triangles that are taken away.
    looks: Vec<Look>,
    /// Whether a triangle that is taken away is turned over.
    is_folded: bool,
}

/// Triangles seen along a normal: x and y across it, z along it.
#[derive(Debug, Default)]
struct Patch {
    triangles: Vec<[DVec3; 3]>,
    /// Ends of the edges that are not on its border.
    edges: Vec<[DVec3; 2]>,
    /// Vertices that are not on its border.
    inner: Vec<DVec3>,
}

impl Change {
    /// Whether `gone` may become one with `kept`, and how.
    fn plan(&mut self, block: &Block, kept: u32, gone: u32) -> bool {
        block.around(kept, &mut self.of_kept);
        block.around(gone, &mut self.of_gone);
        if !self.keeps_topology(block, kept, gone) {
            return false;
        }
        let [a, b] = [kept, gone].map(|v| block.positions[v as usize]);
        if block.held[kept as usize] {
            return self.plan_at(block, kept, gone, a);
        }
        let middle = a.midpoint(b);
        let mut quadric = block.quadrics[kept as usize];
        quadric += block.quadrics[gone as usize];
        let best = quadric.best(middle);
        let is_near = best.distance_squared(middle) <= a.distance_squared(b);
        // Where noise is all there is, planes say little.
        is_near && self.plan_at(block, kept, gone, best) || self.plan_at(block, kept, gone, middle)
    }

    /// Whether `gone` and `kept` may become one at `place`.
    fn plan_at(&mut self, block: &Block, kept: u32, gone: u32, place: DVec3) -> bool {
        self.place = place;
        let is_held = block.held[kept as usize];
        let mut quadric = block.quadrics[kept as usize];
        quadric += block.quadrics[gone as usize];
        if quadric.mean_square(place) > block.limits.rms.powi(2) {
            return false;
        }
        let Some(normal) = self.normal(block, kept, gone) else {
            return false;
        };
        self.project(block, kept, gone, normal);
        let Some(height) = self.height() else {
            return false;
        };
        let taken = self
            .of_gone
            .iter()
            .chain(if is_held { &[][..] } else { &self.of_kept });
        let before = taken.map(|&t| block.errors[t as usize]).fold(0.0, f32::max);
        #[expect(clippy::cast_possible_truncation, reason = "rounded up")]
        let error = (height as f32).next_up() + before;
        self.error = error.next_up();
        f64::from(self.error) <= block.limits.bound
    }

    /// Checks the link condition, and lists the vertices around.
    fn keeps_topology(&mut self, block: &Block, kept: u32, gone: u32) -> bool {
        let corners = |t: &u32| block.triangles[*t as usize];
        let both = self.of_gone.iter().filter(|t| corners(t).contains(&kept));
        if both.count() != 2 || self.of_kept.len() + self.of_gone.len() > MOST_AROUND + 4 {
            return false;
        }
        let is_held = block.held[kept as usize];
        let is_next_to_kept = |v: u32| self.of_kept.iter().any(|t| corners(t).contains(&v));
        self.ring.clear();
        let mut common = 0;
        for t in &self.of_gone {
            // The first vertex of each opposite edge: all around `gone`, once each.
            let [v, _] = opposite(corners(t), gone);
            if v == kept {
                continue;
            }
            if is_next_to_kept(v) {
                common += 1;
            } else if is_held && block.held[v as usize] {
                // They may be neighbours in another block.
                return false;
            }
            self.ring.push(v);
        }
        if common != 2 {
            return false;
        }
        for t in &self.of_kept {
            for v in corners(t) {
                if v != kept && v != gone && !self.ring.contains(&v) {
                    self.ring.push(v);
                }
            }
        }
        true
    }

    /// Fills in the triangles of both patches; the mean normal, if the new one is not turned over anywhere along it, and as
    /// well shaped as it should be.
    fn normal(&mut self, block: &Block, kept: u32, gone: u32) -> Option<DVec3> {
        let Self {
            old, new, looks, ..
        } = self;
        old.clear();
        new.clear();
        let at = |v: u32| block.positions[v as usize];
        let is_held = block.held[kept as usize];
        for &t in &self.of_gone {
            let corners = block.triangles[t as usize];
            old.triangles.push(corners.map(at));
            if !corners.contains(&kept) {
                let [a, b] = opposite(corners, gone);
                new.triangles.push([self.place, at(a), at(b)]);
            }
        }
        for &t in self.of_kept.iter().filter(|_| !is_held) {
            let corners = block.triangles[t as usize];
            if !corners.contains(&gone) {
                old.triangles.push(corners.map(at));
                let [a, b] = opposite(corners, kept);
                new.triangles.push([self.place, at(a), at(b)]);
            }
        }
        looks.clear();
        looks.extend(old.triangles.iter().map(Look::of));
        let sum: DVec3 = looks.iter().map(|look| look.doubled).sum();
        let normal = sum.try_normalize()?;
        let least = |of: &dyn Fn(&Look) -> f64| looks.iter().map(of).fold(f64::INFINITY, f64::min);
        let steepest = least(&|look| look.cosine(normal));
        let thinnest = least(&|look| look.shape);
        self.is_folded = steepest <= 0.0;
        let is_good = |t: &[DVec3; 3]| {
            let look = Look::of(t);
            look.cosine(normal) >= steepest.clamp(LEAST_COSINE, COSINE)
                && look.shape >= thinnest.min(SHAPE)
        };
        // The angles around a vertex on the border of what is taken away do not say how often the new patch goes around it.
        let is_fit = !(self.is_folded && is_held) && new.triangles.iter().all(is_good);
        is_fit.then_some(normal)
    }

    /// Fills in the rest of both patches, and turns them to be seen along `normal`.
    fn project(&mut self, block: &Block, kept: u32, gone: u32, normal: DVec3) {
        let Self { old, new, .. } = self;
        let at = |v: u32| block.positions[v as usize];
        for &t in &self.of_gone {
            let [a, _] = opposite(block.triangles[t as usize], gone);
            old.edges.push([at(gone), at(a)]);
        }
        old.inner.push(at(gone));
        if !block.held[kept as usize] {
            for &t in &self.of_kept {
                let [a, _] = opposite(block.triangles[t as usize], kept);
                if a != gone {
                    old.edges.push([at(kept), at(a)]);
                }
            }
            old.inner.push(at(kept));
            new.inner.push(self.place);
        }
        for &[place, a, _] in &new.triangles {
            new.edges.push([place, a]);
        }
        let (across, up) = normal.any_orthonormal_pair();
        let seen = |p: &mut DVec3| *p = DVec3::new(p.dot(across), p.dot(up), p.dot(normal));
        old.each(seen);
        new.each(seen);
    }

    /// Largest distance between both patches along the normal; `None` where rounding hides it, or the old patch reaches
    /// beyond the border.
    fn height(&self) -> Option<f64> {
        if self.is_folded && !self.lies_within() {
            return None;
        }
        let mut largest = 0.0_f64;
        for (patch, other) in [(&self.old, &self.new), (&self.new, &self.old)] {
            for &point in &patch.inner {
                let triangles = other.triangles.iter();
                let heights = triangles.filter_map(|t| height_at(*t, point.truncate()));
                // One, but on edges, and where the old patch is folded.
                largest = largest.max(
                    heights
                        .map(|height| (point.z - height).abs())
                        .max_by(f64::total_cmp)?,
                );
            }
        }
        for old in &self.old.edges {
            for new in &self.new.edges {
                if let Some([a, b]) = crossing(*old, *new) {
                    largest = largest.max((a - b).abs());
                }
            }
        }
        Some(largest)
    }

    /// Whether the new patch goes once around its middle, and no edge of the old one crosses the border.
    ///
    /// Then the old patch lies above or below the new one everywhere, folded as it may be, and covers all of it.
    fn lies_within(&self) -> bool {
        let flat = |p: DVec3| p.truncate();
        let turns = |&[middle, a, b]: &[DVec3; 3]| {
            (flat(a) - flat(middle)).angle_to(flat(b) - flat(middle))
        };
        let around: f64 = self.new.triangles.iter().map(turns).sum();
        let crosses = |&[_, a, b]: &[DVec3; 3]| {
            self.old.edges.iter().any(|&[c, d]| {
                let side = |from: DVec3, to: DVec3, p: DVec3| {
                    (flat(to) - flat(from)).perp_dot(flat(p) - flat(from))
                };
                d != a
                    && d != b
                    && side(a, b, c) * side(a, b, d) <= 0.0
                    && side(c, d, a) * side(c, d, b) <= 0.0
            })
        };
        around < 1.5 * std::f64::consts::TAU && !self.new.triangles.iter().any(crosses)
    }
}

/// What a triangle looks like.
#[derive(Debug, Clone, Copy)]
struct Look {
    /// Its normal, twice its area long.
    doubled: DVec3,
    /// Length of that.
    length: f64,
    /// Twice the area over the square of the longest edge.
    shape: f64,
}

impl Look {
    fn of(&[a, b, c]: &[DVec3; 3]) -> Self {
        let doubled = (b - a).cross(c - a);
        let longest = a.distance_squared(b);
        let longest = longest
            .max(b.distance_squared(c))
            .max(c.distance_squared(a));
        let length = doubled.length();
        Self {
            doubled,
            length,
            shape: length / longest.max(f64::MIN_POSITIVE),
        }
    }

    fn cosine(&self, normal: DVec3) -> f64 {
        self.doubled.dot(normal) / self.length.max(f64::MIN_POSITIVE)
    }
}

impl Patch {
    fn clear(&mut self) {
        self.triangles.clear();
        self.edges.clear();
        self.inner.clear();
    }

    fn each(&mut self, change: impl Fn(&mut DVec3)) {
        let corners = self.triangles.as_flattened_mut().iter_mut();
        let ends = self.edges.as_flattened_mut().iter_mut();
        for point in corners.chain(ends).chain(&mut self.inner) {
            change(point);
        }
    }
}

/// What rounding may hide.
const HAIR: f64 = 1e-9;

/// The bits of a length at least 0, ordered like it.
#[expect(
    clippy::cast_possible_truncation,
    reason = "an order is all that is asked for"
)]
fn as_bits(length: f64) -> u32 {
    (length as f32).to_bits()
}

/// The edge opposite to a corner, in the triangle's sense.
fn opposite([a, b, c]: [u32; 3], corner: u32) -> [u32; 2] {
    if a == corner {
        [b, c]
    } else if b == corner {
        [c, a]
    } else {
        [a, b]
    }
}

/// The height of a triangle above a point in its projection, or a hair outside of it.
fn height_at([a, b, c]: [DVec3; 3], point: DVec2) -> Option<f64> {
    let (ab, ac) = ((b - a).truncate(), (c - a).truncate());
    let doubled = ab.perp_dot(ac);
    let from_a = point - a.truncate();
    let (s, t) = (from_a.perp_dot(ac) / doubled, ab.perp_dot(from_a) / doubled);
    (s >= -HAIR && t >= -HAIR && s + t <= 1.0 + HAIR)
        .then_some(a.z + s * (b.z - a.z) + t * (c.z - a.z))
}

/// Heights of two edges where they cross in the projection.
fn crossing([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> Option<[f64; 2]> {
    let (ab, cd) = ((b - a).truncate(), (d - c).truncate());
    let cross = ab.perp_dot(cd);
    let ac = (c - a).truncate();
    let (s, t) = (ac.perp_dot(cd) / cross, ac.perp_dot(ab) / cross);
    let is_on = |part: f64| (0.0..=1.0).contains(&part);
    (is_on(s) && is_on(t)).then_some([a.z + s * (b.z - a.z), c.z + t * (d.z - c.z)])
}
