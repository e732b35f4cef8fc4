//! sRGB bytes to linear light and back, by table: images have many texels.

use crate::atlas::colour::{linear_from_srgb, srgb_from_linear};
use glam::Vec3;

/// Entries of the table back; its argument is the root of the light, so dark shades have as many as bright ones.
const ROOTS: usize = 4096;

/// Both directions.
#[derive(Debug)]
pub struct Light {
    linear: [f32; 256],
    srgb: Vec<u8>,
}

impl Light {
    /// Makes the tables.
    pub fn new() -> Self {
        let mut linear = [0.0; 256];
        for (value, byte) in linear.iter_mut().zip(0..=255u8) {
            *value = linear_from_srgb([byte; 3]).x;
        }
        let srgb = (0..ROOTS)
            .map(|i| {
                let root = i as f32 / (ROOTS - 1) as f32;
                srgb_from_linear(Vec3::splat(root * root))[0]
            })
            .collect();
        Self { linear, srgb }
    }

    /// Linear light, 0..=1, of an sRGB colour.
    pub fn linear(&self, [r, g, b]: [u8; 3]) -> Vec3 {
        Vec3::new(
            self.linear[usize::from(r)],
            self.linear[usize::from(g)],
            self.linear[usize::from(b)],
        )
    }

    /// sRGB of linear light; clamps to 0..=1.
    pub fn srgb(&self, light: Vec3) -> [u8; 3] {
        light.to_array().map(|c| {
            let root = c.clamp(0.0, 1.0).sqrt() * (ROOTS - 1) as f32 + 0.5;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the table; NaN becomes 0"
            )]
            let index = root as usize;
            self.srgb[index.min(ROOTS - 1)]
        })
    }
}

impl Default for Light {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_round_trip() {
        let light = Light::new();
        for byte in 0..=255 {
            assert_eq!(light.srgb(light.linear([byte; 3])), [byte; 3]);
        }
        assert_eq!(light.srgb(Vec3::new(f32::NAN, -1.0, 2.0)), [0, 0, 255]);
    }
}
