//! Nearest point of one triangle.
//!
//! Ericson, "Real-Time Collision Detection", 2005, section 5.1.5 (Voronoi regions by barycentric signs).
//! Differs: slivers and triangles without area take the best of their edges as well, because the signs that
//! pick the region are then rounding noise.

use glam::DVec3;

/// A triangle whose doubled area is below this part of the square of its longest edge, or a little more, is a sliver.
const SLIVER: f64 = 1e-7;

/// Point of `triangle` nearest to `point`. The result is always in the triangle, also where that is a segment
/// or a point.
#[inline]
pub fn closest_point(triangle: [DVec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = triangle;
    let (ab, ac) = (b - a, c - a);
    // No edge is longer than both of these together.
    let longest2 = 2.0 * (ab.length_squared() + ac.length_squared());
    if ab.cross(ac).length_squared() > SLIVER * SLIVER * longest2 * longest2 {
        by_regions(triangle, point)
    } else {
        of_sliver(triangle, point)
    }
}

#[cold]
fn of_sliver(triangle: [DVec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = triangle;
    let mut best = segment(a, b, point);
    for candidate in [
        segment(b, c, point),
        segment(c, a, point),
        by_regions(triangle, point),
    ] {
        // A triangle without area makes the last candidate NaN, which loses every comparison.
        if candidate.distance_squared(point) < best.distance_squared(point) {
            best = candidate;
        }
    }
    best
}

/// Unit normal, counter-clockwise outwards; `None` for a triangle without area.
pub fn normal([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    (b - a).cross(c - a).try_normalize()
}

#[inline]
fn by_regions([a, b, c]: [DVec3; 3], point: DVec3) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let ap = point - a;
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
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

fn segment(a: DVec3, b: DVec3, point: DVec3) -> DVec3 {
    let ab = b - a;
    let length2 = ab.length_squared();
    if length2 == 0.0 {
        return a;
    }
    a + ab * ((point - a).dot(ab) / length2).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn nearest_point_is_found_in_every_region() {
        let cases = [
            (DVec3::new(0.25, 0.25, 3.0), DVec3::new(0.25, 0.25, 0.0)),
            (DVec3::new(-1.0, -1.0, 1.0), DVec3::ZERO),
            (DVec3::new(2.0, -0.5, 0.0), DVec3::X),
            (DVec3::new(-0.5, 2.0, 0.0), DVec3::Y),
            (DVec3::new(0.5, -1.0, 0.0), DVec3::new(0.5, 0.0, 0.0)),
            (DVec3::new(-1.0, 0.5, 0.0), DVec3::new(0.0, 0.5, 0.0)),
            (DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.5, 0.5, 0.0)),
        ];
        for (point, expected) in cases {
            assert!(
                closest_point(UNIT, point).distance(expected) < 1e-15,
                "{point}"
            );
        }
    }

    #[test]
    fn triangle_without_area_is_its_longest_edge() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 3.0];
        let near = closest_point(line, DVec3::new(2.5, 1.0, 0.0));
        assert_eq!(near, DVec3::new(2.5, 0.0, 0.0));
        assert_eq!(closest_point([DVec3::ONE; 3], DVec3::ZERO), DVec3::ONE);
        assert_eq!(normal(line), None);
    }

    #[test]
    fn sliver_is_as_near_as_its_nearest_edge_point() {
        let sliver = [
            DVec3::ZERO,
            DVec3::new(1e6, 0.0, 0.0),
            DVec3::new(5e5, 1e-7, 0.0),
        ];
        for x in [-3.0, 1e-3, 2.5e5, 7e5, 2e6] {
            let near = closest_point(sliver, DVec3::new(x, 0.0, 2.0));
            let expected = DVec3::new(f64::clamp(x, 0.0, 1e6), 0.0, 0.0);
            assert!(near.distance(expected) < 1e-6, "{x}: {near}");
        }
    }
}
