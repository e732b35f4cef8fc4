//! What a frame cost: the engine's part of the `render` report.

/// Pages since the file was opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PageStats {
    /// Pages asked for, retries not counted twice.
    pub requested: u64,
    /// Pages that arrived and decoded.
    pub fetched: u64,
    /// Bytes of pages and index blocks that arrived.
    pub bytes: u64,
    /// Pages that the present view wants and that are not resident.
    pub missing: u64,
}

/// Colour tiles since the file was opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TileStats {
    /// Tiles asked for, retries not counted twice.
    pub requested: u64,
    /// Tiles that arrived and decoded.
    pub fetched: u64,
    /// Bytes of tiles and their index that arrived.
    pub bytes: u64,
    /// Tiles that the present view wants and that are not resident.
    pub missing: u64,
    /// What resident tiles take on the GPU.
    pub used_bytes: u64,
    /// Tiles evicted so far.
    pub evictions: u64,
    /// Fetches that failed so far.
    pub failures: u64,
}

/// The page cache.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CacheStats {
    /// The budget.
    pub capacity_bytes: u64,
    /// What evictable pages take, CPU and GPU; never above the budget.
    pub used_bytes: u64,
    /// What the base takes, which never leaves.
    pub pinned_bytes: u64,
    /// Pages evicted so far.
    pub evictions: u64,
}

/// What is drawn, and what it took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stats {
    /// Triangles drawn, those of zero area at borders included.
    pub triangles: u64,
    /// Nodes drawn: one instance each.
    pub nodes: u64,
    /// Draw calls.
    pub draw_calls: u64,
    /// Pages.
    pub pages: PageStats,
    /// Colour tiles.
    pub tiles: TileStats,
    /// Page cache.
    pub cache: CacheStats,
    /// Fetches that failed so far, retries included.
    pub failures: u64,
    /// Screen-space error that is being aimed at, pixels: above the option where the cache budget forces it.
    pub error_px: f64,
}
