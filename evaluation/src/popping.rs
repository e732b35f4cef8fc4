//! Popping: how much a sequence of pictures jumps where its reference does not.
//!
//! *Temporal*: ‖(Iₜ − Iₜ₋₁) − (Rₜ − Rₜ₋₁)‖, the change from one picture to the next that the reference, drawn at full
//! detail from the same eyes, does not have. A picture that is wrong in the same way all the time does not pop.
//! *Fidelity*: ‖Iₜ − Rₜ‖, which has been published as a measure of popping; it is large for whatever is coarse, moving or not,
//! so it is given beside the other, never in its place.
//!
//! Norms are root mean squares of red, green and blue, stored values over 255, over the object's mask: 0..=1 for fidelity,
//! 0..=2 for the temporal one.
//! Limit: a slow drift that no eye notices and a jump add up alike in the mean; the maximum and the percentile tell them
//! apart.

use crate::image::{Image, ImageError, Mask};

/// One number a picture, summed up.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// 99th percentile: the least value that 99% do not exceed.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of `values`; zero for none.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let rank = (sorted.len() * 99).div_ceil(100).saturating_sub(1);
        Self {
            mean: sorted.iter().sum::<f64>() / sorted.len().max(1) as f64,
            p99: sorted.get(rank).copied().unwrap_or(0.0),
            max: sorted.last().copied().unwrap_or(0.0),
        }
    }
}

/// A sequence against its reference, picture by picture. Keeps the last picture of both.
#[derive(Debug, Clone, Default)]
pub struct Popping {
    last: Option<Last>,
    temporal: Vec<f64>,
    fidelity: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Last {
    /// Image minus reference.
    difference: Vec<[i16; 3]>,
    mask: Mask,
}

impl Popping {
    /// Adds the next picture; `mask` holds the pixels of the object, in either of the two.
    ///
    /// # Errors
    /// When sizes differ, from picture to picture too.
    pub fn add(
        &mut self,
        image: Image<'_>,
        reference: Image<'_>,
        mask: &Mask,
    ) -> Result<(), ImageError> {
        let size = (image.width(), image.height());
        super::image::same_size(size, (reference.width(), reference.height()))?;
        super::image::same_size(size, (mask.width(), mask.height()))?;
        let difference: Vec<[i16; 3]> = image
            .pixels()
            .zip(reference.pixels())
            .map(|(a, b)| [0, 1, 2].map(|k: usize| i16::from(a[k]) - i16::from(b[k])))
            .collect();
        self.fidelity.push(norm(&difference, mask));
        if let Some(last) = &self.last {
            let both = last.mask.union(mask)?;
            // (Iₜ − Iₜ₋₁) − (Rₜ − Rₜ₋₁) is (Iₜ − Rₜ) − (Iₜ₋₁ − Rₜ₋₁).
            let change: Vec<[i16; 3]> = difference
                .iter()
                .zip(&last.difference)
                .map(|(a, b)| [0, 1, 2].map(|k: usize| a[k] - b[k]))
                .collect();
            self.temporal.push(norm(&change, &both));
        }
        self.last = Some(Last {
            difference,
            mask: mask.clone(),
        });
        Ok(())
    }

    /// From picture to picture, one less than there are.
    pub fn temporal(&self) -> &[f64] {
        &self.temporal
    }

    /// Of every picture.
    pub fn fidelity(&self) -> &[f64] {
        &self.fidelity
    }
}

/// Root mean square over the mask, over 255; 0 for an empty mask.
fn norm(values: &[[i16; 3]], mask: &Mask) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u64);
    for (value, _) in values
        .iter()
        .zip(mask.as_slice())
        .filter(|&(_, &inside)| inside)
    {
        sum += value.iter().map(|&c| f64::from(c).powi(2)).sum::<f64>();
        count += 3;
    }
    if count == 0 {
        return 0.0;
    }
    (sum / count as f64).sqrt() / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::silhouette;

    fn grey(values: [u8; 4]) -> Vec<u8> {
        values.iter().flat_map(|&v| [v, v, v, 255]).collect()
    }

    fn sequence(frames: &[[u8; 4]], references: &[[u8; 4]]) -> Popping {
        let mut popping = Popping::default();
        for (frame, reference) in frames.iter().zip(references) {
            let (frame, reference) = (grey(*frame), grey(*reference));
            let [frame, reference] =
                [&frame, &reference].map(|bytes| Image::new(2, 2, bytes).unwrap());
            popping
                .add(frame, reference, &silhouette(frame, [1, 2, 3]))
                .unwrap();
        }
        popping
    }

    #[test]
    fn a_steady_fault_is_infidelity_and_no_popping() {
        let popping = sequence(&[[60; 4], [70; 4], [80; 4]], &[[50; 4], [60; 4], [70; 4]]);
        assert_eq!(popping.temporal(), [0.0, 0.0]);
        assert!(
            popping
                .fidelity()
                .iter()
                .all(|f| (f - 10.0 / 255.0).abs() < 1e-12)
        );
    }

    #[test]
    fn a_jump_pops_once() {
        let popping = sequence(&[[50; 4], [50; 4], [101; 4], [101; 4]], &[[50; 4]; 4]);
        let temporal = popping.temporal();
        assert_eq!((temporal[0], temporal[2]), (0.0, 0.0));
        assert!((temporal[1] - 0.2).abs() < 1e-12);
        let spread = Spread::of(temporal);
        assert!((spread.max - 0.2).abs() < 1e-12 && (spread.mean - 0.2 / 3.0).abs() < 1e-12);
    }

    /// The definition, written out.
    #[test]
    fn temporal_is_what_its_definition_says() {
        let frames = [[10, 20, 30, 40], [12, 90, 31, 7], [200, 3, 99, 41]];
        let references = [[11, 22, 33, 44], [15, 60, 35, 9], [180, 13, 77, 45]];
        let popping = sequence(&frames, &references);
        for t in 1..frames.len() {
            let square: f64 = (0..4)
                .map(|p| {
                    let change = f64::from(frames[t][p]) - f64::from(frames[t - 1][p]);
                    let due = f64::from(references[t][p]) - f64::from(references[t - 1][p]);
                    (change - due).powi(2)
                })
                .sum();
            let expected = (square / 4.0).sqrt() / 255.0;
            assert!((popping.temporal()[t - 1] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn percentile_of_few_values_is_the_largest() {
        let spread = Spread::of(&[3.0, 1.0, 2.0]);
        assert_eq!((spread.p99, spread.max, spread.mean), (3.0, 3.0, 2.0));
        let many: Vec<f64> = (1..=1000).map(f64::from).collect();
        assert!((Spread::of(&many).p99 - 990.0).abs() < 1e-12);
        assert!(Spread::of(&[]).max.abs() < 1e-12);
    }
}
