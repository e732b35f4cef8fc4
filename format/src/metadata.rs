//! What the file says about itself.

use crate::lattice::Lattice;
use crate::{Error, Limits};

/// What kind of content the file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContentKind {
    /// A scanned surface as an atlas.
    Scan,
    /// A heightfield.
    Terrain,
    /// Many objects in space and time.
    Scene,
}

/// Small facts read when the file is opened.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Metadata {
    /// Kind of content.
    pub kind: ContentKind,
    /// The lattice of all positions.
    pub lattice: Lattice,
    /// World bounds of the model.
    pub bounds_min: [f64; 3],
    /// World bounds of the model.
    pub bounds_max: [f64; 3],
    /// Which axis points up: 0 x, 1 y, 2 z.
    pub up_axis: u8,
    /// Whether samples carry colours.
    pub has_colours: bool,
    /// Target geometric error of the conversion, relative to the bounds' diagonal.
    pub target_error_rel: f64,
    /// Largest geometric error at the finest resolution (guaranteed bound), relative.
    pub max_error_rel: f64,
    /// RMS error at the finest resolution, measured, relative.
    pub rms_error_rel: f64,
    /// Triangles of the input.
    pub source_triangles: u64,
    /// Vertices of the input, as stored.
    pub source_vertices: u64,
    /// File name of the input (no folder).
    pub source_name: String,
    /// Program and version that wrote the file.
    pub generator: String,
}

/// Most bytes of metadata under any [`Limits`]; bincode wants this bound as a constant.
const MAX_METADATA_BYTES: usize = 1 << 24;

impl Metadata {
    /// Reads the metadata section.
    pub(crate) fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, Error> {
        let length = bytes.len() as u64;
        let limit = limits.metadata_bytes.min(MAX_METADATA_BYTES as u64);
        if length > limit {
            return Err(Error::Limit {
                what: "metadata",
                limit,
                found: length,
            });
        }
        let config = bincode::config::standard().with_limit::<MAX_METADATA_BYTES>();
        let (metadata, used): (Self, usize) = bincode::serde::decode_from_slice(bytes, config)
            .map_err(|error| Error::Metadata(error.to_string()))?;
        if used != bytes.len() {
            return Err(Error::TrailingBytes {
                what: "metadata",
                expected: used as u64,
                found: length,
            });
        }
        metadata.check()?;
        Ok(metadata)
    }

    /// Refuses values that readers could not work with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |what: &str| Err(Error::Metadata(what.to_owned()));
        let Lattice {
            origin,
            step,
            shift,
        } = self.lattice;
        let finite = step.is_finite() && origin.iter().all(|c| c.is_finite());
        if !finite || step <= 0.0 {
            return refuse("the lattice needs a finite origin and a finite step above zero");
        }
        if shift > 15 {
            return refuse("the lattice's shift is above 15");
        }
        let ordered = self
            .bounds_min
            .iter()
            .zip(&self.bounds_max)
            .all(|(min, max)| min <= max);
        if !ordered
            || !self
                .bounds_min
                .iter()
                .chain(&self.bounds_max)
                .all(|c| c.is_finite())
        {
            return refuse("the bounds are not finite or not in order");
        }
        if self.up_axis > 2 {
            return refuse("the up axis is none of 0, 1, 2");
        }
        let errors = [
            self.target_error_rel,
            self.max_error_rel,
            self.rms_error_rel,
        ];
        if !errors
            .iter()
            .all(|error| error.is_finite() && *error >= 0.0)
        {
            return refuse("an error is negative or not finite");
        }
        Ok(())
    }

    /// The bytes of the metadata section.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Error> {
        self.check()?;
        bincode::serde::encode_to_vec(self, bincode::config::standard())
            .map_err(|error| Error::Metadata(error.to_string()))
    }
}
