//! sRGB and the light that it stands for (IEC 61966-2-1).

use super::{Image, ImageError};

/// Light of a byte, 0..=1.
pub(super) fn linear_from_srgb(byte: u8) -> f64 {
    let value = f64::from(byte) / 255.0;
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// The byte nearest to so much light; 0..=1, what lies outside is taken for the end.
fn srgb_from_linear(light: f64) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0..=255"
    )]
    let byte = (255.0 * value).round() as u8;
    byte
}

/// The bytes of `image` at a `factor`th of its width and height: each pixel has the mean light of a square of `factor`² pixels, and their mean alpha.
///
/// # Errors
/// [`ImageError::Factor`] where width or height is no multiple of `factor`.
pub fn shrunk(image: Image<'_>, factor: usize) -> Result<Vec<u8>, ImageError> {
    let (width, height) = (image.width(), image.height());
    if factor == 0 || !width.is_multiple_of(factor) || !height.is_multiple_of(factor) {
        return Err(ImageError::Factor {
            width,
            height,
            factor,
        });
    }
    let light: Vec<f64> = (0..=255_u8).map(linear_from_srgb).collect();
    let columns = width / factor;
    let mut sums = vec![[0.0; 4]; columns * (height / factor)];
    for (k, [r, g, b, a]) in image.pixels().enumerate() {
        let sum = &mut sums[k / width / factor * columns + k % width / factor];
        for (sum, byte) in sum.iter_mut().zip([r, g, b]) {
            *sum += light[usize::from(byte)];
        }
        sum[3] += f64::from(a) / 255.0;
    }
    let count = (factor * factor) as f64;
    let bytes = |sum: [f64; 4]| {
        let [r, g, b, a] = sum.map(|sum| sum / count);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..=255"
        )]
        let alpha = (255.0 * a).round() as u8;
        [
            srgb_from_linear(r),
            srgb_from_linear(g),
            srgb_from_linear(b),
            alpha,
        ]
    };
    Ok(sums.into_iter().flat_map(bytes).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_from_light() {
        for byte in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb(byte)), byte);
        }
    }

    #[test]
    fn squares_become_pixels_of_their_mean_light() {
        // Half of the light of white is 188; a mean of bytes would be 128.
        let [w, b, g] = [[255, 255, 255, 255], [0, 0, 0, 255], [90, 90, 90, 0]];
        let rgba = [w, b, g, g, b, w, g, g].concat();
        let image = Image::new(4, 2, &rgba).unwrap();
        let small = shrunk(image, 2).unwrap();
        assert_eq!(small, [188, 188, 188, 255, 90, 90, 90, 0]);
        assert_eq!(shrunk(image, 1).unwrap(), rgba);
    }

    #[test]
    fn what_does_not_divide_is_refused() {
        let rgba = [0; 4 * 12];
        let image = Image::new(4, 3, &rgba).unwrap();
        for factor in [0, 2, 3, 4] {
            let factor_is_told =
                |e| matches!(e, ImageError::Factor { factor: f, .. } if f == factor);
            assert!(shrunk(image, factor).is_err_and(factor_is_told));
        }
    }
}
