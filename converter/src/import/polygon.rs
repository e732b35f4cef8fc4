//! Polygons to triangles.
//!
//! Convex polygons become fans. Others are projected along the dominant axis of their Newell normal and clipped ear by ear
//! with exact orientation tests (Meisters, "Polygons have ears", 1975; predicate: Shewchuk 1997).
//!
//! Limits: O(n²) a polygon as a rule; the worst are stopped by a budget. Self-crossing and strongly warped polygons get some
//! triangulation of the right number of triangles, not a meaningful one. Holes are not a notion of these formats.

use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// Corners looked at before the rest of a polygon is cut as a fan: about two seconds.
const BUDGET: usize = 1 << 28;

/// Appends the triangles of `face` to `out`; false if it has fewer than three distinct corners.
pub(super) fn triangulate(face: &[u32], positions: &[DVec3], out: &mut Vec<[u32; 3]>) -> bool {
    let mut ring: Vec<u32> = face.to_vec();
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    let first = ring.first().copied();
    let second = ring.get(1).copied();
    if !ring.iter().any(|&v| Some(v) != first && Some(v) != second) || ring.len() < 3 {
        return false;
    }
    let points: Vec<DVec3> = ring.iter().map(|&v| positions[v as usize]).collect();
    match project(&points) {
        Some(flat) if !is_convex(&flat) => clip_ears(&ring, &flat, out),
        _ => fan(&ring, out),
    }
    true
}

fn fan(ring: &[u32], out: &mut Vec<[u32; 3]>) {
    out.extend(ring[1..].windows(2).map(|w| [ring[0], w[0], w[1]]));
}

/// The ring in the plane of its two smaller normal axes, counter-clockwise; none for a normal of zero or NaN.
fn project(points: &[DVec3]) -> Option<Vec<DVec2>> {
    let origin = points[0];
    let normal = points[1..].windows(2).fold(DVec3::ZERO, |sum, w| {
        sum + (w[0] - origin).cross(w[1] - origin)
    });
    let size = normal.abs();
    let largest = size.max_element();
    if !largest.is_finite() || largest <= 0.0 || !points.iter().all(|p| p.is_finite()) {
        return None;
    }
    let flatten: fn(DVec3) -> DVec2 = if largest <= size.z {
        |p| DVec2::new(p.x, p.y)
    } else if largest <= size.x {
        |p| DVec2::new(p.y, p.z)
    } else {
        |p| DVec2::new(p.z, p.x)
    };
    let positive = if largest <= size.z {
        normal.z > 0.0
    } else if largest <= size.x {
        normal.x > 0.0
    } else {
        normal.y > 0.0
    };
    let mirror = if positive {
        DVec2::ONE
    } else {
        DVec2::new(-1.0, 1.0)
    };
    Some(points.iter().map(|&p| flatten(p) * mirror).collect())
}

fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Every fan triangle from corner 0 turns left, and so does every corner: then the fan covers the polygon once.
fn is_convex(ring: &[DVec2]) -> bool {
    let n = ring.len();
    (0..n).all(|i| orient(ring[i], ring[(i + 1) % n], ring[(i + 2) % n]) >= 0.0)
        && (1..n - 1).all(|i| orient(ring[0], ring[i], ring[i + 1]) > 0.0)
}

fn clip_ears(ring: &[u32], flat: &[DVec2], out: &mut Vec<[u32; 3]>) {
    let mut left: Vec<usize> = (0..ring.len()).collect();
    // Going on from the last ear instead of starting over keeps long outlines from fanning out of one corner.
    let (mut at, mut spent) = (0, 0);
    while left.len() > 3 && spent < BUDGET {
        let n = left.len();
        let ear = (0..n).map(|k| (at + k) % n).find(|&i| {
            spent += n;
            is_ear(&left, flat, i)
        });
        // A self-crossing ring may have no ear.
        let Some(i) = ear else { break };
        out.push([
            ring[left[(i + n - 1) % n]],
            ring[left[i]],
            ring[left[(i + 1) % n]],
        ]);
        left.remove(i);
        at = i;
    }
    let rest: Vec<u32> = left.iter().map(|&i| ring[i]).collect();
    fan(&rest, out);
}

