//! Prediction of normals: from coarser normals, from the decoded positions, or from both.
//!
//! Interpolation misses the detail that the finer positions show; the positions are too rough once samples
//! come closer than a few quantization steps, and normals need not be those of the surface at all. The writer
//! takes what is smallest, page by page. Measured: on fractal surfaces with true normals up to 20 % below
//! interpolation alone where samples are 16 steps apart, equal at 8 and fewer; on scans resampled to their own
//! error interpolation wins on 19 pages of 20 (dragon) to all (bunny).

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "differences have 22 bits and products 43; what is cast was shifted to 19"
)]

use super::grid::{Grid, Odd};
use super::octahedral;
use super::sample::Position;
use crate::Error;

/// What the odd normals of a payload are predicted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Prediction {
    /// The coarser normals.
    #[default]
    Interpolated = 0,
    /// The sum of both.
    Mixed = 1,
    /// The positions.
    Geometric = 2,
}

impl Prediction {
    /// All of them, by code.
    pub(crate) const ALL: [Self; 3] = [Self::Interpolated, Self::Mixed, Self::Geometric];

    /// The prediction numbered `code`.
    pub(crate) fn from_code(what: &'static str, code: u8) -> Result<Self, Error> {
        let known = Self::ALL.get(usize::from(code)).copied();
        known.ok_or(Error::Value {
            what,
            found: u64::from(code),
        })
    }

    /// Predicts the code of the normal of an odd sample that is `interpolated` from coarser ones; `positions` of the same resolution are complete.
    pub(crate) fn predict(
        self,
        interpolated: [u8; 2],
        positions: &Grid<Position>,
        odd: Odd,
    ) -> [u8; 2] {
        if self == Self::Interpolated {
            return interpolated;
        }
        match surface_normal(positions, odd) {
            None => interpolated,
            Some(geometric) if self == Self::Geometric => geometric,
            Some(geometric) => {
                let [[a, b, c], [d, e, f]] = [interpolated, geometric].map(octahedral::vector);
                octahedral::from_vector([a + d, b + e, c + f]).unwrap_or(interpolated)
            }
        }
    }
}

/// The normal that the neighbours' positions span; at the grid's border the sample stands for the one missing.
fn surface_normal(positions: &Grid<Position>, Odd { i, j }: Odd) -> Option<[u8; 2]> {
    let last = positions.side() - 1;
    let along_u = difference(
        positions.get((i + 1).min(last), j),
        positions.get(i.saturating_sub(1), j),
    );
    let along_v = difference(
        positions.get(i, (j + 1).min(last)),
        positions.get(i, j.saturating_sub(1)),
    );
    lowered(cross(along_u, along_v))
}

/// From the second position to the first: 22 bits.
pub(crate) fn difference(Position([a, b, c]): Position, Position([d, e, f]): Position) -> [i64; 3] {
    [
        i64::from(a) - i64::from(d),
        i64::from(b) - i64::from(e),
        i64::from(c) - i64::from(f),
    ]
}

/// The cross product of two differences: 44 bits.
pub(crate) fn cross([ax, ay, az]: [i64; 3], [bx, by, bz]: [i64; 3]) -> [i64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

/// The code of the normal along a vector; `None` for zero.
pub(crate) fn lowered(vector: [i64; 3]) -> Option<[u8; 2]> {
    let largest = vector.iter().map(|c| c.unsigned_abs()).max().unwrap_or(0);
    let shift = (u64::BITS - largest.leading_zeros()).saturating_sub(COMPONENT_BITS);
    octahedral::from_vector(vector.map(|c| (c >> shift) as i32))
}

/// Magnitude bits of a normal's components before it is coded: enough for 8-bit codes.
const COMPONENT_BITS: u32 = 19;

#[cfg(test)]
mod tests {
    use super::*;

    fn up() -> [u8; 2] {
        octahedral::encode([0.0, 0.0, 1.0])
    }

    #[test]
    fn a_slope_turns_the_prediction() {
        let positions = (0..81).map(|k| Position([k % 9 * 1000, k / 9 * 1000, k % 9 * 1000]));
        let positions = Grid::new(3, positions.collect()).unwrap();
        for (prediction, degrees) in Prediction::ALL.into_iter().zip([0.0, 22.5, 45.0]) {
            let normal = prediction.predict(up(), &positions, Odd { i: 3, j: 4 });
            let [x, y, z] = octahedral::decode(normal);
            let angle = (-x).atan2(z).to_degrees();
            assert!(
                (angle - degrees).abs() < 5.0 && y.abs() < 0.02,
                "{prediction:?}: {angle}"
            );
        }
    }

    #[test]
    fn a_surface_without_area_leaves_the_interpolation() {
        let point = Grid::new(3, vec![Position([7; 3]); 81]).unwrap();
        for prediction in Prediction::ALL {
            assert_eq!(prediction.predict(up(), &point, Odd { i: 0, j: 1 }), up());
        }
    }

    #[test]
    fn the_largest_differences_do_not_overflow() {
        let far = (1 << 21) - 1;
        let corners = [[0, far, 0], [far, 0, 0], [0, 0, far]];
        let positions = (0..9).map(|k| Position(corners[k % 3])).collect();
        let positions = Grid::new(1, positions).unwrap();
        for odd in [[1, 0], [0, 1], [1, 2], [2, 1], [1, 1]].map(|[i, j]| Odd { i, j }) {
            Prediction::Geometric.predict([9, 200], &positions, odd);
        }
    }
}
