//! Squared distances from planes, added up.

use glam::{DMat3, DVec3};
use std::ops::AddAssign;

/// A sum over triangles of their area times the squared distance from their planes (Garland & Heckbert 1997).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz.
    squares: DVec3,
    /// yz, zx, xy.
    products: DVec3,
    linear: DVec3,
    constant: f64,
    area: f64,
}

impl Quadric {
    /// Of one triangle; nothing, if it has no area.
    pub(super) fn of([a, b, c]: [DVec3; 3]) -> Self {
        let doubled = (b - a).cross(c - a);
        let Some(normal) = doubled.try_normalize() else {
            return Self::default();
        };
        let area = doubled.length() / 2.0;
        let offset = -normal.dot(a);
        Self {
            squares: area * normal * normal,
            products: area
                * DVec3::new(normal.y, normal.z, normal.x)
                * DVec3::new(normal.z, normal.x, normal.y),
            linear: area * offset * normal,
            constant: area * offset * offset,
            area,
        }
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

    /// Mean squared distance of a point from the planes.
    pub(super) fn mean_square(&self, p: DVec3) -> f64 {
        let sum = p.dot(self.times(p)) + 2.0 * self.linear.dot(p) + self.constant;
        (sum / self.area.max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// The point nearest to the planes, and where several are equally near the one nearest to `middle`.
    pub(super) fn best(&self, middle: DVec3) -> DVec3 {
        /// Weight of the distance from the middle.
        const PULL: f64 = 1e-3;
        let (s, m) = (self.squares, self.products);
        let pull = PULL * self.area;
        let matrix = DMat3::from_cols(
            DVec3::new(s.x + pull, m.z, m.y),
            DVec3::new(m.z, s.y + pull, m.x),
            DVec3::new(m.y, m.x, s.z + pull),
        );
        let step = matrix.inverse() * -(self.times(middle) + self.linear);
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
    }
}
