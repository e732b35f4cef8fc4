//! Where the bytes of a file go.

/// Bytes by part of a file; the parts add up to `total`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct BytesByPart {
    /// The whole file.
    pub total: u64,
    /// Header, section table, metadata, and sections that this version does not know.
    pub header: u64,
    /// Directory, index blocks, glue.
    pub index: u64,
    /// Positions, base included.
    pub geometry: u64,
    /// Normals, base included.
    pub normals: u64,
    /// Colours, base and colour tiles included.
    pub colour: u64,
    /// The picture of the model.
    pub thumbnail: u64,
}
