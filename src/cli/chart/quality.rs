//! How alike two pictures are.

use super::data::Estimate;
use anyhow::Context;
use marquetry_evaluation::image::{
    self, Image, ImageError, Mask, OutlineDistance, REACH, outline_distance, silhouette,
};
use marquetry_native::Picture;

/// A picture and where the object is in it.
#[derive(Debug, Clone)]
pub(super) struct Shot {
    pub(super) picture: Picture,
    pub(super) mask: Mask,
}

impl Shot {
    /// The object is where the picture is not exactly `background`.
    pub(super) fn new(picture: Picture, background: [u8; 3]) -> anyhow::Result<Self> {
        let mask = silhouette(image_of(&picture)?, background);
        Ok(Self { picture, mask })
    }

    /// What a picture that is `factor` times as wide and high shows: every pixel the mean of several.
    pub(super) fn shrunk(
        large: &Picture,
        factor: u32,
        background: [u8; 3],
    ) -> anyhow::Result<Self> {
        let picture = Picture {
            width: large.width / factor,
            height: large.height / factor,
            rgba: image::shrunk(image_of(large)?, usize::try_from(factor)?)?,
        };
        Self::new(picture, background)
    }

    /// The same with the pixels of a picture that is `factor` times as wide and high.
    pub(super) fn refined(&self, large: &Picture, factor: usize) -> anyhow::Result<Self> {
        let rgba = image::shrunk(image_of(large)?, factor)?;
        Ok(Self {
            picture: Picture {
                rgba,
                ..self.picture
            },
            mask: self.mask.clone(),
        })
    }

    /// The picture's pixels, borrowed.
    pub(super) fn image(&self) -> anyhow::Result<Image<'_>> {
        image_of(&self.picture)
    }
}

fn image_of(picture: &Picture) -> anyhow::Result<Image<'_>> {
    let [width, height] = [picture.width, picture.height].map(usize::try_from);
    Ok(Image::new(width?, height?, &picture.rgba)?)
}

/// A picture against its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Likeness {
    pub(super) ssim: f64,
    pub(super) flip: f64,
    pub(super) mean_square: f64,
    pub(super) outline: Option<OutlineDistance>,
}

/// Compares the object's pixels, those of either picture. `None` where neither shows it.
///
/// # Errors
/// When sizes differ.
pub(super) fn compare(reference: &Shot, shot: &Shot) -> anyhow::Result<Option<Likeness>> {
    let mask = reference.mask.union(&shot.mask)?;
    // Nothing farther away has a say in a pixel of the object.
    let Some(part) = mask.bounds(REACH + 1) else {
        return Ok(None);
    };
    let size = part.each_ref().map(ExactSizeIterator::len);
    let bytes = [
        reference.image()?.cropped(part.clone()),
        shot.image()?.cropped(part.clone()),
    ];
    let [a, b] = bytes
        .each_ref()
        .map(|bytes| Image::new(size[0], size[1], bytes));
    let inside = mask.cropped(part);
    let measures = || -> Result<_, ImageError> {
        let (a, b) = (a?, b?);
        Ok((
            image::ssim(a, b, &inside)?,
            image::flip(a, b, &inside)?,
            image::mean_square(a, b, &inside)?,
        ))
    };
    let (ssim, flip, mean_square) = measures()?;
    Ok(Some(Likeness {
        ssim: ssim.context("an empty mask")?,
        flip: flip.context("an empty mask")?,
        mean_square: mean_square.context("an empty mask")?,
        outline: outline_distance(&reference.mask, &shot.mask)?,
    }))
}

/// Means over views.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub(super) ssim: Estimate,
    pub(super) flip: Estimate,
    pub(super) psnr_db: Option<f64>,
    pub(super) outline: Option<OutlineDistance>,
    pub(super) views: usize,
}

/// Sums up what views say; `None` without any.
pub(super) fn summary(likenesses: &[Likeness]) -> Option<Summary> {
    let all = |of: fn(&Likeness) -> f64| likenesses.iter().map(of).collect::<Vec<f64>>();
    let count = likenesses.len() as f64;
    let mean_square = all(|l| l.mean_square).iter().sum::<f64>() / count;
    let outlines: Vec<_> = likenesses.iter().filter_map(|l| l.outline).collect();
    let outline = (!outlines.is_empty()).then(|| OutlineDistance {
        max_px: outlines.iter().map(|o| o.max_px).fold(0.0, f64::max),
        mean_px: outlines.iter().map(|o| o.mean_px).sum::<f64>() / outlines.len() as f64,
    });
    Some(Summary {
        ssim: Estimate::of(&all(|l| l.ssim))?,
        flip: Estimate::of(&all(|l| l.flip))?,
        psnr_db: image::psnr_db(mean_square),
        outline,
        views: likenesses.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disk(radius: f64, shade: impl Fn(f64, f64) -> u8) -> Shot {
        let mut rgba = Vec::new();
        for y in 0..90 {
            for x in 0..120 {
                let (u, v) = (f64::from(x) - 60.0, f64::from(y) - 45.0);
                let value = if u.hypot(v) < radius { shade(u, v) } else { 1 };
                rgba.extend([value, value, value, 255]);
            }
        }
        let picture = Picture {
            width: 120,
            height: 90,
            rgba,
        };
        Shot::new(picture, [1; 3]).unwrap()
    }

    fn bumps(u: f64, v: f64) -> u8 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "40 to 200"
        )]
        let value = (120.0 + 40.0 * ((0.7 * u).sin() + (0.5 * v).cos())) as u8;
        value
    }

    /// What is cut off around the object changes nothing.
    #[test]
    fn comparing_a_part_is_comparing_the_whole() {
        let (a, b) = (disk(20.0, bumps), disk(21.0, |u, v| bumps(u + 1.0, v)));
        let found = compare(&a, &b).unwrap().unwrap();
        let mask = a.mask.union(&b.mask).unwrap();
        let (a_image, b_image) = (a.image().unwrap(), b.image().unwrap());
        let ssim = image::ssim(a_image, b_image, &mask).unwrap().unwrap();
        let flip = image::flip(a_image, b_image, &mask).unwrap().unwrap();
        assert!((found.ssim - ssim).abs() < 1e-9 && (found.flip - flip).abs() < 1e-9);
        assert!(found.ssim < 0.99 && found.flip > 0.01);
        assert!((found.outline.unwrap().mean_px - 1.0).abs() < 0.3);
    }

    #[test]
    fn equal_pictures_are_alike_and_empty_ones_say_nothing() {
        let a = disk(20.0, bumps);
        let likeness = compare(&a, &a).unwrap().unwrap();
        assert!((likeness.ssim - 1.0).abs() < 1e-12 && likeness.flip.abs() < 1e-12);
        let summary = summary(&[likeness; 4]).unwrap();
        assert_eq!((summary.psnr_db, summary.views), (None, 4));
        let empty = disk(0.0, bumps);
        assert_eq!(compare(&empty, &empty).unwrap(), None);
        assert_eq!(super::summary(&[]), None);
        assert_eq!(compare(&a, &empty).unwrap().unwrap().outline, None);
    }
}
