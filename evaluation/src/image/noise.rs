//! Squared differences of pixels: mean square, root of it, and peak signal to noise.

use super::{Image, ImageError, Mask, mask::same_size};

/// Mean squared difference of red, green and blue over the pixels of `mask`, 0..=255² (stored values, sRGB); `None` for
/// an empty mask.
///
/// # Errors
/// When the sizes differ.
pub fn mean_square(
    first: Image<'_>,
    second: Image<'_>,
    mask: &Mask,
) -> Result<Option<f64>, ImageError> {
    let size = (first.width(), first.height());
    same_size(size, (second.width(), second.height()))?;
    same_size(size, (mask.width(), mask.height()))?;
    let (mut sum, mut count) = (0.0, 0_u64);
    for ((a, b), _) in first
        .pixels()
        .zip(second.pixels())
        .zip(mask.as_slice())
        .filter(|&(_, &inside)| inside)
    {
        for channel in 0..3 {
            sum += f64::from(a[channel].abs_diff(b[channel])).powi(2);
        }
        count += 3;
    }
    Ok((count > 0).then(|| sum / count as f64))
}

/// Peak signal to noise, decibels, of a mean square of 8-bit values; `None` (infinite) for equal images.
pub fn psnr_db(mean_square: f64) -> Option<f64> {
    (mean_square > 0.0).then(|| 10.0 * (255.0 * 255.0 / mean_square).log10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::silhouette;

    #[test]
    fn a_constant_difference_has_the_closed_form() {
        let (a, b) = (
            [[100, 100, 100, 255]; 6].concat(),
            [[110, 100, 95, 0]; 6].concat(),
        );
        let [a, b] = [&a, &b].map(|bytes| Image::new(3, 2, bytes).unwrap());
        let mask = silhouette(a, [0; 3]);
        let found = mean_square(a, b, &mask).unwrap().unwrap();
        assert!((found - 125.0 / 3.0).abs() < 1e-12);
        let db = psnr_db(found).unwrap();
        assert!((db - 20.0 * (255.0 / found.sqrt()).log10()).abs() < 1e-9);
        assert_eq!(mean_square(a, a, &mask), Ok(Some(0.0)));
        assert_eq!(psnr_db(0.0), None);
        assert_eq!(mean_square(a, b, &Mask::empty(3, 2)), Ok(None));
    }
}
