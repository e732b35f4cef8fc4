//! Image metrics and masks, on plain pixel arrays.
//!
//! Pixels are RGBA, 8 bits a channel, row by row from the top; a mask has one `bool` a pixel.

mod filter;
mod flip;
mod light;
mod mask;
mod noise;
mod outline;
mod ssim;

pub use flip::{PIXELS_PER_DEGREE, REACH, flip, flip_map};
pub use light::shrunk;
pub(crate) use mask::same_size;
pub use mask::{Mask, silhouette};
pub use noise::{mean_square, psnr_db};
pub use outline::{OutlineDistance, outline_distance};
pub use ssim::ssim;

use std::ops::Range;

/// An image or mask that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The bytes are not `width * height * 4`.
    #[error("{width} x {height} pixels need {expected} bytes, but there are {found}")]
    Length {
        /// Pixels a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Bytes needed.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// Two images, or an image and a mask, differ in size.
    #[error(
        "{first_width} x {first_height} pixels cannot be compared with {second_width} x {second_height}"
    )]
    Size {
        /// Pixels a row of the first.
        first_width: usize,
        /// Rows of the first.
        first_height: usize,
        /// Pixels a row of the second.
        second_width: usize,
        /// Rows of the second.
        second_height: usize,
    },
    /// An image cannot be divided into squares.
    #[error("{width} x {height} pixels are no squares of {factor} x {factor}")]
    Factor {
        /// Pixels a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels along a side of a square.
        factor: usize,
    },
}

/// An image, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    width: usize,
    height: usize,
    rgba: &'a [u8],
}

impl<'a> Image<'a> {
    /// Wraps `rgba`, four bytes a pixel.
    ///
    /// # Errors
    /// When the length does not fit the size.
    pub fn new(width: usize, height: usize, rgba: &'a [u8]) -> Result<Self, ImageError> {
        let expected = width.saturating_mul(height).saturating_mul(4);
        if rgba.len() != expected {
            return Err(ImageError::Length {
                width,
                height,
                expected,
                found: rgba.len(),
            });
        }
        Ok(Self {
            width,
            height,
            rgba,
        })
    }

    /// Pixels a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The bytes of the pixels in a rectangle of columns and rows.
    ///
    /// # Panics
    /// If the rectangle is not within the image.
    pub fn cropped(&self, [columns, rows]: [Range<usize>; 2]) -> Vec<u8> {
        let row = |y: usize| &self.rgba[4 * y * self.width..][4 * columns.start..4 * columns.end];
        rows.flat_map(row).copied().collect()
    }

    /// All pixels.
    pub fn pixels(&self) -> impl Iterator<Item = [u8; 4]> + 'a {
        self.rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]])
    }

    /// Luma by Rec. 709 weights on the stored (gamma-coded) values, 0..=255.
    pub fn luma(&self) -> Vec<f64> {
        let weigh = |[r, g, b, _]: [u8; 4]| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        self.pixels().map(weigh).collect()
    }
}
