//! A tighter bound for a piece of one surface against another.
//!
//! The distance to one triangle is a convex function, so over a convex piece its maximum is at a corner: any way of cutting
//! a surface into convex pieces and giving each a triangle of the other surface bounds the distance from the first to
//! the second. A piece starts with the triangle that corresponds to it; where that is too far, it is cut by the plane
//! that halves the angle at the edge it reaches over, and the part beyond goes to the neighbour.
//!
//! Limits: pieces do not leave the chart, and a walk that the depth does not suffice for keeps its looser bound.

use super::polygon::Polygon;
use glam::DVec3;

/// Cuts in a row before a piece is taken as it is.
const DEPTH: u32 = 14;

/// A triangle mesh that can be walked on.
pub(super) trait Surface {
    /// A triangle of it.
    type Triangle: Copy;

    /// The corners of a triangle.
    fn corners(&self, triangle: Self::Triangle) -> [DVec3; 3];

    /// The triangle across the edge from corner `edge` to the next.
    fn across(&self, triangle: Self::Triangle, edge: usize) -> Option<Self::Triangle>;
}

/// Upper bound of the distance from every point of the convex `piece` to `surface`, given that it is near `triangle`; no
/// effort is made to get below `enough`.
pub(super) fn bound<S: Surface>(
    surface: &S,
    triangle: S::Triangle,
    piece: &Polygon<DVec3>,
    enough: f64,
) -> f64 {
    descend(surface, triangle, piece, enough, DEPTH)
}

fn descend<S: Surface>(
    surface: &S,
    triangle: S::Triangle,
    piece: &Polygon<DVec3>,
    enough: f64,
    depth: u32,
) -> f64 {
    let corners = surface.corners(triangle);
    let (mut farthest, mut far_corner) = (0.0, DVec3::ZERO);
    for &corner in piece.corners() {
        let distance = corner.distance(closest_point(corners, corner));
        if distance > farthest {
            (farthest, far_corner) = (distance, corner);
        }
    }
    if farthest <= enough || depth == 0 {
        return farthest;
    }
    let Some((plane, beyond)) = edge_to_cross(surface, triangle, corners, far_corner) else {
        return farthest;
    };
    let (mut inside, mut outside) = (Polygon::EMPTY, Polygon::EMPTY);
    piece.cut(
        |corner| (*corner - plane.0).dot(plane.1),
        |_| (),
        &mut inside,
        &mut outside,
    );
    let kept = descend(surface, triangle, &inside, enough, depth - 1);
    if kept >= farthest {
        return farthest;
    }
    farthest.min(kept.max(descend(surface, beyond, &outside, enough, depth - 1)))
}

/// The edge that `point` is farthest beyond, as a plane through it whose normal points outwards, and what lies across.
fn edge_to_cross<S: Surface>(
    surface: &S,
    triangle: S::Triangle,
    corners: [DVec3; 3],
    point: DVec3,
) -> Option<((DVec3, DVec3), S::Triangle)> {
    let normal = unit_normal(corners);
    let mut best = None;
    let mut most = 0.0;
    for edge in 0..3 {
        let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
        let Some(beyond) = surface.across(triangle, edge) else {
            continue;
        };
        let between = normal + unit_normal(surface.corners(beyond));
        let outwards = (to - from).cross(between).normalize_or_zero();
        let height = (point - from).dot(outwards);
        if height > most {
            most = height;
            best = Some(((from, outwards), beyond));
        }
    }
    best
}

/// Unit normal, zero for a triangle without area.
pub(super) fn unit_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// The point of a triangle closest to `point` (Ericson, "Real-Time Collision Detection", 2005, 5.1.5); of a flat triangle
/// some point of it, which bounds the distance from above as well.
pub(super) fn closest_point([a, b, c]: [DVec3; 3], point: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * ratio(d1, d1 - d3);
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * ratio(d2, d2 - d6);
    }
    let va = d3 * d6 - d5 * d4;
    let (e1, e2) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e1 >= 0.0 && e2 >= 0.0 {
        return b + (c - b) * ratio(e1, e1 + e2);
    }
    let sum = va + vb + vc;
    a + ab * ratio(vb, sum) + ac * ratio(vc, sum)
}

fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}
