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
    pub(super) fn plan(&mut self, block: &Block, kept: u32, gone: u32) -> bool {
        block.around(kept, &mut self.of_kept);
        block.around(gone, &mut self.of_gone);
        if !self.keeps_topology(block, kept, gone) {
            return false;
        }
        let [a, b] = [kept, gone].map(|v| block.positions[v as usize]);
        let mut quadric = block.quadrics[kept as usize];
        quadric += block.quadrics[gone as usize];
        let limit = block.limits.rms.powi(2);
        let mut may_be_at = |place: DVec3| {
            quadric.mean_square(place) <= limit && self.plan_at(block, kept, gone, place)
        };
        if block.held[kept as usize] {
            return may_be_at(a);
        }
        let middle = a.midpoint(b);
        let best = quadric.best(middle);
        let is_near = best.distance_squared(middle) <= a.distance_squared(b);
        // Where noise is all there is, planes say little.
        is_near && may_be_at(best) || may_be_at(middle)
    }

    /// Whether `gone` and `kept` may become one at `place`.
    fn plan_at(&mut self, block: &Block, kept: u32, gone: u32, place: DVec3) -> bool {
        self.place = place;
        let is_held = block.held[kept as usize];
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
