//! Conservative codes for errors, cones and bounds: what is decoded always contains what was coded.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "coordinates have 21 bits, axes are 0..3, and every cast follows a clamp"
)]

use crate::codec::octahedral;
use crate::index::NormalCone;
use crate::lattice::{Bounds, LATTICE_BITS};

/// An error's code is the upper 18 bits of its `f32`, rounded up, less this: it covers 2^-20 to 2^44 in steps of
/// at most 0.1 %.
const ERROR_BASE: u32 = (127 - 20) << 10;
const ERROR_SHIFT: u32 = 13;

/// The smallest code whose error is at least `error`; `None` for what no error is (negative, NaN, above 2^43).
pub(crate) fn error_code(error: f32) -> Option<u16> {
    if error == 0.0 {
        return Some(0);
    }
    if !(error.is_finite() && error > 0.0) {
        return None;
    }
    let upper = (error.to_bits() + (1 << ERROR_SHIFT) - 1) >> ERROR_SHIFT;
    u16::try_from(upper.saturating_sub(ERROR_BASE).max(1)).ok()
}

/// The error of a code; code 0 is 0.
pub(crate) fn error_from_code(code: u16) -> f32 {
    if code == 0 {
        0.0
    } else {
        f32::from_bits((u32::from(code) + ERROR_BASE) << ERROR_SHIFT)
    }
}

/// The cosine of a cone's code: −1 + 2 · code / 255.
pub(crate) fn cosine_from_code(code: u8) -> f32 {
    (f64::from(code) / 127.5 - 1.0) as f32
}

/// The largest code whose cosine is at most `cosine`.
pub(crate) fn cosine_code(cosine: f64) -> u8 {
    let mut code = ((cosine.clamp(-1.0, 1.0) + 1.0) * 127.5).floor() as u8;
    while code > 0 && f64::from(cosine_from_code(code)) > cosine {
        code -= 1;
    }
    code
}

/// Axis code and cosine of a cone around a coded axis that holds `cone`.
pub(crate) fn widen_cone(cone: &NormalCone) -> ([u8; 2], f64) {
    let norm = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let axis = cone.axis.map(f64::from);
    let code = octahedral::encode(cone.axis);
    let coded = octahedral::decode(code).map(f64::from);
    // Rounding of f32 would weigh in the sine of the small angle between the axes.
    let length = norm(axis) * norm(coded);
    let cos = f64::from(cone.cos);
    if !(length.is_finite() && length > 0.0 && cos > -1.0) {
        return (code, -1.0);
    }
    let turn = (axis.iter().zip(coded).map(|(a, b)| a * b).sum::<f64>() / length).clamp(-1.0, 1.0);
    let cos = cos.min(1.0);
    // cos(α + δ), or nothing when α + δ is half a turn or more.
    let widened = if cos <= -turn {
        -1.0
    } else {
        cos * turn - ((1.0 - cos * cos) * (1.0 - turn * turn)).sqrt() - 1e-6
    };
    (code, widened.max(-1.0))
}

/// Bounds as stored: `min` and `size` in cells of 2^`shift`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BoundsCode {
    /// Size of a cell, 0..=20.
    pub(crate) shift: u8,
    /// Cell of the smallest coordinates.
    pub(crate) min: [u32; 3],
    /// Cells that the box spans beyond the first.
    pub(crate) size: [u8; 3],
}

impl BoundsCode {
    /// The smallest code, with at least 64 cells along the longest axis where there are as many, that holds `bounds`.
    pub(crate) fn new(bounds: &Bounds) -> Self {
        let longest = bounds
            .min
            .iter()
            .zip(bounds.max)
            .map(|(&min, max)| max.saturating_sub(min))
            .max()
            .unwrap_or(0);
        let shift = (0..LATTICE_BITS as u8)
            .find(|shift| longest >> shift < 128)
            .unwrap_or(0);
        let min = bounds.min.map(|c| c >> shift);
        let max = bounds.max.map(|c| c >> shift);
        let size = [0, 1, 2].map(|axis: usize| max[axis].saturating_sub(min[axis]).min(255) as u8);
        Self { shift, min, size }
    }

