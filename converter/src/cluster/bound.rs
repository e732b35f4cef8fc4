//! An upper bound of the distance between two small meshes.
//!
//! The distance to one triangle is a convex function, so over a triangle of the other mesh its maximum is at a corner:
//! the least such maximum over all triangles of the first bounds the distance of the second. Where that is much above
//! what is seen at the corners, the triangle is halved across its longest edge.
//! Limit: only triangles that are nearest to a corner or to the centre are tried, and after `DEPTH` halvings the bound stays
//! as loose as it is. It is a bound all the same.

use glam::DVec3;
use marquetry_evaluation::distance::{Bvh, closest_point};

/// Most halvings in a row.
const DEPTH: u32 = 10;
/// A bound is good enough at this multiple of what is seen at corners.
const LOOSENESS: f64 = 1.05;

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

    /// Upper bound of the distance from every point of `triangle`; no effort is made to get below `enough`.
    pub fn distance(&self, triangle: [DVec3; 3], enough: f64) -> f64 {
        self.descend(triangle, enough, DEPTH)
    }

    /// Upper bound of the distance from every point of a mesh, if that is at most `most`; else some number above `most`.
    pub fn distance_of(&self, positions: &[DVec3], triangles: &[[u32; 3]], most: f64) -> f64 {
        let mut largest = 0.0f64;
        for t in triangles {
            let corners = t.map(|v| positions[v as usize]);
            largest = largest.max(self.distance(corners, largest));
            if largest > most {
                break;
            }
        }
        largest
    }

    fn descend(&self, triangle: [DVec3; 3], enough: f64, depth: u32) -> f64 {
        let centre = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
        let (mut seen, mut bound) = (0.0f64, f64::INFINITY);
        for (corner, point) in triangle.into_iter().chain([centre]).enumerate() {
            let Some(closest) = self.tree.closest(point, f64::INFINITY) else {
                return f64::INFINITY;
            };
            if corner < 3 {
                seen = seen.max(closest.distance2.sqrt());
            }
            bound = bound.min(self.farthest(triangle, closest.triangle));
        }
        if bound <= enough || bound <= LOOSENESS * seen || depth == 0 {
            return bound;
        }
        let mut halved = 0.0f64;
        for half in halves(triangle) {
            halved = halved.max(self.descend(half, enough.max(halved), depth - 1));
            if halved >= bound {
                return bound;
            }
        }
        halved
    }

    /// Distance of the farthest corner of `triangle` from the one numbered `other`.
    fn farthest(&self, triangle: [DVec3; 3], other: u32) -> f64 {
        let other = self.triangles[other as usize].map(|v| self.positions[v as usize]);
        let distance = |p: DVec3| p.distance(closest_point(other, p));
        triangle.into_iter().map(distance).fold(0.0, f64::max)
    }
}

/// Cut across the longest edge.
fn halves([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 2] {
    let (ab, bc, ca) = (
        a.distance_squared(b),
        b.distance_squared(c),
        c.distance_squared(a),
    );
    let (a, b, c) = if ab >= bc && ab >= ca {
        (a, b, c)
    } else if bc >= ca {
        (b, c, a)
    } else {
        (c, a, b)
    };
    let middle = a.midpoint(b);
    [[a, middle, c], [middle, b, c]]
}

/// Upper bound of the Hausdorff distance of two meshes, if that is at most `most`; else some number above `most`.
///
/// Infinite if one has no triangles.
pub fn hausdorff(
    first: (&[DVec3], &[[u32; 3]]),
    second: (&[DVec3], &[[u32; 3]]),
    most: f64,
) -> f64 {
    let targets = (
        Target::new(first.0, first.1),
        Target::new(second.0, second.1),
    );
    let (Some(to_first), Some(to_second)) = targets else {
        return f64::INFINITY;
    };
    let forward = to_second.distance_of(first.0, first.1, most);
    if forward > most {
        return forward;
    }
    forward.max(to_first.distance_of(second.0, second.1, most))
}
