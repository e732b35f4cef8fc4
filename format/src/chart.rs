//! Charts and the glue between their sides.

/// Index of a chart; also the [`PageId`](crate::PageId) of its root page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChartId(pub u32);

/// A side of the parameter square, `0..4`: side s runs from corner s to corner (s + 1) mod 4.
///
/// Corners: 0 = (0,0), 1 = (1,0), 2 = (1,1), 3 = (0,1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side(pub u8);

/// What a chart's side is glued to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Glue {
    /// The neighbour (may be the chart itself).
    pub chart: ChartId,
    /// The neighbour's side.
    pub side: Side,
    /// Whether position t here is 1 − t there (the usual case on an oriented surface).
    pub reversed: bool,
}

/// What the front of the file says of one chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Glue by side; `None` is an open border.
    pub glue: [Option<Glue>; 4],
    /// Finest resolution of the root node, `0..=5`.
    pub resolution: u8,
    /// Geometric error (lattice units, upper bound) at resolutions `0..=min(resolution, base_resolution)`.
    pub base_errors: Vec<f32>,
}
