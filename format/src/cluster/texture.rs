//! The image of a textured cluster.

use crate::colour::{TileTexels, decode_frame, frame_size};
use crate::{Error, ImageTask};

/// Most texels a side of a cluster's texture.
pub const MAX_TEXTURE_TEXELS: u32 = 256;
/// Widths and heights of textures are multiples of this, so that three mips are whole.
pub const TEXTURE_STEP: u32 = 8;

/// The image on a cluster, and where on it the vertices lie.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClusterTexture {
    /// Column and row of the texel whose centre is the vertex, as many as positions.
    pub places: Vec<[u8; 2]>,
    /// A VP8 key frame of 8 to 256 texels a side, in steps of 8. Between triangles it holds what is best for filters.
    pub frame: Vec<u8>,
}

impl ClusterTexture {
    /// Width and height, texels.
    ///
    /// # Errors
    /// When the frame is no key frame of a size that a cluster may have.
    pub fn size(&self) -> Result<[u32; 2], Error> {
        let size = frame_size(&self.frame)?;
        let wrong = |side: &&u32| {
            **side == 0 || **side > MAX_TEXTURE_TEXELS || !side.is_multiple_of(TEXTURE_STEP)
        };
        match size.iter().find(wrong) {
            None => Ok(size),
            Some(&side) => Err(Error::Value {
                what: "side of a cluster's texture",
                found: u64::from(side),
            }),
        }
    }

    /// Refuses a frame of another size than clusters may have, and places that are not on it.
    ///
    /// # Errors
    /// As said.
    pub fn check(&self) -> Result<(), Error> {
        let [width, height] = self.size()?;
        let outside = |[i, j]: &&[u8; 2]| u32::from(*i) >= width || u32::from(*j) >= height;
        match self.places.iter().find(outside) {
            None => Ok(()),
            Some([i, j]) => Err(Error::Value {
                what: "place on a cluster's texture",
                found: u64::from(u16::from_le_bytes([*i, *j])),
            }),
        }
    }

    /// Decodes the image.
    ///
    /// # Errors
    /// When the frame is damaged, or of a size that clusters may not have.
    pub fn decode(&self) -> Result<TileTexels, Error> {
        decode_frame(self.size()?, &self.frame)
    }

    /// [`ClusterTexture::decode`] as a task of its own.
    ///
    /// # Errors
    /// When the frame is of a size that clusters may not have.
    pub fn task(&self) -> Result<ImageTask, Error> {
        let [width, height] = self.size()?;
        let frame = self.frame.clone();
        Ok(ImageTask {
            width,
            height,
            frame,
        })
    }
}