fn is_ear(left: &[usize], flat: &[DVec2], i: usize) -> bool {
    let n = left.len();
    let (p, q, r) = (
        flat[left[(i + n - 1) % n]],
        flat[left[i]],
        flat[left[(i + 1) % n]],
    );
    orient(p, q, r) > 0.0
        && (2..n - 1).map(|k| flat[left[(i + k) % n]]).all(|x| {
            // A corner at the same place as an ear corner (a keyhole bridge) does not block it.
            x == p
                || x == q
                || x == r
                || !(orient(p, q, x) >= 0.0 && orient(q, r, x) >= 0.0 && orient(r, p, x) >= 0.0)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| points[i as usize]);
                (b - a).cross(c - a).z / 2.0
            })
            .sum()
    }

    fn cut(outline: &[(f64, f64)]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let points: Vec<DVec3> = outline
            .iter()
            .map(|&(x, y)| DVec3::new(x, y, 0.5))
            .collect();
        let face: Vec<u32> = (0..).take(points.len()).collect();
        let mut out = Vec::new();
        assert!(triangulate(&face, &points, &mut out));
        (points, out)
    }

    #[test]
    fn convex_polygon_becomes_a_fan() {
        let (points, t) = cut(&[(0.0, 0.0), (2.0, 0.0), (3.0, 1.0), (1.0, 2.0)]);
        assert_eq!(t, [[0, 1, 2], [0, 2, 3]]);
        assert!(area(&points, &t) > 0.0);
    }

    #[test]
    fn concave_polygon_is_covered_once() {
        let arrow = [(0.0, 0.0), (4.0, -2.0), (1.0, 0.0), (4.0, 2.0)];
        let (points, t) = cut(&arrow);
        assert_eq!(t.len(), 2);
        for triangle in &t {
            assert!(area(&points, &[*triangle]) > 0.0);
        }
        let comb: Vec<(f64, f64)> = vec![
            (0.0, 0.0),
            (7.0, 0.0),
            (7.0, 3.0),
            (6.0, 3.0),
            (6.0, 1.0),
            (5.0, 1.0),
            (5.0, 3.0),
            (4.0, 3.0),
            (4.0, 1.0),
            (3.0, 1.0),
            (3.0, 3.0),
            (2.0, 3.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (0.0, 3.0),
        ];
        let (points, t) = cut(&comb);
        assert_eq!(t.len(), comb.len() - 2);
        let shoelace: f64 = (0..comb.len())
            .map(|i| {
                let (a, b) = (comb[i], comb[(i + 1) % comb.len()]);
                (a.0 * b.1 - a.1 * b.0) / 2.0
            })
            .sum();
        let absolute: f64 = t.iter().map(|x| area(&points, &[*x]).abs()).sum();
        assert!((absolute - shoelace).abs() < 1e-12, "{absolute} {shoelace}");
    }

    #[test]
    fn clockwise_polygon_stays_clockwise() {
        let (points, t) = cut(&[(4.0, 2.0), (1.0, 0.0), (4.0, -2.0), (0.0, 0.0)]);
        for triangle in &t {
            assert!(area(&points, &[*triangle]) < 0.0);
        }
    }

    #[test]
    fn degenerate_polygons_neither_panic_nor_vanish() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::X * 3.0];
        let mut out = Vec::new();
        assert!(triangulate(&[0, 1, 2, 3], &line, &mut out));
        assert_eq!(out.len(), 2);
        let nan = [DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z];
        assert!(triangulate(&[0, 1, 2, 3], &nan, &mut out));
        assert!(!triangulate(&[0, 1, 0, 1], &line, &mut out));
        assert!(!triangulate(&[2, 2, 2, 2, 2], &line, &mut out));
        assert!(!triangulate(&[], &line, &mut out));
        assert_eq!(out.len(), 4);
        let bow = [
            DVec3::ZERO,
            DVec3::new(1.0, 1.0, 0.0),
            DVec3::X,
            DVec3::Y,
            DVec3::new(0.5, 3.0, 0.0),
        ];
        assert!(triangulate(&[0, 1, 2, 3, 4], &bow, &mut out));
        assert_eq!(out.len(), 7);
    }
}
