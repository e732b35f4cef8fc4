//! Decoded images: made when asked for, the longest unused forgotten above a budget.
//!
//! Which images are held never changes what is sampled. Limit: two threads that ask for an image at once may both decode it.

use super::appearance::{ImageFile, Wrap};
use super::light::Light;
use glam::{Vec2, Vec3};
use image::{ImageReader, Limits};
use std::io::Cursor;
use std::sync::{Arc, Mutex, PoisonError};

/// Most texels a side.
const MOST_TEXELS: u32 = 1 << 15;
/// Most bytes that decoding an image may take.
const MOST_BYTES: u64 = 4 << 30;

/// An image that cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}: the image cannot be decoded: {cause}; export it again")]
pub struct ImageError {
    /// The image.
    pub name: String,
    /// What the decoder said.
    pub cause: String,
}

/// A decoded image, sRGB.
#[derive(Debug, Clone, Default)]
pub struct Texels {
    /// Texels a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Row by row from the upper left.
    pub rgb: Vec<[u8; 3]>,
}

impl Texels {
    /// Decodes a PNG, JPEG or `WebP` image.
    ///
    /// # Errors
    /// When it is damaged, of another format, or larger than 32 768 texels a side.
    pub fn decode(file: &ImageFile) -> Result<Self, ImageError> {
        let failed = |cause: String| ImageError {
            name: file.name.clone(),
            cause,
        };
        let mut reader = ImageReader::new(Cursor::new(&file.bytes))
            .with_guessed_format()
            .map_err(|error| failed(error.to_string()))?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(MOST_TEXELS);
        limits.max_image_height = Some(MOST_TEXELS);
        limits.max_alloc = Some(MOST_BYTES);
        reader.limits(limits);
        let image = reader
            .decode()
            .map_err(|error| failed(error.to_string()))?
            .into_rgb8();
        let (width, height) = image.dimensions();
        if width == 0 || height == 0 {
            return Err(failed("it has no texels".to_owned()));
        }
        let rgb = image.pixels().map(|pixel| pixel.0).collect();
        Ok(Self { width, height, rgb })
    }

    /// Width and height, from the image's header alone.
    ///
    /// # Errors
    /// When there is none that can be read.
    pub fn dimensions(file: &ImageFile) -> Result<(u32, u32), ImageError> {
        let reader = ImageReader::new(Cursor::new(&file.bytes)).with_guessed_format();
        let size = reader
            .map_err(image::ImageError::from)
            .and_then(ImageReader::into_dimensions);
        size.map_err(|error| ImageError {
            name: file.name.clone(),
            cause: error.to_string(),
        })
    }

    /// Bilinear sample in linear light; `place` counts texels from the upper left corner of the image.
    pub fn sample(&self, light: &Light, place: Vec2, wrap: [Wrap; 2]) -> Vec3 {
        let place = place - 0.5;
        let floor = place.floor();
        let part = place - floor;
        let column = |step| wrapped(floor.x, step, self.width, wrap[0]);
        let row = |step| wrapped(floor.y, step, self.height, wrap[1]);
        let at = |x: usize, y: usize| light.linear(self.rgb[y * self.width as usize + x]);
        let ([x0, x1], [y0, y1]) = ([column(0), column(1)], [row(0), row(1)]);
        let upper = at(x0, y0).lerp(at(x1, y0), part.x);
        let lower = at(x0, y1).lerp(at(x1, y1), part.x);
        upper.lerp(lower, part.y)
    }
}

/// The texel at `floor + step` of a line of `count`; the first where `floor` is no number.
fn wrapped(floor: f32, step: i64, count: u32, wrap: Wrap) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "casts saturate, and NaN becomes 0"
    )]
    let index = (floor as i64).saturating_add(step);
    let count = i64::from(count.max(1));
    let index = match wrap {
        Wrap::Repeat => index.rem_euclid(count),
        Wrap::Clamp => index.clamp(0, count - 1),
        Wrap::Mirror => {
            let place = index.rem_euclid(2 * count);
            place.min(2 * count - 1 - place)
        }
    };
    usize::try_from(index).unwrap_or_default()
}

/// Decodes images on demand.
#[derive(Debug)]
pub struct ImageStore<'a> {
    files: &'a [ImageFile],
    budget_bytes: u64,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    /// Most recently used last.
    images: Vec<(u32, Arc<Texels>)>,
    bytes: u64,
}

