//! A picture of the model, for lists of files: a WebP file in a section that readers of the model never need.

use crate::Error;
use image_webp::WebPDecoder;
use std::io::Cursor;

/// Most bytes of a thumbnail.
pub const MAX_BYTES: u64 = 1 << 20;
/// Most pixels a side.
pub const MAX_SIDE: u32 = 1024;

const WHAT: &str = "thumbnail";

/// A decoded thumbnail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Thumbnail {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Whether a pixel has a fourth byte, which says how much of it is covered.
    pub has_alpha: bool,
    /// Row by row from the top left, sRGB.
    pub pixels: Vec<u8>,
}

/// Decodes a thumbnail.
///
/// # Errors
/// When `bytes` are too many, no still WebP image, or one of more than [`MAX_SIDE`] pixels a side.
pub fn decode(bytes: &[u8]) -> Result<Thumbnail, Error> {
    let refuse = |reason: String| Error::Compression { what: WHAT, reason };
    let found = bytes.len() as u64;
    if found > MAX_BYTES {
        let (what, limit) = (WHAT, MAX_BYTES);
        return Err(Error::Limit { what, limit, found });
    }
    let mut decoder =
        WebPDecoder::new(Cursor::new(bytes)).map_err(|error| refuse(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    let side = width.max(height);
    if side > MAX_SIDE {
        return Err(Error::Limit {
            what: "pixels along a side of a thumbnail",
            limit: u64::from(MAX_SIDE),
            found: u64::from(side),
        });
    }
    if decoder.is_animated() {
        return Err(refuse("it is animated".to_owned()));
    }
    let length = decoder.output_buffer_size().unwrap_or(usize::MAX);
    // At most four bytes for each of the pixels just bounded.
    let mut pixels = vec![0; length.min(4 << 20)];
    decoder
        .read_image(&mut pixels)
        .map_err(|error| refuse(error.to_string()))?;
    Ok(Thumbnail {
        width,
        height,
        has_alpha: decoder.has_alpha(),
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image_webp::{ColorType, WebPEncoder};

    pub(crate) fn picture(width: u32, height: u32) -> Vec<u8> {
        let pixels: Vec<u8> = (0..width * height)
            .flat_map(|k| [k as u8, 90, 7, 255])
            .collect();
        let mut file = Vec::new();
        WebPEncoder::new(&mut file)
            .encode(&pixels, width, height, ColorType::Rgba8)
            .unwrap();
        file
    }

    #[test]
    fn a_picture_decodes_to_its_pixels() {
        let picture = decode(&picture(40, 30)).unwrap();
        assert_eq!((picture.width, picture.height), (40, 30));
        let channels = if picture.has_alpha { 4 } else { 3 };
        assert_eq!(picture.pixels.len(), 40 * 30 * channels);
        assert_eq!(picture.pixels.get(..3), Some(&[0, 90, 7][..]));
    }

    #[test]
    fn what_is_too_large_or_no_picture_is_refused() {
        assert!(decode(&picture(MAX_SIDE, 1)).is_ok());
        let wide = decode(&picture(MAX_SIDE + 1, 1));
        assert!(
            matches!(wide, Err(Error::Limit { found: 1025, .. })),
            "{wide:?}"
        );
        let long = decode(&vec![0; (1 << 20) + 1]);
        assert!(
            matches!(long, Err(Error::Limit { what: WHAT, .. })),
            "{long:?}"
        );
        let good = picture(40, 30);
        for bytes in [&b""[..], b"\x89PNG\r\n\x1a\n", &good[..good.len() / 2]] {
            let error = decode(bytes);
            assert!(matches!(error, Err(Error::Compression { .. })), "{error:?}");
        }
    }
}
