//! An upper bound of the distance between two small meshes.
//!
//! The distance to one triangle is a convex function, so over a triangle of the other mesh its maximum is at a corner:
//! the least such maximum over all triangles of the first bounds the distance of the second. Where that is much above
//! what is seen at the corners, the triangle is halved across its longest edge.
//! Limit: only triangles that are nearest to a corner or to the centre are tried, and after `DEPTH` halvings the bound stays
//! as loose as it is. It is a bound all the same.

use super::graph::Distance;
use super::local::{self, Link};
use glam::DVec3;
use marquetry_evaluation::distance::{Bvh, closest_point};

/// Most halvings in a row.
const DEPTH: u32 = 10;
/// A bound is good enough at this multiple of what is seen at corners.
const LOOSENESS: f64 = 1.05;
/// The bound of a triangle is good enough at this part of the largest distance seen of all.
const SMALL: f64 = 0.7;

/// A mesh to measure distances to.
#[derive(Debug)]
pub struct Target<'a> {
    tree: Bvh,
    positions: &'a [DVec3],
    triangles: &'a [[u32; 3]],
}

impl<'a> Target<'a> {
    /// Prepares a mesh; `None` if it has no triangles, or corners that are not finite.
    pub fn new(positions: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Option<Self> {
        let tree = Bvh::new(positions, triangles).ok()?;
        (!tree.is_empty()).then_some(Self {
            tree,
            positions,
            triangles,
        })
    }

    /// The nearest point; `point` itself where it is not finite.
    pub(super) fn closest(&self, point: DVec3) -> DVec3 {
        let closest = self.tree.closest(point, f64::INFINITY);
        closest.map_or(point, |closest| closest.point)
    }

    /// Whether `point` is no farther than `most`; `hint` as [`Bvh::is_within`] has it.
    pub(super) fn is_within(&self, point: DVec3, most: f64, hint: &mut u32) -> bool {
        self.tree.is_within(point, most.powi(2), hint)
    }

    /// Upper bound of the distance from every point of `triangle`; no effort is made to get below `enough`.
    pub fn distance(&self, triangle: [DVec3; 3], enough: f64) -> f64 {
        let corners = triangle.map(|point| self.nearest(point, None));
        self.descend(corners, enough, DEPTH, &mut Vec::new())
    }

    /// Upper bound of the distance from every point of a mesh; no effort is made to get below `enough`, and none is made once it is above
    /// `most`. `vertices` is what [`Self::nearest_of`] says of it.
    fn distance_of(
        &self,
        vertices: &[Option<Nearest>],
        triangles: &[[u32; 3]],
        enough: f64,
        most: f64,
    ) -> f64 {
        let mut largest = 0.0f64;
        let mut parts = Vec::new();
        for t in triangles {
            let [Some(a), Some(b), Some(c)] = t.map(|v| vertices[v as usize]) else {
                return f64::INFINITY;
            };
            parts.clear();
            let bound = self.descend([a, b, c], enough.max(largest), DEPTH, &mut parts);
            largest = largest.max(bound);
            if largest > most {
                break;
            }
        }
        largest
    }

    /// What is nearest to each vertex that a triangle has.
    fn nearest_of(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Option<Nearest>> {
        let mut known: Vec<Option<Nearest>> = vec![None; positions.len()];
        for t in triangles {
            let mut hint = None;
            for &v in t {
                let slot = &mut known[v as usize];
                let nearest =
                    *slot.get_or_insert_with(|| self.nearest(positions[v as usize], hint));
                hint = nearest.triangle;
            }
        }
        known
    }

    /// What is nearest to a point, which may be near the triangle `hint`.
    fn nearest(&self, point: DVec3, hint: Option<u32>) -> Nearest {
        let distance2 = hint.map_or(f64::INFINITY, |hint| self.from(hint, point).powi(2));
        let closest = self.tree.closest(point, distance2);
        Nearest {
            point,
            distance: closest
                .map_or(distance2, |closest| closest.distance2)
                .sqrt(),
            triangle: closest.map(|closest| closest.triangle).or(hint),
        }
    }

    /// Upper bound of the distance of a triangle. Which triangle each of its parts is near to, and how near, goes to `parts`.
    fn descend(
        &self,
        corners: [Nearest; 3],
        enough: f64,
        depth: u32,
        parts: &mut Vec<Part>,
    ) -> f64 {
        let points = corners.map(|corner| corner.point);
        let seen = corners
            .iter()
            .map(|corner| corner.distance)
            .fold(0.0, f64::max);
        let is_enough = |bound: f64| bound <= enough || bound <= LOOSENESS * seen;
        let (mut bound, mut of) = (f64::INFINITY, None);
        let hint = corners[0].triangle;
        for number in 0..=corners.len() {
            let nearest = corners.get(number).copied();
            let nearest = nearest
                .unwrap_or_else(|| self.nearest(points.into_iter().sum::<DVec3>() / 3.0, hint));
            let farthest = self.farthest(points, nearest.triangle);
            if farthest < bound {
                (bound, of) = (farthest, nearest.triangle);
            }
            if is_enough(bound) {
                break;
            }
        }
        if is_enough(bound) || depth == 0 {
            parts.push((of, bound));
            return bound;
        }
        let before = parts.len();
        let [a, b, c] = turned(corners, |corner| corner.point);
        let middle = self.nearest(a.point.midpoint(b.point), a.triangle);
        let mut halved = 0.0f64;
        for half in [[a, middle, c], [middle, b, c]] {
            halved = halved.max(self.descend(half, enough.max(halved), depth - 1, parts));
            if halved >= bound {
                parts.truncate(before);
                parts.push((of, bound));
                return bound;
            }
        }
        halved
    }

    /// Distance of the farthest corner of `triangle` from the one numbered `other`.
    fn farthest(&self, triangle: [DVec3; 3], other: Option<u32>) -> f64 {
        let Some(other) = other else {
            return f64::INFINITY;
        };
        let distances = triangle.into_iter().map(|p| self.from(other, p));
        distances.fold(0.0, f64::max)
    }

    /// Distance of a point from the triangle numbered `other`.
    fn from(&self, other: u32, point: DVec3) -> f64 {
        let other = self.triangles[other as usize].map(|v| self.positions[v as usize]);
        point.distance(closest_point(other, point))
    }
}

/// The triangle that a part of another is near to, if there is one, and how near.
type Part = (Option<u32>, f64);

/// A point, and the triangle that is nearest to it.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    point: DVec3,
    distance: f64,
    /// `None` for a point that is not finite.
    triangle: Option<u32>,
}

/// The same corners, which are at `point`, the longest edge between the first two.
pub(super) fn turned<T: Copy>([a, b, c]: [T; 3], point: impl Fn(T) -> DVec3) -> [T; 3] {
    let squared = |a: T, b: T| point(a).distance_squared(point(b));
    let (ab, bc, ca) = (squared(a, b), squared(b, c), squared(c, a));
    if ab >= bc && ab >= ca {
        [a, b, c]
    } else if bc >= ca {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Upper bound of the Hausdorff distance of two meshes, if that is at most `most`; else some number above `most`.
///
/// Infinite if one has no triangles.
pub fn hausdorff(
    first: (&[DVec3], &[[u32; 3]]),
    second: (&[DVec3], &[[u32; 3]]),
    most: f64,
) -> f64 {
    let target = |(positions, triangles)| Target::new(positions, triangles);
    let (Some(to_first), Some(to_second)) = (target(first), target(second)) else {
        return f64::INFINITY;
    };
    // The distance is at least what is seen at vertices, so there is no use in knowing better of what is nearer.
    let Seen {
        forward,
        backward,
        most: seen,
    } = Seen::of(&to_first, &to_second);
    if seen > most {
        return seen;
    }
    let enough = LOOSENESS * seen;
    let bound = to_second.distance_of(&forward, first.1, enough, most);
    if bound > most {
        return bound;
    }
    let back = to_first.distance_of(&backward, second.1, enough, most);
    bound.max(back).max(seen)
}

/// What is seen at the vertices of two meshes.
struct Seen {
    /// Of the first mesh.
    forward: Vec<Option<Nearest>>,
    /// Of the second.
    backward: Vec<Option<Nearest>>,
    /// The largest distance.
    most: f64,
}

impl Seen {
    fn of(first: &Target<'_>, second: &Target<'_>) -> Self {
        let forward = second.nearest_of(first.positions, first.triangles);
        let backward = first.nearest_of(second.positions, second.triangles);
        let all = forward.iter().chain(&backward).flatten();
        let most = all.fold(0.0, |most: f64, nearest| most.max(nearest.distance));
        Self {
            forward,
            backward,
            most,
        }
    }
}

/// The distance of `first`, which stands for `second`, from that, and which of their triangles are how near to each other.
pub(super) fn linked(first: &Target<'_>, second: &Target<'_>) -> (Distance, Vec<Link>) {
    let Seen {
        forward,
        backward,
        most: seen,
    } = Seen::of(first, second);
    // From what is seen at the vertices of the second.
    let squares = squares((second.positions, second.triangles), &backward);
    let (mut bound, mut links, mut parts) = (seen, Vec::new(), Vec::new());
    let ways = [
        (second, forward, first.triangles, false),
        (first, backward, second.triangles, true),
    ];
    for (to, vertices, triangles, is_back) in ways {
        for (own, t) in (0u32..).zip(triangles) {
            parts.clear();
            if let [Some(a), Some(b), Some(c)] = t.map(|v| vertices[v as usize]) {
                to.descend([a, b, c], SMALL * seen, DEPTH, &mut parts);
            } else {
                parts.push((None, f64::INFINITY));
            }
            for &(other, distance) in &parts {
                bound = bound.max(distance);
                // What is near nothing is infinitely far from any.
                let other = other.unwrap_or_default();
                let (child, member) = if is_back { (own, other) } else { (other, own) };
                links.push(Link::new(child, member, distance));
            }
        }
    }
    (Distance { bound, squares }, local::merged(links))
}

/// Integral of the squared distance over a mesh, from that of its vertices.
fn squares(mesh: (&[DVec3], &[[u32; 3]]), vertices: &[Option<Nearest>]) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.0[v as usize]);
        let area = (b - a).cross(c - a).length() / 2.0;
        let distance = t.map(|v| vertices[v as usize].map_or(0.0, |nearest| nearest.distance));
        area * distance
            .map(|distance| distance.powi(2))
            .iter()
            .sum::<f64>()
            / 3.0
    };
    mesh.1.iter().map(of).sum()
}
