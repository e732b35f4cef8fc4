//! The bytes of one tile: a VP8 key frame (RFC 6386), the content of a lossy `WebP` file without its container.

use super::TexelSize;
use crate::Error;
use image_webp::WebPDecoder;
use std::io::Cursor;

const WHAT: &str = "colour tile";

/// A decoded tile: sRGB, 8 bits a channel, row by row from (u, v) = (0, 0), gutter included.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileTexels {
    /// Texels along u.
    pub width: u32,
    /// Texels along v.
    pub height: u32,
    /// Three bytes a texel.
    pub rgb: Vec<u8>,
}

/// Decodes a tile of a chart of this size.
///
/// # Errors
/// When the bytes are no key frame of exactly that size.
pub fn decode_vp8(size: TexelSize, bytes: &[u8]) -> Result<TileTexels, Error> {
    let (width, height) = size.stored();
    decode_frame([width, height], bytes)
}

/// Decodes a key frame of exactly `width` × `height` texels.
pub(crate) fn decode_frame([width, height]: [u32; 2], bytes: &[u8]) -> Result<TileTexels, Error> {
    for (expected, found) in [width, height].into_iter().zip(frame_size(bytes)?) {
        if expected != found {
            return Err(Error::Mismatch {
                what: "size of a tile",
                expected: u64::from(expected),
                found: u64::from(found),
            });
        }
    }
    let refuse = |error: image_webp::DecodingError| Error::Compression {
        what: WHAT,
        reason: error.to_string(),
    };
    let mut decoder = WebPDecoder::new(Cursor::new(in_container(bytes)?)).map_err(refuse)?;
    let mut rgb = Vec::new();
    let length = decoder.output_buffer_size().unwrap_or(usize::MAX);
    let expected = u64::from(width)
        .saturating_mul(u64::from(height))
        .saturating_mul(3);
    if decoder.dimensions() != (width, height) || length as u64 != expected {
        return Err(Error::Mismatch {
            what: "bytes of a decoded tile",
            expected,
            found: length as u64,
        });
    }
    rgb.resize(length, 0);
    decoder.read_image(&mut rgb).map_err(refuse)?;
    Ok(TileTexels { width, height, rgb })
}

/// Width and height of a key frame, so that what is too large is refused before a decoder sees it.
pub(crate) fn frame_size(bytes: &[u8]) -> Result<[u32; 2], Error> {
    let mut cursor = crate::bytes::Cursor::new(WHAT, bytes);
    let tag = cursor.take(3)?;
    let code = cursor.take(3)?;
    // The two high bits ask a player to scale the picture: no size has them.
    let size = [u32::from(cursor.u16()?), u32::from(cursor.u16()?)];
    if tag.first().is_none_or(|&byte| byte & 1 != 0) || code != [0x9d, 0x01, 0x2a] {
        return Err(Error::Compression {
            what: WHAT,
            reason: "it is no VP8 key frame".to_owned(),
        });
    }
    Ok(size)
}

/// The frame as a file in the simple format, which is what decoders take.
fn in_container(frame: &[u8]) -> Result<Vec<u8>, Error> {
    let too_long = || Error::Value {
        what: WHAT,
        found: frame.len() as u64,
    };
    let length = u32::try_from(frame.len()).ok().ok_or_else(too_long)?;
    let padded = length.checked_next_multiple_of(2).ok_or_else(too_long)?;
    let riff = padded.checked_add(12).ok_or_else(too_long)?;
    let mut file = b"RIFF".to_vec();
    file.extend(riff.to_le_bytes());
    file.extend(b"WEBPVP8 ");
    file.extend(length.to_le_bytes());
    file.extend_from_slice(frame);
    file.resize(file.len().next_multiple_of(2), 0);
    Ok(file)
}
