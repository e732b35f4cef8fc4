//! Filters of two passes: along rows, then along columns. The image's border goes on beyond it.

/// Weights at whole distances from −radius to radius.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kernel {
    weights: Vec<f64>,
}

impl Kernel {
    /// `weight` of every distance within `radius`.
    pub(super) fn new(radius: usize, weight: impl Fn(f64) -> f64) -> Self {
        let weights = (0..=2 * radius)
            .map(|place| weight(place as f64 - radius as f64))
            .collect();
        Self { weights }
    }

    /// Sum of the weights.
    pub(super) fn sum(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// The same with weights of sum 1.
    pub(super) fn normalized(&self) -> Self {
        let sum = self.sum();
        self.mapped(|weight| weight / sum)
    }

    /// The same with positive weights of sum 1 and negative ones of sum −1.
    pub(super) fn balanced(&self) -> Self {
        let sum_of = |sign: f64| -> f64 {
            let signed = self.weights.iter().map(|weight| sign * weight);
            signed.filter(|weight| *weight > 0.0).sum()
        };
        let (positive, negative) = (sum_of(1.0), sum_of(-1.0));
        self.mapped(|weight| weight / if weight > 0.0 { positive } else { negative })
    }

    fn mapped(&self, change: impl Fn(f64) -> f64) -> Self {
        Self {
            weights: self.weights.iter().map(|&weight| change(weight)).collect(),
        }
    }

    fn radius(&self) -> usize {
        self.weights.len() / 2
    }
}

/// `values`, row by row, weighed by `along_x` in rows and by `along_y` in columns.
pub(super) fn filtered(
    values: &[f64],
    (width, height): (usize, usize),
    along_x: &Kernel,
    along_y: &Kernel,
) -> Vec<f64> {
    let mut rows = vec![0.0; values.len()];
    let radius = along_x.radius();
    let mut padded = Vec::with_capacity(width + 2 * radius);
    for (row, out) in values
        .chunks_exact(width.max(1))
        .zip(rows.chunks_exact_mut(width.max(1)))
    {
        padded.clear();
        padded.extend(std::iter::repeat_n(row[0], radius));
        padded.extend_from_slice(row);
        padded.extend(std::iter::repeat_n(row[width - 1], radius));
        for (value, window) in out.iter_mut().zip(padded.windows(2 * radius + 1)) {
            *value = window
                .iter()
                .zip(&along_x.weights)
                .map(|(a, b)| a * b)
                .sum();
        }
    }
    let mut out = vec![0.0; values.len()];
    let radius = along_y.radius();
    for y in 0..height {
        let line = &mut out[y * width..(y + 1) * width];
        for (place, weight) in along_y.weights.iter().enumerate() {
            let from = (y + place).saturating_sub(radius).min(height - 1);
            let source = &rows[from * width..(from + 1) * width];
            for (sum, value) in line.iter_mut().zip(source) {
                *sum += weight * value;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_stays_and_a_slope_has_its_derivative() {
        let size = (9, 7);
        let smooth = Kernel::new(2, |x| (-x * x).exp()).normalized();
        let constant = filtered(&[3.0; 63], size, &smooth, &smooth);
        assert!(constant.iter().all(|value| (value - 3.0).abs() < 1e-12));
        let slope: Vec<f64> = (0..63).map(|pixel| f64::from(pixel % 9)).collect();
        // Weights −1 and 1 at distances −1 and 1.
        let edge = Kernel::new(1, |x| x).balanced();
        let derivative = filtered(&slope, size, &edge, &smooth);
        assert!((derivative[3 * 9 + 4] - 2.0).abs() < 1e-12);
        assert!((derivative[3 * 9] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn images_narrower_than_the_filter_are_filtered() {
        let wide = Kernel::new(5, |_| 1.0).normalized();
        let out = filtered(&[2.0, 4.0], (1, 2), &wide, &wide);
        assert!((out[0] + out[1] - 6.0).abs() < 1e-12);
        assert!(filtered(&[], (0, 0), &wide, &wide).is_empty());
    }
}
