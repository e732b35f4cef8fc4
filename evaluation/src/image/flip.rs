//! FLIP: the difference that a person sees when two images alternate in one place.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström & Fairchild, "FLIP: A Difference Evaluator for Alternating
//! Images", 2020: images of low dynamic range, seen from 0.7 m on a screen 0.7 m wide with 3840 pixels.
//! Differs: the filters are applied row by row and column by column (the one for blue and yellow is a sum of two that can
//! be), and the mean is taken over the pixels of a mask, as for [`ssim`](super::ssim).
//! Limit: a mean. A small part that looks wrong is lost in a large one that looks right; the paper pools by
//! percentiles as well.

use super::filter::{Kernel, filtered};
use super::light::linear_from_srgb;
use super::{Image, ImageError, Mask, mask::same_size};
use std::f64::consts::PI;

/// Pixels to a degree of the eye: 0.7 m · 3840 px / 0.7 m · π / 180.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// How far a pixel's neighbours have a say: the radius of the widest filter.
pub const REACH: usize = 10;

/// White of the CIE's D65, as the paper has it.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
const RGB_TO_XYZ: [[f64; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];
/// The inverse, to the published digits.
const XYZ_TO_RGB: [[f64; 3]; 3] = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];
/// Contrast sensitivity of the achromatic, the red-green and the blue-yellow channel: factors and widths of two Gaussians.
const SENSITIVITY: [[(f64, f64); 2]; 3] = [
    [(1.0, 0.0047), (0.0, 1e-5)],
    [(1.0, 0.0053), (0.0, 1e-5)],
    [(34.1, 0.04), (13.5, 0.025)],
];
/// Exponent of colour differences, and of features'.
const COLOUR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
/// Differences up to this part of the largest are spread over the first [`SPREAD_TO`] of the scale.
const SPREAD_FROM: f64 = 0.4;
const SPREAD_TO: f64 = 0.95;
/// Width of edges that are features, degrees.
const FEATURE_WIDTH: f64 = 0.082;

type Colour = [f64; 3];

/// Mean FLIP over the pixels of `mask`, 0 (no difference is seen) to 1; `None` for an empty mask.
///
/// # Errors
/// When the sizes differ.
pub fn flip(
    reference: Image<'_>,
    image: Image<'_>,
    mask: &Mask,
) -> Result<Option<f64>, ImageError> {
    same_size(
        (reference.width(), reference.height()),
        (mask.width(), mask.height()),
    )?;
    let map = flip_map(reference, image)?;
    let inside = map
        .iter()
        .zip(mask.as_slice())
        .filter(|&(_, &inside)| inside);
    let (sum, count) = inside.fold((0.0, 0_u64), |(sum, count), (value, _)| {
        (sum + value, count + 1)
    });
    Ok((count > 0).then(|| sum / count as f64))
}

