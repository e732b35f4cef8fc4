//! Bounds on what a file may ask of a reader, checked before memory is taken.

/// Upper bounds that a reader enforces. The defaults hold a billion-triangle scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Charts in a file.
    pub charts: u32,
    /// Pages in a file.
    pub pages: u32,
    /// Clusters in a file.
    pub clusters: u32,
    /// Bytes of metadata, encoded.
    pub metadata_bytes: u64,
    /// Bytes of any one front section (directory, glue, base), decoded.
    pub section_bytes: u64,
    /// Stored bytes of one page, also of one cluster or colour tile.
    pub page_bytes: u32,
    /// Colour tiles in a file.
    pub tiles: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            charts: 1 << 22,
            pages: 1 << 26,
            clusters: 1 << 20,
            metadata_bytes: 1 << 20,
            section_bytes: 1 << 26,
            page_bytes: 1 << 17,
            tiles: 1 << 26,
        }
    }
}
