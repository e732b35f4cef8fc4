//! How far two silhouettes are apart, in pixels.
//!
//! From every pixel on the rim of one mask the distance to the nearest rim pixel of the other is taken, and the other way
//! round. Felzenszwalb & Huttenlocher, "Distance Transforms of Sampled Functions", 2012: exact Euclidean distances of all
//! pixels in two passes over rows and columns.
//! Limit: centres of pixels, so nothing below a pixel is seen, and an object cut off by the image has no rim there.

use super::{ImageError, Mask, mask::same_size};

/// Distances between two outlines, both ways, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OutlineDistance {
    /// Largest.
    pub max_px: f64,
    /// Mean over the rims' pixels.
    pub mean_px: f64,
}

/// How far the outlines of `first` and `second` are apart; `None` where one of them has none.
///
/// # Errors
/// When the sizes differ.
pub fn outline_distance(
    first: &Mask,
    second: &Mask,
) -> Result<Option<OutlineDistance>, ImageError> {
    let size = (first.width(), first.height());
    same_size(size, (second.width(), second.height()))?;
    let rims = [first, second].map(rim);
    if rims.iter().any(|rim| !rim.contains(&true)) {
        return Ok(None);
    }
    let [to_first, to_second] = rims.each_ref().map(|rim| squared_distances(rim, size));
    let (mut max2, mut sum, mut count) = (0.0_f64, 0.0, 0_u64);
    for (rim, distances) in [(&rims[0], to_second), (&rims[1], to_first)] {
        for (_, distance2) in rim.iter().zip(distances).filter(|&(&on_rim, _)| on_rim) {
            max2 = max2.max(distance2);
            sum += distance2.sqrt();
            count += 1;
        }
    }
    Ok(Some(OutlineDistance {
        max_px: max2.sqrt(),
        mean_px: sum / count as f64,
    }))
}

/// Pixels of `mask` that have a neighbour outside it.
fn rim(mask: &Mask) -> Vec<bool> {
    let inner = mask.eroded();
    let pixels = mask.as_slice().iter().zip(inner.as_slice());
    pixels.map(|(&inside, &inner)| inside && !inner).collect()
}

/// Squared distance from every pixel to the nearest of `set`, which is not empty.
fn squared_distances(set: &[bool], (width, height): (usize, usize)) -> Vec<f64> {
    let start = set
        .iter()
        .map(|&inside| if inside { 0.0 } else { f64::INFINITY });
    let mut values: Vec<f64> = start.collect();
    let mut column = vec![0.0; height];
    for x in 0..width {
        for (y, value) in column.iter_mut().enumerate() {
            *value = values[y * width + x];
        }
        for (y, value) in lower_envelope(&column).into_iter().enumerate() {
            values[y * width + x] = value;
        }
    }
    for row in values.chunks_exact_mut(width.max(1)) {
        let line = lower_envelope(row);
        row.copy_from_slice(&line);
    }
    values
}

/// At every place q the least of `values[p] + (q − p)²`: the lower envelope of parabolas.
fn lower_envelope(values: &[f64]) -> Vec<f64> {
    // Places of parabolas that are lowest somewhere, and from where on each is.
    let mut lowest: Vec<(usize, f64)> = Vec::new();
    for (place, &value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let square = (place * place) as f64;
        let from = loop {
            let Some(&(last, last_from)) = lowest.last() else {
                break f64::NEG_INFINITY;
            };
            let meeting = (value + square - values[last] - (last * last) as f64)
                / (2.0 * (place - last) as f64);
            if meeting > last_from {
                break meeting;
            }
            lowest.pop();
        };
        lowest.push((place, from));
    }
    if lowest.is_empty() {
        return vec![f64::INFINITY; values.len()];
    }
    let mut current = 0;
    (0..values.len())
        .map(|q| {
            while lowest
                .get(current + 1)
                .is_some_and(|next| next.1 < q as f64)
            {
                current += 1;
            }
            let p = lowest[current].0;
            values[p] + (q.abs_diff(p) as f64).powi(2)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disk(size: usize, x: f64, y: f64, radius: f64) -> Mask {
        let mut mask = Mask::empty(size, size);
        for row in 0..size {
            for column in 0..size {
                if (column as f64 - x).hypot(row as f64 - y) <= radius {
                    mask.insert(column, row);
                }
            }
        }
        mask
    }

    #[test]
    fn shifted_square_is_as_far_away_as_it_was_shifted() {
        let square = |from: usize| {
            let mut mask = Mask::empty(30, 30);
            for y in 5..15 {
                for x in from..from + 10 {
                    mask.insert(x, y);
                }
            }
            mask
        };
        let found = outline_distance(&square(5), &square(8)).unwrap().unwrap();
        assert!((found.max_px - 3.0).abs() < 1e-12);
        assert!(found.mean_px > 0.5 && found.mean_px < 3.0);
        let none = outline_distance(&square(5), &square(5)).unwrap().unwrap();
        assert_eq!((none.max_px, none.mean_px), (0.0, 0.0));
    }

    #[test]
    fn larger_disk_is_about_its_radius_farther_out() {
        let (small, large) = (disk(80, 40.0, 40.0, 20.0), disk(80, 40.0, 40.0, 26.0));
        let found = outline_distance(&small, &large).unwrap().unwrap();
        assert!((found.mean_px - 6.0).abs() < 0.5, "{found:?}");
        assert!(found.max_px < 7.0);
    }

    #[test]
    fn distances_are_those_of_trying_all_pixels() {
        let mask = {
            let mut mask = disk(23, 6.0, 8.0, 4.0);
            mask.insert(20, 2);
            mask.insert(0, 22);
            mask
        };
        let set = mask.as_slice();
        let found = squared_distances(set, (23, 23));
        for (pixel, found) in found.iter().enumerate() {
            let least = (0..set.len())
                .filter(|&other| set[other])
                .map(|other| {
                    let dx = (pixel % 23).abs_diff(other % 23);
                    let dy = (pixel / 23).abs_diff(other / 23);
                    (dx * dx + dy * dy) as f64
                })
                .fold(f64::INFINITY, f64::min);
            assert!((found - least).abs() < 1e-9, "pixel {pixel}");
        }
    }

    #[test]
    fn masks_without_an_outline_have_no_distance() {
        let empty = Mask::empty(9, 9);
        assert_eq!(outline_distance(&empty, &disk(9, 4.0, 4.0, 2.0)), Ok(None));
        let wrong = outline_distance(&empty, &Mask::empty(9, 8));
        assert!(matches!(wrong, Err(ImageError::Size { .. })));
    }
}