/// FLIP of every pixel, row by row from the top.
///
/// # Errors
/// When the sizes differ.
pub fn flip_map(reference: Image<'_>, image: Image<'_>) -> Result<Vec<f64>, ImageError> {
    let size = (reference.width(), reference.height());
    same_size(size, (image.width(), image.height()))?;
    let opponent = [reference, image].map(opponent_colours);
    let [a, b] = opponent.each_ref().map(|colours| seen(colours, size));
    let [features_a, features_b] = opponent.each_ref().map(|colours| features(colours, size));
    let largest =
        hyab(hunt(lab([0.0, 1.0, 0.0])), hunt(lab([0.0, 0.0, 1.0]))).powf(COLOUR_EXPONENT);
    Ok((0..a.len())
        .map(|pixel| {
            let colour = spread(hyab(a[pixel], b[pixel]).powf(COLOUR_EXPONENT), largest);
            let (fa, fb) = (features_a[pixel], features_b[pixel]);
            let feature = (fa.0 - fb.0).abs().max((fa.1 - fb.1).abs());
            let feature = (feature * std::f64::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
            colour.powf(1.0 - feature)
        })
        .collect())
}

/// `YCxCz` of every pixel, each channel by itself.
fn opponent_colours(image: Image<'_>) -> [Vec<f64>; 3] {
    let linear: Vec<f64> = (0..=255_u8).map(linear_from_srgb).collect();
    let mut channels = [const { Vec::new() }; 3];
    for [r, g, b, _] in image.pixels() {
        let rgb = [r, g, b].map(|byte| linear[usize::from(byte)]);
        let [x, y, z] = over_white(transformed(&RGB_TO_XYZ, rgb));
        for (channel, value) in
            channels
                .iter_mut()
                .zip([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])
        {
            channel.push(value);
        }
    }
    channels
}

/// What the eye makes of it: blurred as far as it does not see detail, in Lab with Hunt's adjustment.
fn seen(opponent: &[Vec<f64>; 3], size: (usize, usize)) -> Vec<Colour> {
    let mut channels = [const { Vec::new() }; 3];
    for ((out, channel), gaussians) in channels.iter_mut().zip(opponent).zip(SENSITIVITY) {
        let kernels = gaussians.map(|(_, width)| sensitivity_kernel(width));
        // Of the sum over all places in the plane, each Gaussian's share.
        let shares: Vec<f64> = gaussians
            .iter()
            .zip(&kernels)
            .map(|(&(factor, width), kernel)| factor * (PI / width).sqrt() * kernel.sum().powi(2))
            .collect();
        let total: f64 = shares.iter().sum();
        *out = vec![0.0; channel.len()];
        for (kernel, share) in kernels.iter().zip(shares).filter(|(_, share)| *share > 0.0) {
            let smooth = kernel.normalized();
            let part = filtered(channel, size, &smooth, &smooth);
            for (sum, value) in out.iter_mut().zip(part) {
                *sum += share / total * value;
            }
        }
    }
    let [luma, red_green, blue_yellow] = channels;
    (0..luma.len())
        .map(|pixel| {
            let y = (luma[pixel] + 16.0) / 116.0;
            let (x, z) = (y + red_green[pixel] / 500.0, y - blue_yellow[pixel] / 200.0);
            let xyz = [x * WHITE[0], y * WHITE[1], z * WHITE[2]];
            let rgb = transformed(&XYZ_TO_RGB, xyz).map(|value| value.clamp(0.0, 1.0));
            hunt(lab(rgb))
        })
        .collect()
}

fn sensitivity_kernel(width: f64) -> Kernel {
    Kernel::new(REACH, |x| {
        let degrees = x / PIXELS_PER_DEGREE;
        (-PI * PI * degrees * degrees / width).exp()
    })
}

/// Strength of edges and of points at every pixel.
fn features(opponent: &[Vec<f64>; 3], size: (usize, usize)) -> Vec<(f64, f64)> {
    let luma: Vec<f64> = opponent[0].iter().map(|y| (y + 16.0) / 116.0).collect();
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "9 for the width above"
    )]
    let radius = (3.0 * deviation).ceil() as usize;
    let gaussian = |x: f64| (-0.5 * (x / deviation).powi(2)).exp();
    let smooth = Kernel::new(radius, gaussian).normalized();
    let edge = Kernel::new(radius, |x| -x * gaussian(x)).balanced();
    let point = Kernel::new(radius, |x| ((x / deviation).powi(2) - 1.0) * gaussian(x)).balanced();
    let magnitude = |kernel: &Kernel| -> Vec<f64> {
        let along_x = filtered(&luma, size, kernel, &smooth);
        let along_y = filtered(&luma, size, &smooth, kernel);
        along_x
            .iter()
            .zip(along_y)
            .map(|(x, y)| x.hypot(y))
            .collect()
    };
    magnitude(&edge)
        .into_iter()
        .zip(magnitude(&point))
        .collect()
}

fn transformed(matrix: &[[f64; 3]; 3], [a, b, c]: Colour) -> Colour {
    matrix.map(|row| row[0] * a + row[1] * b + row[2] * c)
}

fn over_white(xyz: Colour) -> Colour {
    std::array::from_fn(|k| xyz[k] / WHITE[k])
}

/// CIE Lab of a linear colour.
fn lab(rgb: Colour) -> Colour {
    const DELTA: f64 = 6.0 / 29.0;
    let [x, y, z] = over_white(transformed(&RGB_TO_XYZ, rgb)).map(|t| {
        if t > DELTA * DELTA * DELTA {
            t.cbrt()
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Colours look less colourful in the dark.
fn hunt([l, a, b]: Colour) -> Colour {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// Distance of two colours, for large differences too.
fn hyab(a: Colour, b: Colour) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// A colour difference, 0 to `largest`, on the scale from 0 to 1.
fn spread(difference: f64, largest: f64) -> f64 {
    let limit = SPREAD_FROM * largest;
    if difference < limit {
        SPREAD_TO / limit * difference
    } else {
        SPREAD_TO + (difference - limit) / (largest - limit) * (1.0 - SPREAD_TO)
    }
}

#[cfg(test)]
mod tests;
