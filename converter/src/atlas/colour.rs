//! sRGB to linear light and back (IEC 61966-2-1).

use glam::Vec3;

/// Linear-light colour, 0..=1, of 8-bit sRGB.
pub fn linear_from_srgb(srgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.040_45 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    }))
}

/// 8-bit sRGB of a linear-light colour; clamps to 0..=1.
pub fn srgb_from_linear(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|c| {
        let c = if c.is_finite() {
            c.clamp(0.0, 1.0)
        } else {
            0.0
        };
        let c = if c <= 0.003_130_8 {
            12.92 * c
        } else {
            1.055 * c.powf(1.0 / 2.4) - 0.055
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within 0..=255"
        )]
        let byte = (c * 255.0 + 0.5) as u8;
        byte
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_round_trip() {
        for b in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb([b; 3])), [b; 3]);
        }
    }
}
