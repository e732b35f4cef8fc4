//! Colours as files store them, to sRGB bytes.

/// A channel in 0..=1 to a byte, nearest; out of range and NaN are clamped.
pub(super) fn byte_from_unit(value: f64) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..=255 first; NaN gives 0"
    )]
    let byte = (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    byte
}

/// Three channels that may be in 0..=1 or in 0..=255, as text files write them without saying which.
pub(super) fn bytes_from_either(rgb: [f64; 3]) -> [u8; 3] {
    let scale = if rgb.iter().any(|&c| c > 1.0) {
        255.0
    } else {
        1.0
    };
    rgb.map(|c| byte_from_unit(c / scale))
}

/// Linear light to sRGB (IEC 61966-2-1), nearest byte.
///
/// The thresholds between neighbouring bytes are compared, not computed with `powf`, whose last bit differs between machines.
#[derive(Debug)]
pub(super) struct LinearToSrgb {
    /// Linear value half-way (in sRGB) between byte i and byte i + 1.
    thresholds: [f64; 255],
}

impl LinearToSrgb {
    pub(super) fn new() -> Self {
        let mut thresholds = [0.0; 255];
        for (i, t) in thresholds.iter_mut().enumerate() {
            *t = linear_from_srgb((i as f64 + 0.5) / 255.0);
        }
        Self { thresholds }
    }

    pub(super) fn byte(&self, linear: f64) -> u8 {
        let below = self.thresholds.partition_point(|&t| t <= linear);
        u8::try_from(below).unwrap_or(u8::MAX)
    }
}

fn linear_from_srgb(s: f64) -> f64 {
    if s <= 0.040_45 {
        return s / 12.92;
    }
    let x = (s + 0.055) / 1.055;
    let square = x * x;
    // x^2.4 = x² · (x²)^(1/5); the fifth root by Newton's method, with basic operations only.
    let mut root = 1.0;
    for _ in 0..40 {
        let r4 = root * root * root * root;
        root -= (r4 * root - square) / (5.0 * r4);
    }
    square * root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_bytes_survive_linear_light() {
        let table = LinearToSrgb::new();
        for byte in 0..=255_u8 {
            let s = f64::from(byte) / 255.0;
            let linear = if s <= 0.04045 {
                s / 12.92
            } else {
                ((s + 0.055) / 1.055).powf(2.4)
            };
            assert_eq!(table.byte(linear), byte);
        }
        assert_eq!(table.byte(f64::NAN), 0);
        assert_eq!(table.byte(-1.0), 0);
        assert_eq!(table.byte(2.0), 255);
    }

    #[test]
    fn channels_are_scaled_by_their_range() {
        assert_eq!(bytes_from_either([1.0, 0.0, 0.5]), [255, 0, 128]);
        assert_eq!(bytes_from_either([255.0, 0.0, 128.0]), [255, 0, 128]);
        assert_eq!(
            bytes_from_either([f64::NAN, -3.0, f64::INFINITY]),
            [0, 0, 255]
        );
    }
}
