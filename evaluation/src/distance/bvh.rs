//! A tree of boxes over triangles, for nearest-point and visibility queries.
//!
//! Every node holds the boxes of its two children, 64 bytes in all. Boxes are `f32`, rounded outwards, in a
//! frame that is moved to the model's centre and scaled by a power of two, so a model far from the origin, tiny
//! or huge loses nothing; triangles stay `f64`. Building: [`build`].
//!
//! Limit: where two triangles are equally near, which of them is reported is fixed but arbitrary.

mod build;

use super::{MeshError, triangle::closest_point};
use glam::DVec3;

/// Room for one entry a level; see [`build::MAX_DEPTH`].
const STACK: usize = build::MAX_DEPTH + 1;
/// Comparisons of bounds allow this much rounding.
const SLACK: f64 = 1.0 + 1e-12;

/// Nearest point of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// Squared distance, in squared units of the input.
    pub distance2: f64,
    /// Index of the triangle, in the order of the input.
    pub triangle: u32,
    /// The point on it.
    pub point: DVec3,
}

/// The same, by where the triangle is in the tree.
#[derive(Debug, Clone, Copy)]
struct Found {
    distance2: f64,
    slot: u32,
    point: DVec3,
}

/// Bounding-volume hierarchy over the triangles of one mesh; owns a copy of them.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    frame: Frame,
    /// Vertices in the order in which the leaves use them.
    positions: Vec<DVec3>,
    /// Triangles leaf by leaf.
    triangles: Vec<[u32; 3]>,
    /// Index in the input, by index in `triangles`.
    input_index: Vec<u32>,
}

/// Two boxes and what is in them.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
struct Node {
    /// By axis, then by child.
    min: [[f32; 2]; 3],
    /// By axis, then by child.
    max: [[f32; 2]; 3],
    /// By child: the first triangle of a leaf, else the node.
    first: [u32; 2],
    /// By child: triangles of a leaf, 0 for a node.
    count: [u32; 2],
}

/// Where the boxes live: `frame = (world - centre) * scale`.
#[derive(Debug, Clone, Copy)]
struct Frame {
    centre: DVec3,
    /// A power of two, so multiplying by it is exact.
    scale: f64,
}

impl Frame {
    fn apply(&self, point: DVec3) -> DVec3 {
        (point - self.centre) * self.scale
    }
}

impl Node {
    /// Squared distance from `point` (in the frame) to both boxes.
    fn distance2(&self, point: DVec3) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for axis in 0..3 {
            for (child, sum) in sum.iter_mut().enumerate() {
                let below = f64::from(self.min[axis][child]) - point[axis];
                let above = point[axis] - f64::from(self.max[axis][child]);
                let outside = below.max(above).max(0.0);
                *sum += outside * outside;
            }
        }
        sum
    }

    /// Whether the segment `origin + t * direction`, t in `0..=1`, may meet a child's box.
    fn meets(&self, child: usize, origin: DVec3, direction: DVec3) -> bool {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (min, max) = (
                f64::from(self.min[axis][child]),
                f64::from(self.max[axis][child]),
            );
            if direction[axis] == 0.0 {
                if origin[axis] < min || origin[axis] > max {
                    return false;
                }
                continue;
            }
            let (a, b) = (
                (min - origin[axis]) / direction[axis],
                (max - origin[axis]) / direction[axis],
            );
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave * SLACK
    }
}

impl Bvh {
    /// Builds the tree. Deterministic; in parallel where the mesh is large.
    ///
    /// # Errors
    /// When an index is out of range, a used vertex is not finite, or there are 2^31 triangles or more.
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self, MeshError> {
        build::build(positions, triangles)
    }

    /// Triangles in the tree.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there is nothing to be near to.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The nearest point of the mesh, if it is no farther than the root of `max_distance2`.
    ///
    /// Give the best bound there is (infinity for none): it decides how much of the tree is looked at. `None`
    /// as well for an empty tree and for a point that is not finite.
    pub fn closest(&self, point: DVec3, max_distance2: f64) -> Option<Closest> {
        if self.nodes.is_empty() || !point.is_finite() {
            return None;
        }
        let found = self.search(point, None, max_distance2)?;
        Some(self.told(&found))
    }

    /// The nearest point of the mesh; `None` for an empty tree and for a point that is not finite.
    ///
    /// `hint` is looked at first, and set to what was found: keep it from one point to the next that is near it. Start with any.
    pub fn closest_from(&self, point: DVec3, hint: &mut u32) -> Option<Closest> {
        if self.nodes.is_empty() || !point.is_finite() {
            return None;
        }
        let slot = if (*hint as usize) < self.triangles.len() {
            *hint
        } else {
            0
        };
        let first = self.found(slot, point);
        let found = self.search(point, Some(first), first.distance2)?;
        *hint = found.slot;
        Some(self.told(&found))
    }

    fn found(&self, slot: u32, point: DVec3) -> Found {
        let nearest = closest_point(self.corners(slot), point);
        Found {
            distance2: nearest.distance_squared(point),
            slot,
            point: nearest,
        }
    }

    fn told(&self, found: &Found) -> Closest {
        Closest {
            distance2: found.distance2,
            triangle: self.input_index[found.slot as usize],
            point: found.point,
        }
    }

