//! Sets of pixels: silhouettes, their rims, their differences.

use super::{Image, ImageError};
use std::ops::Range;

/// A set of pixels of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    inside: Vec<bool>,
}

impl Mask {
    /// A mask of no pixel.
    pub fn empty(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            inside: vec![false; width * height],
        }
    }

    /// Pixels a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// One value a pixel, row by row from the top.
    pub fn as_slice(&self) -> &[bool] {
        &self.inside
    }

    /// Whether pixel (x, y) is in the set; `false` outside the image.
    pub fn contains(&self, x: usize, y: usize) -> bool {
        x < self.width && y < self.height && self.inside[y * self.width + x]
    }

    /// Puts pixel (x, y) into the set; nothing happens outside the image.
    pub fn insert(&mut self, x: usize, y: usize) {
        if x < self.width && y < self.height {
            self.inside[y * self.width + x] = true;
        }
    }

    /// Pixels in the set.
    pub fn count(&self) -> usize {
        self.inside.iter().filter(|&&inside| inside).count()
    }

    /// Whether no pixel is in the set.
    pub fn is_empty(&self) -> bool {
        !self.inside.contains(&true)
    }

    /// Pixels whose eight neighbours are in the set too: the set without its rim of one pixel. The image's
    /// border is no rim: an object that is cut off there goes on.
    #[must_use]
    pub fn eroded(&self) -> Self {
        self.map_neighbourhood(|neighbours| neighbours.iter().all(|&inside| inside))
    }

    /// Pixels that are in the set or beside one that is.
    #[must_use]
    pub fn dilated(&self) -> Self {
        self.map_neighbourhood(|neighbours| neighbours.contains(&true))
    }

    /// Pixels in both sets.
    ///
    /// # Errors
    /// When the sizes differ.
    pub fn intersection(&self, other: &Self) -> Result<Self, ImageError> {
        same_size((self.width, self.height), (other.width, other.height))?;
        let inside = self
            .inside
            .iter()
            .zip(&other.inside)
            .map(|(&a, &b)| a && b)
            .collect();
        Ok(Self { inside, ..*self })
    }

    /// Pixels in one of the sets.
    ///
    /// # Errors
    /// When the sizes differ.
    pub fn union(&self, other: &Self) -> Result<Self, ImageError> {
        same_size((self.width, self.height), (other.width, other.height))?;
        let pixels = self.inside.iter().zip(&other.inside);
        let inside = pixels.map(|(&a, &b)| a || b).collect();
        Ok(Self { inside, ..*self })
    }

    /// The columns and rows of the smallest rectangle around the set, `margin` pixels wider on every side as far as the
    /// image goes; `None` for an empty set.
    pub fn bounds(&self, margin: usize) -> Option<[Range<usize>; 2]> {
        let places = || (0..self.inside.len()).filter(|&place| self.inside[place]);
        let grown = |low: usize, high: usize, size: usize| {
            low.saturating_sub(margin)..(high + 1 + margin).min(size)
        };
        let (top, bottom) = (
            places().next()? / self.width,
            places().next_back()? / self.width,
        );
        let (left, right) = places().fold((usize::MAX, 0), |(left, right), place| {
            let x = place % self.width;
            (left.min(x), right.max(x))
        });
        Some([
            grown(left, right, self.width),
            grown(top, bottom, self.height),
        ])
    }

    /// The part of the set in a rectangle of the image, as a set of its own.
    #[must_use]
    pub fn cropped(&self, [columns, rows]: [Range<usize>; 2]) -> Self {
        let inside = rows
            .clone()
            .flat_map(|y| &self.inside[y * self.width..][columns.clone()]);
        Self {
            width: columns.len(),
            height: rows.len(),
            inside: inside.copied().collect(),
        }
    }

    fn map_neighbourhood(&self, keep: impl Fn(&[bool]) -> bool) -> Self {
        let mut inside = Vec::with_capacity(self.inside.len());
        let mut neighbours = Vec::with_capacity(9);
        for y in 0..self.height {
            for x in 0..self.width {
                neighbours.clear();
                for row in y.saturating_sub(1)..(y + 2).min(self.height) {
                    let start = row * self.width;
                    let columns = start + x.saturating_sub(1)..start + (x + 2).min(self.width);
                    neighbours.extend_from_slice(&self.inside[columns]);
                }
                inside.push(keep(&neighbours));
            }
        }
        Self { inside, ..*self }
    }
}

/// Pixels that are not exactly the colour of the background; alpha is ignored.
pub fn silhouette(image: Image<'_>, background: [u8; 3]) -> Mask {
    let inside = image
        .pixels()
        .map(|[r, g, b, _]| [r, g, b] != background)
        .collect();
    Mask {
        width: image.width(),
        height: image.height(),
        inside,
    }
}

pub(crate) fn same_size(first: (usize, usize), second: (usize, usize)) -> Result<(), ImageError> {
    if first == second {
        return Ok(());
    }
    Err(ImageError::Size {
        first_width: first.0,
        first_height: first.1,
        second_width: second.0,
        second_height: second.1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: usize, from: usize, to: usize) -> Mask {
        let mut mask = Mask::empty(side, side);
        for y in from..to {
            for x in from..to {
                mask.insert(x, y);
            }
        }
        mask
    }

    #[test]
    fn erosion_takes_one_pixel_and_dilation_gives_it_back() {
        let mask = square(10, 2, 7);
        assert_eq!(mask.eroded(), square(10, 3, 6));
        assert_eq!(mask.eroded().dilated(), mask);
        assert!(square(10, 2, 4).eroded().is_empty());
    }

    #[test]
    fn border_of_the_image_is_no_rim() {
        assert_eq!(square(5, 0, 5).eroded().count(), 25);
    }

    #[test]
    fn silhouette_is_what_differs_from_the_background() {
        let rgba = [255, 0, 255, 255, 254, 0, 255, 255];
        let mask = silhouette(Image::new(2, 1, &rgba).unwrap(), [255, 0, 255]);
        assert_eq!(mask.as_slice(), [false, true]);
    }

    #[test]
    fn bounds_are_the_rectangle_around_the_set() {
        let mask = square(10, 2, 7);
        assert_eq!(mask.bounds(0), Some([2..7, 2..7]));
        assert_eq!(mask.bounds(4), Some([0..10, 0..10]));
        let part = mask.cropped([1..5, 3..9]);
        assert_eq!((part.width(), part.height(), part.count()), (4, 6, 3 * 4));
        assert!(part.contains(1, 0) && !part.contains(0, 0) && !part.contains(1, 4));
        assert_eq!(Mask::empty(3, 3).bounds(1), None);
        assert_eq!(mask.union(&square(10, 0, 3)).unwrap().count(), 25 + 9 - 1);
    }

    #[test]
    fn masks_of_different_size_do_not_combine() {
        let refused = Mask::empty(2, 3).intersection(&Mask::empty(3, 2));
        assert!(matches!(refused, Err(ImageError::Size { .. })));
    }
}