    /// The box; `None` when it leaves the lattice.
    pub(crate) fn bounds(&self) -> Option<Bounds> {
        let cells = 1u32 << LATTICE_BITS.checked_sub(u32::from(self.shift))?;
        let mut bounds = Bounds {
            min: [0; 3],
            max: [0; 3],
        };
        let ends = bounds.min.iter_mut().zip(&mut bounds.max);
        for ((low, high), (&min, &size)) in ends.zip(self.min.iter().zip(&self.size)) {
            let last = min.checked_add(u32::from(size))?;
            if last >= cells {
                return None;
            }
            *low = min << self.shift;
            *high = ((last + 1) << self.shift) - 1;
        }
        Some(bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn coded_errors_are_upper_bounds(bits in 0..0x7f80_0000u32) {
            let error = f32::from_bits(bits);
            if let Some(code) = error_code(error) {
                let decoded = error_from_code(code);
                prop_assert!(decoded >= error);
                prop_assert!(decoded <= error * 1.001 || code == 1);
                prop_assert_eq!(error_code(decoded), Some(code));
            } else {
                prop_assert!(error > 2f32.powi(43));
            }
        }

        #[test]
        fn coded_errors_keep_their_order(a in 0f32..1e7, b in 0f32..1e7) {
            let (low, high) = if a <= b { (a, b) } else { (b, a) };
            prop_assert!(error_code(low).unwrap() <= error_code(high).unwrap());
        }

        #[test]
        fn coded_bounds_contain_the_box(a: [u32; 3], b: [u32; 3], shrink in 0..21u32) {
            let point = |p: [u32; 3]| p.map(|c| (c >> 11) >> shrink);
            let (a, b) = (point(a), point(b));
            let bounds = Bounds {
                min: [0, 1, 2].map(|k: usize| a[k].min(b[k])),
                max: [0, 1, 2].map(|k: usize| a[k].max(b[k])),
            };
            let coded = BoundsCode::new(&bounds).bounds().unwrap();
            for k in 0..3 {
                prop_assert!(coded.min[k] <= bounds.min[k] && bounds.max[k] <= coded.max[k]);
            }
        }

        #[test]
        fn a_box_in_a_box_stays_inside_when_coded(a: [u16; 3], b: [u16; 3], c: [u16; 3], d: [u16; 3]) {
            let sort = |k: usize| { let mut v = [a[k], b[k], c[k], d[k]].map(|c| u32::from(c) * 31); v.sort_unstable(); v };
            let outer = Bounds { min: [0, 1, 2].map(|k| sort(k)[0]), max: [0, 1, 2].map(|k| sort(k)[3]) };
            let inner = Bounds { min: [0, 1, 2].map(|k| sort(k)[1]), max: [0, 1, 2].map(|k| sort(k)[2]) };
            let (outer, inner) = (BoundsCode::new(&outer).bounds().unwrap(), BoundsCode::new(&inner).bounds().unwrap());
            for k in 0..3 {
                prop_assert!(outer.min[k] <= inner.min[k] && inner.max[k] <= outer.max[k]);
            }
        }

        #[test]
        fn widened_cones_hold_the_cone(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0, cos in -1f32..1.0) {
            prop_assume!(x.abs() + y.abs() + z.abs() > 0.1);
            let length = (x * x + y * y + z * z).sqrt();
            let axis = [x / length, y / length, z / length];
            let (code, widened) = widen_cone(&NormalCone { axis, cos });
            let coded = octahedral::decode(code);
            let turn: f64 = axis.iter().zip(coded).map(|(a, b)| f64::from(*a) * f64::from(b)).sum();
            let squared = |v: [f32; 3]| v.iter().map(|c| f64::from(*c) * f64::from(*c)).sum::<f64>();
            let turn = turn / (squared(axis) * squared(coded)).sqrt();
            let angle = f64::from(cos).acos() + turn.min(1.0).acos();
            prop_assert!(widened <= angle.min(std::f64::consts::PI).cos() + 1e-9);
            prop_assert!(f64::from(cosine_from_code(cosine_code(widened))) <= widened);
        }
    }

    #[test]
    fn what_is_no_error_has_no_code() {
        for error in [f32::NAN, f32::INFINITY, -1.0, f32::MAX] {
            assert_eq!(error_code(error), None);
        }
        assert_eq!(error_code(0.0), Some(0));
        assert_eq!(error_code(f32::MIN_POSITIVE), Some(1));
    }
}