    /// What is nearer than `best`; without it, no farther than the root of `bound2`.
    fn search(&self, point: DVec3, mut best: Option<Found>, mut bound2: f64) -> Option<Found> {
        let in_frame = self.frame.apply(point);
        let frame2 = self.frame.scale * self.frame.scale * SLACK;
        let mut stack = [(0.0, 0_u32); STACK];
        let mut depth = 0;
        let mut current = 0;
        loop {
            let node = &self.nodes[current as usize];
            let distance2 = node.distance2(in_frame);
            let near = usize::from(distance2[1] < distance2[0]);
            let mut next = None;
            for child in [near, 1 - near] {
                if distance2[child] > bound2 * frame2 {
                    continue;
                }
                let (first, count) = (node.first[child], node.count[child]);
                if count == 0 {
                    if next.is_none() {
                        next = Some(first);
                    } else {
                        stack[depth] = (distance2[child], first);
                        depth += 1;
                    }
                    continue;
                }
                for slot in first..first + count {
                    let found = self.found(slot, point);
                    if found.distance2 < bound2 || (best.is_none() && found.distance2 <= bound2) {
                        bound2 = found.distance2;
                        best = Some(found);
                    }
                }
            }
            current = loop {
                if let Some(next) = next {
                    break next;
                }
                if depth == 0 {
                    return best;
                }
                depth -= 1;
                let (distance2, index) = stack[depth];
                if distance2 <= bound2 * frame2 {
                    break index;
                }
            };
        }
    }

    /// Whether some triangle is no farther from `point` than the root of `max_distance2`.
    ///
    /// `hint` is looked at first, and set to what was found: keep it from one point to the next that is near it. Start with any.
    pub fn is_within(&self, point: DVec3, max_distance2: f64, hint: &mut u32) -> bool {
        if self.nodes.is_empty() || !point.is_finite() {
            return false;
        }
        let near = |slot: u32| {
            closest_point(self.corners(slot), point).distance_squared(point) <= max_distance2
        };
        if (*hint as usize) < self.triangles.len() && near(*hint) {
            return true;
        }
        let found = self.find_near(point, max_distance2, |slot| near(slot).then_some(slot));
        *hint = found.unwrap_or(*hint);
        found.is_some()
    }

    /// All triangles that are no farther from `point` than the root of `max_distance2`, ascending.
    pub fn within(&self, point: DVec3, max_distance2: f64) -> Vec<Closest> {
        let mut all = Vec::new();
        if !self.nodes.is_empty() && point.is_finite() {
            let _: Option<()> = self.find_near(point, max_distance2, |slot| {
                let found = self.found(slot, point);
                if found.distance2 <= max_distance2 {
                    all.push(self.told(&found));
                }
                None
            });
        }
        // The tree may have parts of one in several places.
        all.sort_unstable_by_key(|found| found.triangle);
        all.dedup_by_key(|found| found.triangle);
        all
    }

    /// The first that `wanted` says of triangles in boxes no farther from `point` than the root of `max_distance2`, near ones mostly first.
    fn find_near<T>(
        &self,
        point: DVec3,
        max_distance2: f64,
        mut wanted: impl FnMut(u32) -> Option<T>,
    ) -> Option<T> {
        let in_frame = self.frame.apply(point);
        let bound2 = max_distance2 * self.frame.scale * self.frame.scale * SLACK;
        let mut stack = [0_u32; STACK];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            let distance2 = node.distance2(in_frame);
            let first = usize::from(distance2[1] < distance2[0]);
            // The nearer child is put on the stack last.
            for child in [1 - first, first] {
                if distance2[child] > bound2 {
                    continue;
                }
                let (from, count) = (node.first[child], node.count[child]);
                if count == 0 {
                    stack[depth] = from;
                    depth += 1;
                } else if let Some(found) = (from..from + count).find_map(&mut wanted) {
                    return Some(found);
                }
            }
        }
        None
    }

    /// Whether any triangle, seen from either side, meets the segment from `start` to `end`.
    ///
    /// Limit: a segment that runs exactly within a triangle's plane does not count as meeting it.
    pub fn any_hit(&self, start: DVec3, end: DVec3) -> bool {
        let direction = end - start;
        if self.nodes.is_empty() || !direction.is_finite() {
            return false;
        }
        let (origin, along) = (self.frame.apply(start), direction * self.frame.scale);
        let mut stack = [0_u32; STACK];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            for child in 0..2 {
                if !node.meets(child, origin, along) {
                    continue;
                }
                let (first, count) = (node.first[child], node.count[child]);
                if count == 0 {
                    stack[depth] = first;
                    depth += 1;
                } else if (first..first + count)
                    .any(|slot| crosses(self.corners(slot), start, direction))
                {
                    return true;
                }
            }
        }
        false
    }

    fn corners(&self, slot: u32) -> [DVec3; 3] {
        self.triangles[slot as usize].map(|vertex| self.positions[vertex as usize])
    }
}

/// Möller & Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
fn crosses([a, b, c]: [DVec3; 3], start: DVec3, direction: DVec3) -> bool {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return false;
    }
    let offset = start - a;
    let u = offset.dot(p) / determinant;
    let q = offset.cross(ab);
    let v = direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&t)
}
