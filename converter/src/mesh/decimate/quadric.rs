//! Squared distances from planes and from normals, added up.

use glam::{DMat3, DVec3};
use std::ops::AddAssign;

/// A sum over triangles of their area times the squared distance from their planes (Garland & Heckbert 1997), and times the squared
/// difference from the normals that theirs come to there (Hoppe, "New Quadric Metric for Simplifying Meshes with Appearance Attributes", 1999).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz.
    squares: DVec3,
    /// yz, zx, xy.
    products: DVec3,
    linear: DVec3,
    constant: f64,
    area: f64,
    /// By component of the normal, area times its gradient, and times its value at the origin.
    gradients: [DVec3; 3],
    values: DVec3,
}

impl Quadric {
    /// Of one triangle, whose corners have `normals` of a length that stands for as much distance; nothing, if it has no area.
    pub(super) fn of([a, b, c]: [DVec3; 3], normals: [DVec3; 3]) -> Self {
        let (ab, ac) = (b - a, c - a);
        let doubled = ab.cross(ac);
        let square = doubled.length_squared();
        let Some(normal) = doubled.try_normalize() else {
            return Self::default();
        };
        let area = doubled.length() / 2.0;
        let mut sum = Self {
            area,
            ..Self::default()
        };
        sum.add(normal, -normal.dot(a), area);
        // Of the barycentric coordinates of b and c.
        let (to_b, to_c) = (ac.cross(doubled) / square, doubled.cross(ab) / square);
        for (k, gradients) in sum.gradients.iter_mut().enumerate() {
            let [at_a, at_b, at_c] = normals.map(|n| n[k]);
            *gradients = (at_b - at_a) * to_b + (at_c - at_a) * to_c;
            sum.values[k] = at_a - gradients.dot(a);
        }
        for k in 0..3 {
            sum.add(sum.gradients[k], sum.values[k], area);
            sum.gradients[k] *= area;
        }
        sum.values *= area;
        sum
    }

    /// Adds `weight` times the square of `gradient` · p + `offset`.
    fn add(&mut self, gradient: DVec3, offset: f64, weight: f64) {
        let g = gradient;
        self.squares += weight * g * g;
        self.products += weight * DVec3::new(g.y, g.z, g.x) * DVec3::new(g.z, g.x, g.y);
        self.linear += weight * offset * g;
        self.constant += weight * offset * offset;
    }

    /// The sum at a vertex with the normal that is best there: what is left of it depends on the place alone.
    fn of_places(&self) -> Self {
        let mut of_places = *self;
        for k in 0..3 {
            of_places.add(
                self.gradients[k],
                self.values[k],
                -1.0 / self.area.max(f64::MIN_POSITIVE),
            );
        }
        of_places
    }

    fn times(&self, p: DVec3) -> DVec3 {
        let Self {
            squares: s,
            products: m,
            ..
        } = self;
        DVec3::new(
            s.x * p.x + m.z * p.y + m.y * p.z,
            m.z * p.x + s.y * p.y + m.x * p.z,
            m.y * p.x + m.x * p.y + s.z * p.z,
        )
    }

    /// Mean squared distance of a vertex from planes and normals.
    pub(super) fn mean_square(&self, p: DVec3) -> f64 {
        let mut sum = p.dot(self.times(p)) + 2.0 * self.linear.dot(p) + self.constant;
        for k in 0..3 {
            sum -= (self.gradients[k].dot(p) + self.values[k]).powi(2)
                / self.area.max(f64::MIN_POSITIVE);
        }
        (sum / self.area.max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// The best normal of a vertex there, of length 1; zero where no triangle has one.
    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        let sum = self.gradients.map(|gradient| gradient.dot(p));
        (DVec3::from_array(sum) + self.values).normalize_or_zero()
    }

    /// The point nearest to planes and normals, and where several are equally near the one nearest to `middle`.
    pub(super) fn best(&self, middle: DVec3) -> DVec3 {
        /// Weight of the distance from the middle.
        const PULL: f64 = 1e-3;
        let of_places = self.of_places();
        let (s, m) = (of_places.squares, of_places.products);
        let pull = PULL * self.area;
        let matrix = DMat3::from_cols(
            DVec3::new(s.x + pull, m.z, m.y),
            DVec3::new(m.z, s.y + pull, m.x),
            DVec3::new(m.y, m.x, s.z + pull),
        );
        let step = matrix.inverse() * -(of_places.times(middle) + of_places.linear);
        if step.is_finite() {
            middle + step
        } else {
            middle
        }
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        self.squares += other.squares;
        self.products += other.products;
        self.linear += other.linear;
        self.constant += other.constant;
        self.area += other.area;
        for (own, other) in self.gradients.iter_mut().zip(other.gradients) {
            *own += other;
        }
        self.values += other.values;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three triangles around a corner, with normals that turn from corner to corner.
    fn fan() -> [([DVec3; 3], [DVec3; 3]); 3] {
        let ring = [DVec3::X, DVec3::Y, DVec3::new(-1.0, -0.5, 0.3)];
        let tops = [0.1, 0.4, -0.3].map(|tilt| DVec3::new(tilt, tilt * tilt, 1.0));
        let middle = DVec3::new(0.1, 0.0, 0.2);
        [0, 1, 2].map(|k| {
            let next = (k + 1) % 3;
            (
                [middle, ring[k], ring[next]],
                [DVec3::Z, tops[k], tops[next]],
            )
        })
    }

    /// Area, distance from the plane and normal there of each triangle, by its barycentric coordinates.
    fn seen(p: DVec3) -> [(f64, f64, DVec3); 3] {
        fan().map(|([a, b, c], [l, m, n])| {
            let doubled = (b - a).cross(c - a);
            let normal = doubled / doubled.length();
            let height = normal.dot(p - a);
            let foot = p - height * normal;
            let part =
                |q: DVec3, r: DVec3| (q - foot).cross(r - foot).dot(normal) / doubled.length();
            let there = part(b, c) * l + part(c, a) * m + part(a, b) * n;
            (doubled.length() / 2.0, height, there)
        })
    }

    fn sum() -> Quadric {
        let mut sum = Quadric::default();
        for (corners, normals) in fan() {
            sum += Quadric::of(corners, normals);
        }
        sum
    }

    #[test]
    fn sums_are_those_of_distances_and_of_normals_from_their_mean() {
        for p in [DVec3::ZERO, DVec3::new(0.3, -0.2, 0.7)] {
            let triangles = seen(p);
            let area: f64 = triangles.iter().map(|t| t.0).sum();
            let mean = triangles.iter().map(|t| t.0 * t.2).sum::<DVec3>() / area;
            let of = |t: &(f64, f64, DVec3)| t.0 * (t.1.powi(2) + t.2.distance_squared(mean));
            let wanted = triangles.iter().map(of).sum::<f64>() / area;
            let found = sum().mean_square(p);
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
            assert!(sum().normal(p).distance(mean / mean.length()) < 1e-12);
        }
    }

    #[test]
    fn nothing_beside_the_best_place_is_better() {
        let best = sum().best(DVec3::ZERO);
        let least = sum().mean_square(best);
        for axis in DVec3::AXES {
            for step in [0.05, -0.05] {
                assert!(sum().mean_square(best + step * axis) > least);
            }
        }
    }

    #[test]
    fn what_has_no_area_counts_for_nothing() {
        let flat = Quadric::of([DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], [DVec3::Z; 3]);
        assert_eq!(flat.normal(DVec3::ONE), DVec3::ZERO);
        assert!(flat.mean_square(DVec3::ONE).abs() <= 0.0);
    }
}
