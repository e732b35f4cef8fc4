//! Structural similarity.
//!
//! Wang, Bovik, Sheikh & Simoncelli, "Image Quality Assessment: From Error Visibility to Structural
//! Similarity", 2004: 11 × 11 Gaussian windows, σ = 1.5, on luma, K₁ = 0.01, K₂ = 0.03.
//! Differs: the mean is taken over the pixels of a mask (a large background would drown the object), and
//! windows at the image's border are cut off and weighed anew.

use super::{Image, ImageError, Mask, mask::same_size};

const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Mean structural similarity over the pixels of `mask`, −1..=1, 1 for equal images; `None` for an empty mask.
///
/// # Errors
/// When the sizes differ.
pub fn ssim(first: Image<'_>, second: Image<'_>, mask: &Mask) -> Result<Option<f64>, ImageError> {
    let size = (first.width(), first.height());
    same_size(size, (second.width(), second.height()))?;
    same_size(size, (mask.width(), mask.height()))?;
    if mask.is_empty() {
        return Ok(None);
    }
    let (a, b) = (first.luma(), second.luma());
    let product =
        |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x * y).collect() };
    let mean_a = blurred(&a, size);
    let mean_b = blurred(&b, size);
    let square_a = blurred(&product(&a, &a), size);
    let square_b = blurred(&product(&b, &b), size);
    let cross = blurred(&product(&a, &b), size);

    let (mut sum, mut count) = (0.0, 0_u64);
    for pixel in mask
        .as_slice()
        .iter()
        .enumerate()
        .filter_map(|(pixel, &inside)| inside.then_some(pixel))
    {
        let (ma, mb) = (mean_a[pixel], mean_b[pixel]);
        let variance_a = (square_a[pixel] - ma * ma).max(0.0);
        let variance_b = (square_b[pixel] - mb * mb).max(0.0);
        let covariance = cross[pixel] - ma * mb;
        sum += ((2.0 * ma * mb + C1) * (2.0 * covariance + C2))
            / ((ma * ma + mb * mb + C1) * (variance_a + variance_b + C2));
        count += 1;
    }
    Ok(Some(sum / count as f64))
}

fn blurred(values: &[f64], (width, height): (usize, usize)) -> Vec<f64> {
    let rows = blurred_along(values, width, |line, i| line * width + i, height);
    blurred_along(&rows, height, |line, i| i * width + line, width)
}

/// Blurs `lines` lines of `len` values; `at` finds value i of a line.
fn blurred_along(
    values: &[f64],
    len: usize,
    at: impl Fn(usize, usize) -> usize,
    lines: usize,
) -> Vec<f64> {
    let weights: [f64; RADIUS + 1] =
        std::array::from_fn(|distance| (-0.5 * (distance as f64 / SIGMA).powi(2)).exp());
    let mut out = vec![0.0; values.len()];
    for line in 0..lines {
        for i in 0..len {
            let (mut sum, mut total) = (0.0, 0.0);
            for j in i.saturating_sub(RADIUS)..(i + RADIUS + 1).min(len) {
                let weight = weights[i.abs_diff(j)];
                sum += weight * values[at(line, j)];
                total += weight;
            }
            out[at(line, i)] = sum / total;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::silhouette;

    const SIZE: usize = 24;

    fn pattern(value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
        (0..SIZE * SIZE)
            .flat_map(|pixel| {
                let v = value(pixel % SIZE, pixel / SIZE);
                [v, v, v, 255]
            })
            .collect()
    }

    fn similarity(a: &[u8], b: &[u8]) -> f64 {
        let image = |bytes| Image::new(SIZE, SIZE, bytes).unwrap();
        let everything = silhouette(image(a), [1, 2, 3]);
        ssim(image(a), image(b), &everything).unwrap().unwrap()
    }

    fn stripes(x: usize, _: usize) -> u8 {
        if (x / 3).is_multiple_of(2) { 40 } else { 200 }
    }

    #[test]
    fn equal_images_are_wholly_similar() {
        let a = pattern(stripes);
        assert!((similarity(&a, &a) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn similarity_falls_as_images_part() {
        let a = pattern(stripes);
        let brighter = similarity(&a, &pattern(|x, y| stripes(x, y) + 20));
        let inverted = similarity(&a, &pattern(|x, y| 240 - stripes(x, y)));
        assert!(brighter > 0.9 && brighter < 1.0, "{brighter}");
        assert!(inverted < 0.0, "{inverted}");
    }

    #[test]
    fn constant_images_have_the_closed_form() {
        let (a, b) = (100.0, 150.0);
        let expected = (2.0 * a * b + C1) / (a * a + b * b + C1);
        let found = similarity(&pattern(|_, _| 100), &pattern(|_, _| 150));
        assert!((found - expected).abs() < 1e-9);
    }

    #[test]
    fn pixels_outside_the_mask_do_not_count() {
        let a = pattern(stripes);
        let b = pattern(|x, y| if y > 16 { 0 } else { stripes(x, y) });
        let mut top = Mask::empty(SIZE, SIZE);
        for x in 0..SIZE {
            top.insert(x, 3);
        }
        let image = |bytes| Image::new(SIZE, SIZE, bytes).unwrap();
        let masked = ssim(image(&a), image(&b), &top).unwrap().unwrap();
        assert!((masked - 1.0).abs() < 1e-12);
        assert!(similarity(&a, &b) < 0.9);
        assert_eq!(
            ssim(image(&a), image(&b), &Mask::empty(SIZE, SIZE)),
            Ok(None)
        );
    }
}
