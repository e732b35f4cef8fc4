//! A collapse of an edge, weighed: what it does to the topology, to the shape of triangles, and how far it moves the surface.
//!
//! What a collapse takes away and what it puts in its place have the same border. Both are projected along their mean normal;
//! where no triangle is turned over by that, each point of one has a point of the other above or below it, and their
//! distance along the normal is linear on every cell of the overlay of both: it is largest at a corner of the overlay, that
//! is at an inner vertex of either, or where edges cross. The same is true where what is taken away is folded, as
//! long as it does not reach over the border: it then has several points above or below one, and the farthest counts.
//! Such distances add up from collapse to collapse.

use super::collapse::Block;
use glam::{DVec2, DVec3};

/// Most triangles around a vertex.
const MOST_AROUND: usize = 10;
/// Cosine of the angle between a triangle and the mean normal that a collapse may always leave.
const COSINE: f64 = 0.3;
/// One that it never goes below.
const LEAST_COSINE: f64 = 0.1;
/// Twice the area over the square of the longest edge that a collapse may always leave (0.87 of an equilateral triangle).
const SHAPE: f64 = 0.1;
/// What rounding may hide.
const HAIR: f64 = 1e-9;

/// A collapse that is being weighed.
#[derive(Debug, Default)]
pub(super) struct Change {
    pub(super) of_kept: Vec<u32>,
    pub(super) of_gone: Vec<u32>,
    /// Vertices around what is put in.
    pub(super) ring: Vec<u32>,
    /// Where the vertex that is left goes.
    pub(super) place: DVec3,
    /// Bound of the distance from the source afterwards.
    pub(super) error: f32,
    /// Places of [`GONE`], [`KEPT`], [`PUT`] and the ring, which are the numbers in patches; then as seen along the normal: x and y across it, z along it.
    points: Vec<DVec3>,
    /// Of the block's vertices that have one, the number among the points.
    numbers: Vec<usize>,
    /// What is taken away, and what is put in its place.
    old: Patch,
    new: Patch,
    /// Of the triangles that are taken away.
    looks: Vec<Look>,
    /// Whether a triangle that is taken away is turned over.
    is_folded: bool,
}

/// The vertex that goes, the one that stays, and its new place, among the points of a [`Change`].
const GONE: usize = 0;
const KEPT: usize = 1;
const PUT: usize = 2;
/// The first of the ring.
const RING: usize = 3;

/// Some of the triangles around an edge.
#[derive(Debug, Default)]
struct Patch {
    triangles: Vec<[usize; 3]>,
    /// Ends of the edges that are not on its border.
    edges: Vec<[usize; 2]>,
    /// Vertices that are not on its border.
    inner: Vec<usize>,
}

impl Change {
    /// Whether `gone` may become one with `kept`, and how.
    pub(super) fn plan(&mut self, block: &Block, kept: u32, gone: u32) -> bool {
        let [a, b] = [kept, gone].map(|v| block.positions[v as usize]);
        let mut quadric = block.quadrics[kept as usize];
        quadric += block.quadrics[gone as usize];
        let limit = block.limits.rms.powi(2);
        let is_held = block.held[kept as usize];
        let middle = a.midpoint(b);
        let best = if is_held { a } else { quadric.best(middle) };
        let is_near = is_held || best.distance_squared(middle) <= a.distance_squared(b);
        // Where noise is all there is, planes say little.
        let places = [is_near.then_some(best), (!is_held).then_some(middle)]
            .map(|place| place.filter(|&place| quadric.mean_square(place) <= limit));
        if places == [None; 2] {
            return false;
        }
        block.around(kept, &mut self.of_kept);
        block.around(gone, &mut self.of_gone);
        self.keeps_topology(block, kept, gone)
            && places
                .into_iter()
                .flatten()
                .any(|place| self.plan_at(block, kept, gone, place))
    }