impl<'a> ImageStore<'a> {
    /// Holds decoded images of at most about `budget_bytes`, one at least.
    pub fn new(files: &'a [ImageFile], budget_bytes: u64) -> Self {
        Self {
            files,
            budget_bytes,
            held: Mutex::default(),
        }
    }

    /// The image of that number, decoded.
    ///
    /// # Errors
    /// When it is damaged.
    pub fn get(&self, image: u32) -> Result<Arc<Texels>, ImageError> {
        if let Some(texels) = self.held(image) {
            return Ok(texels);
        }
        let file = self.files.get(image as usize).cloned().unwrap_or_default();
        let texels = Arc::new(Texels::decode(&file)?);
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.images.retain(|(number, _)| *number != image);
        held.images.push((image, Arc::clone(&texels)));
        let size = |texels: &Texels| 3 * texels.rgb.len() as u64;
        held.bytes = held.images.iter().map(|(_, t)| size(t)).sum();
        while held.bytes > self.budget_bytes && held.images.len() > 1 {
            let (_, oldest) = held.images.remove(0);
            held.bytes -= size(&oldest);
        }
        Ok(texels)
    }

    fn held(&self, image: u32) -> Option<Arc<Texels>> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let place = held
            .images
            .iter()
            .position(|(number, _)| *number == image)?;
        let found = held.images.remove(place);
        let texels = Arc::clone(&found.1);
        held.images.push(found);
        Some(texels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Texels {
        Texels {
            width: 4,
            height: 1,
            rgb: [10, 80, 160, 240].map(|c| [c; 3]).to_vec(),
        }
    }

    fn byte(texels: &Texels, x: f32, wrap: Wrap) -> u8 {
        let light = Light::new();
        light.srgb(texels.sample(&light, Vec2::new(x, 0.5), [wrap, Wrap::Clamp]))[0]
    }

    #[test]
    fn texels_outside_are_those_that_the_wrap_says() {
        let row = row();
        for (x, repeat, mirror, clamp) in [
            (-1.5, 160, 80, 10),
            (-0.5, 240, 10, 10),
            (0.5, 10, 10, 10),
            (3.5, 240, 240, 240),
            (4.5, 10, 240, 240),
            (5.5, 80, 160, 240),
            (8.5, 10, 10, 240),
        ] {
            assert_eq!(byte(&row, x, Wrap::Repeat), repeat, "{x}");
            assert_eq!(byte(&row, x, Wrap::Mirror), mirror, "{x}");
            assert_eq!(byte(&row, x, Wrap::Clamp), clamp, "{x}");
        }
    }

    #[test]
    fn samples_between_texels_are_blended_in_linear_light() {
        let ends = Texels {
            width: 2,
            height: 1,
            rgb: vec![[0; 3], [255; 3]],
        };
        assert_eq!(byte(&ends, 1.0, Wrap::Clamp), 188);
        assert_eq!(byte(&ends, 0.0, Wrap::Repeat), 188);
        assert_eq!(byte(&ends, f32::NAN, Wrap::Repeat), 0);
        assert!(byte(&ends, 1e30, Wrap::Clamp) == 255);
    }

    #[test]
    fn damaged_images_are_named() {
        for bytes in [
            &b""[..],
            b"\x89PNG\r\n\x1a\n",
            b"\xff\xd8\xff\xe0 no",
            b"RIFF",
        ] {
            let file = ImageFile {
                name: "wall.png".to_owned(),
                bytes: bytes.to_vec(),
            };
            let error = Texels::decode(&file).unwrap_err().to_string();
            assert!(error.starts_with("wall.png: "), "{error}");
        }
    }

    #[test]
    fn images_above_the_budget_are_forgotten_but_still_given() {
        let mut png = Vec::new();
        let picture = image::RgbImage::from_pixel(8, 8, image::Rgb([1, 2, 3]));
        picture
            .write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png)
            .unwrap();
        let files = vec![
            ImageFile {
                name: String::new(),
                bytes: png,
            };
            3
        ];
        let store = ImageStore::new(&files, 400);
        for image in [0, 1, 2, 0] {
            assert_eq!(store.get(image).unwrap().rgb.len(), 64);
            assert!(store.held.lock().unwrap().bytes <= 400);
        }
    }
}
