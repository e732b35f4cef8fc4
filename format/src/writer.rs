//! Writing a file from decoded samples.

use crate::{Error, Glue, Lattice, Metadata, NormalCone, PageSamples};

/// One node of a chart's tree, as the converter made it.
#[derive(Debug, Clone)]
pub struct NodeInput {
    /// Samples; positions are multiples of `2^lattice.shift`. Targets may be empty: the writer ignores them.
    pub samples: PageSamples,
    /// As [`PageEntry::errors`](crate::PageEntry::errors).
    pub errors: Vec<f32>,
    /// All triangle normals.
    pub cone: NormalCone,
    /// The four children in order (0,0) (1,0) (0,1) (1,1), or none. A child repeats, at its even samples,
    /// the parent's positions of its quadrant.
    pub children: Option<Box<[NodeInput; 4]>>,
}

/// One chart, as the converter made it.
#[derive(Debug, Clone)]
pub struct ChartInput {
    /// Glue by side.
    pub glue: [Option<Glue>; 4],
    /// The root node.
    pub root: NodeInput,
}

/// Bytes by part of a written file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct BytesByPart {
    /// The whole file.
    pub total: u64,
    /// Header, section table, metadata.
    pub header: u64,
    /// Directory, index blocks, glue.
    pub index: u64,
    /// Positions, base included.
    pub geometry: u64,
    /// Normals, base included.
    pub normals: u64,
    /// Colours, base included.
    pub colour: u64,
}

/// Writes a whole file to `out`, pages coded in parallel by the caller's closure-free, deterministic code.
///
/// Chooses the base resolution so that everything up to the base fits `first_image_bytes`.
///
/// # Errors
/// When the input breaks a rule of the format, or `out` fails.
pub fn write_atlas(
    metadata: &Metadata,
    lattice: &Lattice,
    charts: &[ChartInput],
    out: &mut dyn std::io::Write,
) -> Result<BytesByPart, Error> {
    let _ = (metadata, lattice, charts, out);
    unimplemented!()
}
