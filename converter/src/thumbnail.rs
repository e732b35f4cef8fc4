//! A small picture of the model, for lists of files.
//!
//! Drawn on the CPU from what is about to be written, since servers have no GPU: seen from the front, a little from the right and from above, without
//! perspective, in the viewer's light, on a transparent ground. Every pixel is the mean of 4 × 4 samples. The picture is the same for any number of
//! threads: one draws it.
//!
//! Stored as lossy WebP: a seventh to a tenth of the bytes of a PNG, a third of one that has 64 shades of grey (bunny, dragon, armadillo).

mod cut;
mod pieces;
mod raster;
mod view;

use crate::texture::light::Light;
use marquetry_format::Metadata;
use marquetry_format::writer::Content;
use pieces::Pieces;
use raster::Canvas;
use view::View;

/// Pixels across.
pub const WIDTH: u32 = 256;
/// Pixels down.
pub const HEIGHT: u32 = 192;
/// Quality of the encoder, 0 to 100.
const QUALITY: f32 = 75.0;

/// A picture could not be made: our fault.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThumbnailError {
    /// An image of a cluster does not decode.
    #[error("an image of the model cannot be read: {0}")]
    Texture(#[from] marquetry_format::Error),
    /// The encoder failed.
    #[error("the picture cannot be compressed: {0}")]
    Encode(String),
}

/// Draws `content` as a WebP file.
///
/// # Errors
/// See [`ThumbnailError`].
pub fn draw(content: &Content<'_>, metadata: &Metadata) -> Result<Vec<u8>, ThumbnailError> {
    encode(&pixels(content, metadata)?)
}

/// The picture, four bytes a pixel (sRGB, then how much of it is covered), from the top left.
fn pixels(content: &Content<'_>, metadata: &Metadata) -> Result<Vec<u8>, ThumbnailError> {
    let light = Light::new();
    let pieces = Pieces::of(content);
    let view = View::framing(pieces.finest(), metadata.up_axis);
    let mut canvas = Canvas::new(WIDTH as usize, HEIGHT as usize);
    for piece in pieces.fit_for(&view) {
        piece.draw(&view, &light, &mut canvas)?;
    }
    Ok(canvas.resolve(&light))
}

fn encode(rgba: &[u8]) -> Result<Vec<u8>, ThumbnailError> {
    let failed = |cause: &str| ThumbnailError::Encode(cause.to_owned());
    let mut config = webp::WebPConfig::new().map_err(|()| failed("libwebp has another version"))?;
    config.quality = QUALITY;
    // More effort takes a second for the last hundredth of the bytes.
    config.method = 4;
    webp::Encoder::from_rgba(rgba, WIDTH, HEIGHT)
        .encode_advanced(&config)
        .map(|file| file.to_vec())
        .map_err(|error| failed(&format!("{error:?}")))
}

#[cfg(test)]
mod tests;
