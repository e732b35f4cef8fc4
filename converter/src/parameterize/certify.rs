//! Exact orientation of every face.
//!
//! The sides lie in order on the square's boundary, so if every face is positively oriented the map is one to one and
//! onto. The predicate is Shewchuk's ("Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", 1997): its sign is that of the exact determinant of the stored coordinates.

use glam::DVec2;
use robust::{Coord, orient2d};

/// Twice the signed area of (a, b, c); its sign is exact.
pub(crate) fn orientation(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Number of triangles that are not strictly counter-clockwise; NaN coordinates count.
pub(super) fn count_flipped(triangles: &[[u32; 3]], uv: &[DVec2]) -> u32 {
    let mut flipped = 0;
    for corners in triangles {
        let [a, b, c] = corners.map(|vertex| uv[vertex as usize]);
        let upright = orientation(a, b, c) > 0.0;
        flipped += u32::from(!upright);
    }
    flipped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flipped_and_a_flat_face_are_counted() {
        let uv = [
            DVec2::ZERO,
            DVec2::X,
            DVec2::Y,
            DVec2::new(0.5, 0.5),
            DVec2::new(f64::NAN, 0.5),
        ];
        assert_eq!(count_flipped(&[[0, 1, 2]], &uv), 0);
        assert_eq!(count_flipped(&[[0, 2, 1]], &uv), 1);
        assert_eq!(count_flipped(&[[1, 2, 3], [0, 1, 4]], &uv), 2);
    }

    #[test]
    fn a_face_thinner_than_rounding_is_seen() {
        let tiny = f64::EPSILON / 4.0;
        let uv = [
            DVec2::new(0.1, 0.1),
            DVec2::new(0.3, 0.3),
            DVec2::new(0.2, 0.2 + tiny),
        ];
        let exact = count_flipped(&[[0, 1, 2]], &uv) == 0;
        assert_eq!(exact, orientation(uv[0], uv[1], uv[2]) > 0.0);
        let doubled = [
            DVec2::new(0.5, 0.5),
            DVec2::new(12.0, 12.0),
            DVec2::new(24.0, 24.0_f64.next_up()),
        ];
        assert_eq!(count_flipped(&[[0, 1, 2]], &doubled), 0);
    }
}