    /// Whether `gone` and `kept` may become one at `place`.
    fn plan_at(&mut self, block: &Block, kept: u32, gone: u32, place: DVec3) -> bool {
        self.place = place;
        let is_held = block.held[kept as usize];
        let taken = self
            .of_gone
            .iter()
            .chain(if is_held { &[][..] } else { &self.of_kept });
        let before = taken.map(|&t| block.errors[t as usize]).fold(0.0, f32::max);
        if f64::from(before) > block.limits.bound {
            return false;
        }
        self.put_together(block, kept, gone);
        let Some(normal) = self.normal(is_held) else {
            return false;
        };
        self.see_along(normal);
        let Some(height) = self.height() else {
            return false;
        };
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

    /// Fills in the points and both patches.
    fn put_together(&mut self, block: &Block, kept: u32, gone: u32) {
        let Self {
            points,
            numbers,
            old,
            new,
            ring,
            ..
        } = self;
        let is_held = block.held[kept as usize];
        let at = |v: u32| block.positions[v as usize];
        points.clear();
        points.extend([at(gone), at(kept), self.place]);
        points.extend(ring.iter().map(|&v| at(v)));
        // Numbers of other blocks and collapses stay in the others: none of these is asked for.
        numbers.resize(block.positions.len(), 0);
        numbers[gone as usize] = GONE;
        numbers[kept as usize] = KEPT;
        for (number, &v) in (RING..).zip(&*ring) {
            numbers[v as usize] = number;
        }
        let number = |v: u32| numbers[v as usize];
        old.clear();
        new.clear();
        for &t in &self.of_gone {
            let corners = block.triangles[t as usize];
            let [a, b] = opposite(corners, gone).map(number);
            old.triangles.push(corners.map(number));
            old.edges.push([GONE, a]);
            if a != KEPT && b != KEPT {
                new.triangles.push([PUT, a, b]);
            }
        }
        old.inner.push(GONE);
        if !is_held {
            for &t in &self.of_kept {
                let corners = block.triangles[t as usize];
                let [a, b] = opposite(corners, kept).map(number);
                if a != GONE {
                    old.edges.push([KEPT, a]);
                    if b != GONE {
                        old.triangles.push(corners.map(number));
                        new.triangles.push([PUT, a, b]);
                    }
                }
            }
            old.inner.push(KEPT);
            new.inner.push(PUT);
        }
        new.edges
            .extend(new.triangles.iter().map(|&[put, a, _]| [put, a]));
    }

    /// The mean normal, if the new patch is not turned over anywhere along it, and as well shaped as it should be.
    fn normal(&mut self, is_held: bool) -> Option<DVec3> {
        let look = |t: &[usize; 3]| Look::of(t.map(|p| self.points[p]));
        let looks = &mut self.looks;
        looks.clear();
        looks.extend(self.old.triangles.iter().map(look));
        let sum: DVec3 = looks.iter().map(|look| look.doubled).sum();
        let normal = sum.try_normalize()?;
        let least = |of: &dyn Fn(&Look) -> f64| looks.iter().map(of).fold(f64::INFINITY, f64::min);
        let steepest = least(&|look| look.cosine(normal));
        let thinnest = least(&|look| look.shape);
        self.is_folded = steepest <= 0.0;
        let is_good = |t: &[usize; 3]| {
            let look = look(t);
            look.cosine(normal) >= steepest.clamp(LEAST_COSINE, COSINE)
                && look.shape >= thinnest.min(SHAPE)
        };
        // The angles around a vertex on the border of what is taken away do not say how often the new patch goes around it.
        let is_fit = !(self.is_folded && is_held) && self.new.triangles.iter().all(is_good);
        is_fit.then_some(normal)
    }

    /// Turns the points to be seen along `normal`.
    fn see_along(&mut self, normal: DVec3) {
        let (across, up) = normal.any_orthonormal_pair();
        for p in &mut self.points {
            *p = DVec3::new(p.dot(across), p.dot(up), p.dot(normal));
        }
    }

    /// Largest distance between both patches along the normal; `None` where rounding hides it, or the old patch reaches
    /// beyond the border.
    fn height(&self) -> Option<f64> {
        if self.is_folded && !self.lies_within() {
            return None;
        }
        let points = &self.points;
        let mut largest = 0.0_f64;
        for (patch, other) in [(&self.old, &self.new), (&self.new, &self.old)] {
            for &point in &patch.inner {
                let point = points[point];
                let triangles = other.triangles.iter().map(|t| t.map(|p| points[p]));
                let heights = triangles.filter_map(|t| height_at(t, point.truncate()));
                // One, but on edges, and where the old patch is folded.
                largest = largest.max(
                    heights
                        .map(|height| (point.z - height).abs())
                        .max_by(f64::total_cmp)?,
                );
            }
        }
        for old in &self.old.edges {
            let old = old.map(|p| points[p]);
            for new in &self.new.edges {
                if let Some([a, b]) = crossing(old, new.map(|p| points[p])) {
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
        let flat = |p: usize| self.points[p].truncate();
        let turns = |&[middle, a, b]: &[usize; 3]| {
            (flat(a) - flat(middle)).angle_to(flat(b) - flat(middle))
        };
        let around: f64 = self.new.triangles.iter().map(turns).sum();
        let crosses = |&[_, a, b]: &[usize; 3]| {
            self.old.edges.iter().any(|&[c, d]| {
                let side = |from: usize, to: usize, p: usize| {
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
    fn of([a, b, c]: [DVec3; 3]) -> Self {
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
}

/// The edge opposite to a corner, in the triangle's sense.
pub(super) fn opposite([a, b, c]: [u32; 3], corner: u32) -> [u32; 2] {
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
    // Over `doubled` they are the parts of the way to b and to c.
    let sign = doubled.signum();
    let (s, t) = (sign * from_a.perp_dot(ac), sign * ab.perp_dot(from_a));
    let hair = HAIR * doubled.abs();
    // Divisions take long, and nearly all points are outside.
    let is_inside = s >= -hair && t >= -hair && s + t <= doubled.abs() + hair && doubled != 0.0;
    is_inside.then(|| a.z + (s * (b.z - a.z) + t * (c.z - a.z)) / doubled.abs())
}

/// Heights of two edges where they cross in the projection.
fn crossing([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> Option<[f64; 2]> {
    let (ab, cd) = ((b - a).truncate(), (d - c).truncate());
    let cross = ab.perp_dot(cd);
    let ac = (c - a).truncate();
    // Over `cross` they are the parts of the ways along both.
    let sign = cross.signum();
    let (s, t) = (sign * ac.perp_dot(cd), sign * ac.perp_dot(ab));
    let length = cross.abs();
    let is_crossed = length > 0.0 && (0.0..=length).contains(&s) && (0.0..=length).contains(&t);
    is_crossed.then(|| {
        [
            a.z + s / length * (b.z - a.z),
            c.z + t / length * (d.z - c.z),
        ]
    })
}
