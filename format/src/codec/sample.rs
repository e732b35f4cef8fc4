//! What can be predicted and coded: positions, normals, colours, each as three integers.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sums are below 2^28; residuals of bytes are taken modulo 256; vectors of normals have components up to 255"
)]

use super::octahedral;
use crate::lattice::LATTICE_BITS;

/// A value at a sample of a grid.
pub(crate) trait Sample: Copy + Default {
    /// What it is predicted as: itself, or what it is made from.
    type Code: Copy;

    /// Itself, or what it was made from.
    fn code(self) -> Self::Code;

    /// As an integer vector that can be weighted and summed; components below 2^22 in magnitude.
    fn lift(self) -> [i32; 3];

    /// From a weighted sum with weights of total `2^log_weight`; `fallback` where the sum says nothing.
    fn lower(sum: [i32; 3], log_weight: u32, fallback: Self) -> Self::Code;

    /// What must be stored so that [`Sample::restore`] gives `self`.
    fn residual(self, prediction: Self::Code) -> [i32; 3];

    /// The value with `residual` against `prediction`; `None` when it leaves its range.
    fn restore(prediction: Self::Code, residual: [i32; 3]) -> Option<Self>;
}

/// A position in units of 2^shift lattice units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Position(pub(crate) [i32; 3]);

impl Position {
    /// The position at `place` on the lattice, of which the lowest `shift` bits are zero.
    pub(crate) fn of(place: [u32; 3], shift: u8) -> Self {
        Self(place.map(|c| (c >> shift).cast_signed()))
    }
}

/// An octahedral normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Normal {
    code: [u8; 2],
    /// That of the code, which is asked for four times and more.
    vector: [i16; 3],
}

impl Normal {
    /// The normal of `code`.
    pub(crate) fn new(code: [u8; 2]) -> Self {
        let vector = octahedral::vector(code).map(|c| c as i16);
        Self { code, vector }
    }
}

impl Default for Normal {
    fn default() -> Self {
        Self::new([0; 2])
    }
}

/// An sRGB colour.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Colour(pub(crate) [u8; 3]);

/// `sum / 2^log_weight`, rounded half up.
fn rounded(sum: i32, log_weight: u32) -> i32 {
    (sum + (1 << log_weight >> 1)) >> log_weight
}

impl Sample for Position {
    type Code = Self;

    fn code(self) -> Self {
        self
    }

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
    type Code = [u8; 2];

    fn code(self) -> [u8; 2] {
        self.code
    }

    fn lift(self) -> [i32; 3] {
        self.vector.map(i32::from)
    }

    fn lower(sum: [i32; 3], _: u32, fallback: Self) -> [u8; 2] {
        octahedral::from_vector(sum).unwrap_or(fallback.code)
    }

    fn residual(self, prediction: [u8; 2]) -> [i32; 3] {
        let ([a, b], [c, d]) = (self.code, prediction);
        [
            i32::from(a.wrapping_sub(c)),
            i32::from(b.wrapping_sub(d)),
            0,
        ]
    }

    fn restore([c, d]: [u8; 2], [a, b, _]: [i32; 3]) -> Option<Self> {
        Some(Self::new([
            c.wrapping_add(a as u8),
            d.wrapping_add(b as u8),
        ]))
    }
}

impl Sample for Colour {
    type Code = Self;

    fn code(self) -> Self {
        self
    }

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
            let (normal, near) = (Normal::new([a[0], a[1]]), Normal::new([b[0], b[1]]));
            prop_assert_eq!(Normal::restore(near.code(), normal.residual(near.code())), Some(normal));
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
