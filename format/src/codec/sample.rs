//! What can be predicted and coded: positions, normals, colours, each as three integers.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sums are below 2^28; residuals of bytes are taken modulo 256"
)]

use super::octahedral;
use crate::lattice::LATTICE_BITS;

/// A value at a sample of a grid.
pub(crate) trait Sample: Copy + Default {
    /// As an integer vector that can be weighted and summed; components below 2^22 in magnitude.
    fn lift(self) -> [i32; 3];

    /// From a weighted sum with weights of total `2^log_weight`; `fallback` where the sum says nothing.
    fn lower(sum: [i32; 3], log_weight: u32, fallback: Self) -> Self;

    /// What must be stored so that [`Sample::restore`] gives `self`.
    fn residual(self, prediction: Self) -> [i32; 3];

    /// The value with `residual` against `prediction`; `None` when it leaves its range.
    fn restore(prediction: Self, residual: [i32; 3]) -> Option<Self>;
}

/// A position in units of 2^shift lattice units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Position(pub(crate) [i32; 3]);

/// An octahedral normal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Normal(pub(crate) [u8; 2]);

/// An sRGB colour.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Colour(pub(crate) [u8; 3]);

/// `sum / 2^log_weight`, rounded half up.
fn rounded(sum: i32, log_weight: u32) -> i32 {
    (sum + (1 << log_weight >> 1)) >> log_weight
}

impl Sample for Position {
    fn lift(self) -> [i32; 3] {
        self.0
    }

    fn lower(sum: [i32; 3], log_weight: u32, _: Self) -> Self {
        Self(sum.map(|c| rounded(c, log_weight)))
    }

    fn residual(self, prediction: Self) -> [i32; 3] {
        let ([a, b, c], [d, e, f]) = (self.0, prediction.0);
        [a - d, b - e, c - f]
    }

    fn restore(prediction: Self, residual: [i32; 3]) -> Option<Self> {
        let ([a, b, c], [d, e, f]) = (prediction.0, residual);
        let value = [a.checked_add(d)?, b.checked_add(e)?, c.checked_add(f)?];
        value
            .iter()
            .all(|c| (0..1 << LATTICE_BITS).contains(c))
            .then_some(Self(value))
    }
}

impl Sample for Normal {
    fn lift(self) -> [i32; 3] {
        octahedral::vector(self.0)
    }

    fn lower(sum: [i32; 3], _: u32, fallback: Self) -> Self {
        octahedral::from_vector(sum).map_or(fallback, Self)
    }

    fn residual(self, prediction: Self) -> [i32; 3] {
        let ([a, b], [c, d]) = (self.0, prediction.0);
        [
            i32::from(a.wrapping_sub(c)),
            i32::from(b.wrapping_sub(d)),
            0,
        ]
    }

    fn restore(prediction: Self, [a, b, _]: [i32; 3]) -> Option<Self> {
        let [c, d] = prediction.0;
        Some(Self([c.wrapping_add(a as u8), d.wrapping_add(b as u8)]))
    }
}

impl Sample for Colour {
    fn lift(self) -> [i32; 3] {
        self.0.map(i32::from)
    }

    fn lower(sum: [i32; 3], log_weight: u32, _: Self) -> Self {
        Self(sum.map(|c| rounded(c, log_weight).clamp(0, 255) as u8))
    }

    // Red and blue mostly move with green: their residuals are taken against green's.
    fn residual(self, prediction: Self) -> [i32; 3] {
        let ([r, g, b], [p, q, s]) = (self.0, prediction.0);
        let (r, g, b) = (r.wrapping_sub(p), g.wrapping_sub(q), b.wrapping_sub(s));
        [r.wrapping_sub(g), g, b.wrapping_sub(g)].map(i32::from)
    }

    fn restore(prediction: Self, residual: [i32; 3]) -> Option<Self> {
        let ([r, g, b], [p, q, s]) = (residual.map(|c| c as u8), prediction.0);
        Some(Self([
            p.wrapping_add(r).wrapping_add(g),
            q.wrapping_add(g),
            s.wrapping_add(b).wrapping_add(g),
        ]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn residuals_restore_every_value(a: [u8; 3], b: [u8; 3], p: [u32; 3], q: [u32; 3]) {
            let (colour, near) = (Colour(a), Colour(b));
            prop_assert_eq!(Colour::restore(near, colour.residual(near)), Some(colour));
            let (normal, near) = (Normal([a[0], a[1]]), Normal([b[0], b[1]]));
            prop_assert_eq!(Normal::restore(near, normal.residual(near)), Some(normal));
            let (p, q) = (Position(p.map(|c| (c >> 11) as i32)), Position(q.map(|c| (c >> 11) as i32)));
            prop_assert_eq!(Position::restore(q, p.residual(q)), Some(p));
        }
    }

    #[test]
    fn positions_outside_the_lattice_are_refused() {
        assert_eq!(Position::restore(Position([0; 3]), [-1, 0, 0]), None);
        assert_eq!(
            Position::restore(Position([(1 << 21) - 1; 3]), [0, 0, 1]),
            None
        );
        assert_eq!(Position::restore(Position([i32::MAX; 3]), [1; 3]), None);
    }
}
