//! Quadtree nodes of a chart and their neighbours, across glue too.

#![allow(
    clippy::arithmetic_side_effects,
    reason = "the level of a node is at most MAX_LEVEL, its coordinates are below 2^level"
)]

use crate::chart::{ChartId, Glue, Side};

/// Cells a side of a full page, as a power of two.
pub const PAGE_RESOLUTION: u8 = 5;
/// Deepest level of a node.
pub const MAX_LEVEL: u8 = 15;

/// One quadtree node: a square of the chart. `level` 0 is the whole chart; `x`, `y` in `0..2^level`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId {
    /// The chart.
    pub chart: ChartId,
    /// 0 = root, higher is finer.
    pub level: u8,
    /// Column along u.
    pub x: u32,
    /// Row along v.
    pub y: u32,
}

/// Which child of its parent: bit 0 = right half (u), bit 1 = upper half (v).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Quadrant(pub u8);

impl NodeId {
    /// The root node of `chart`.
    pub fn root(chart: ChartId) -> Self {
        Self {
            chart,
            level: 0,
            x: 0,
            y: 0,
        }
    }

    /// The child in `quadrant`.
    #[must_use]
    pub fn child(self, quadrant: Quadrant) -> Self {
        Self {
            chart: self.chart,
            level: self.level + 1,
            x: 2 * self.x + u32::from(quadrant.0 & 1),
            y: 2 * self.y + u32::from(quadrant.0 >> 1 & 1),
        }
    }

    /// The parent and which quadrant of it this is; `None` for a root.
    pub fn parent(self) -> Option<(Self, Quadrant)> {
        let level = self.level.checked_sub(1)?;
        let quadrant = u8::from(self.x & 1 == 1) | u8::from(self.y & 1 == 1) << 1;
        Some((
            Self {
                chart: self.chart,
                level,
                x: self.x >> 1,
                y: self.y >> 1,
            },
            Quadrant(quadrant),
        ))
    }

    /// The node of the same level on the other side of `side`, with the side of it that faces back and
    /// whether positions along the two sides run opposite. `glue` is this chart's glue by side.
    ///
    /// `None` at an open border. Inside a chart sides run opposite too (both counter-clockwise).
    pub fn neighbour(self, side: Side, glue: &[Option<Glue>; 4]) -> Option<(Self, Side, bool)> {
        let n = 1u32 << self.level;
        let back = Side((side.0 + 2) % 4);
        let inside = |x, y| Some((Self { x, y, ..self }, back, true));
        match side.0 {
            0 if self.y > 0 => return inside(self.x, self.y - 1),
            1 if self.x + 1 < n => return inside(self.x + 1, self.y),
            2 if self.y + 1 < n => return inside(self.x, self.y + 1),
            3 if self.x > 0 => return inside(self.x - 1, self.y),
            _ => {}
        }
        let Glue {
            chart,
            side: to,
            reversed,
        } = (*glue.get(usize::from(side.0))?)?;
        // Position along our side, counted counter-clockwise.
        let along = match side.0 {
            0 => self.x,
            1 => self.y,
            2 => n - 1 - self.x,
            _ => n - 1 - self.y,
        };
        let t = if reversed { n - 1 - along } else { along };
        let (x, y) = match to.0 {
            0 => (t, 0),
            1 => (n - 1, t),
            2 => (n - 1 - t, n - 1),
            _ => (0, n - 1 - t),
        };
        Some((
            Self {
                chart,
                level: self.level,
                x,
                y,
            },
            to,
            reversed,
        ))
    }
}
