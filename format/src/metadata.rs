//! What the file says about itself.

use crate::lattice::Lattice;

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
