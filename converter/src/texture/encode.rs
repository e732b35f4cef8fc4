//! Tiles as VP8 key frames, by libwebp.
//!
//! Chosen by measurement over JPEG (4:2:0, optimised Huffman): at equal SSIM, tiles of scans take 0.4 to 0.6 of its bytes.

use super::pyramid::RawTile;
use marquetry_format::TexelSize;
use marquetry_format::writer::TileInput;

/// Quality of the encoder, 0 to 100; with it the SSIM of tiles is that of a JPEG of quality 85.
const QUALITY: f32 = 85.0;
/// Most bytes of a frame: pages have at most 128 KiB, and that of a cluster holds its mesh, too.
const MOST_BYTES: usize = 112 << 10;
/// Bytes of the container before the frame: RIFF header and chunk header.
const CONTAINER_BYTES: usize = 20;

/// A tile could not be compressed: our fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a colour tile cannot be compressed: {0}")]
pub struct EncodeError(String);

/// Compresses a tile and everything below it.
///
/// # Errors
/// When the encoder fails.
pub fn tree(tile: RawTile, size: TexelSize) -> Result<TileInput, EncodeError> {
    let (width, height) = size.stored();
    let bytes = frame(&tile.rgb, width, height)?;
    let mut children = [const { None }; 4];
    for (slot, child) in children.iter_mut().zip(tile.children) {
        *slot = child
            .map(|child| tree(*child, size).map(Box::new))
            .transpose()?;
    }
    Ok(TileInput { bytes, children })
}

/// Compresses `width` × `height` texels, row by row; less well where they do not fit a page.
///
/// # Errors
/// When the encoder fails.
pub fn frame(rgb: &[u8], width: u32, height: u32) -> Result<Vec<u8>, EncodeError> {
    let mut quality = QUALITY;
    loop {
        let frame = compressed(rgb, width, height, quality)?;
        if frame.len() <= MOST_BYTES || quality < 1.0 {
            return Ok(frame);
        }
        quality *= 0.7;
    }
}

fn compressed(rgb: &[u8], width: u32, height: u32, quality: f32) -> Result<Vec<u8>, EncodeError> {
    let failed = |cause: &str| EncodeError(cause.to_owned());
    let mut config = webp::WebPConfig::new().map_err(|()| failed("libwebp has another version"))?;
    config.quality = quality;
    config.method = 4;
    let file = webp::Encoder::from_rgb(rgb, width, height)
        .encode_advanced(&config)
        .map_err(|error| EncodeError(format!("{error:?}")))?;
    let stored = file
        .get(CONTAINER_BYTES - 4..CONTAINER_BYTES)
        .and_then(|bytes| <[u8; 4]>::try_from(bytes).ok())
        .filter(|_| file.get(12..16) == Some(b"VP8 "))
        .ok_or_else(|| failed("the file is not in the simple format"))?;
    let length = u32::from_le_bytes(stored) as usize;
    file.get(CONTAINER_BYTES..)
        .and_then(|rest| rest.get(..length))
        .map(<[u8]>::to_vec)
        .ok_or_else(|| failed("the file is cut short"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_decode_to_what_they_were() {
        let size = TexelSize {
            width: 40,
            height: 16,
        };
        let (width, height) = size.stored();
        let byte = |k: u32| [k % width * 4, k / width * 8, 90].map(|c| u8::try_from(c).unwrap());
        let rgb: Vec<u8> = (0..width * height).flat_map(byte).collect();
        let frame = frame(&rgb, width, height).unwrap();
        let texels = marquetry_format::colour::decode_vp8(size, &frame).unwrap();
        assert_eq!((texels.width, texels.height), (width, height));
        let worst = rgb.iter().zip(&texels.rgb).map(|(a, b)| a.abs_diff(*b));
        assert!(worst.max().unwrap() < 16);
    }
}
