//! Which tiles a view wants: the finest whose texels are no smaller than a pixel, and all above them.

use crate::camera::View;
use crate::lod::desire::Forest;
use marquetry_format::quadtree::MAX_LEVEL;
use marquetry_format::{ChartId, ColourIndex, Document, NodeId, Quadrant, TileId};
use std::collections::BTreeSet;

/// A tile is refined while its texels are longer than this many pixels.
const TEXEL_PX: f64 = 1.0;

/// How long texels are, by chart.
#[derive(Debug)]
pub struct Scales {
    /// Lattice units of the longest line of the base along u and along v.
    extents: Vec<[f32; 2]>,
}

/// A tile that a view wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WantedTile {
    /// The tile.
    pub tile: TileId,
    /// Where it lies.
    pub node: NodeId,
    /// Length of a texel of its parent, pixels: what is shown without it.
    pub importance_px: f64,
}

/// What a view wants.
#[derive(Debug, Default)]
pub struct WantedTiles {
    /// Parents before children.
    pub tiles: Vec<WantedTile>,
    /// Index blocks that have to be read before more can be wanted.
    pub blocks: BTreeSet<u32>,
}

impl Scales {
    /// Measures the base.
    pub fn new(document: &Document) -> Self {
        let extents = document.base.iter().map(|samples| {
            let side = samples.side();
            let point = |i: usize, j: usize| {
                let point = samples.positions.get(j * side + i).copied();
                glam::DVec3::from_array(point.unwrap_or_default().map(f64::from))
            };
            let length = |line: usize, along_u: bool| -> f64 {
                let at = |k: usize| {
                    if along_u {
                        point(k, line)
                    } else {
                        point(line, k)
                    }
                };
                (1..side).map(|k| at(k - 1).distance(at(k))).sum()
            };
            [true, false].map(|along_u| {
                let longest = (0..side)
                    .map(|line| length(line, along_u))
                    .fold(0.0, f64::max);
                #[expect(clippy::cast_possible_truncation, reason = "a length on the lattice")]
                let longest = longest as f32;
                longest
            })
        });
        Self {
            extents: extents.collect(),
        }
    }

    /// Length of a texel of `chart` at `level`, lattice units.
    pub fn texel(&self, index: &ColourIndex, chart: ChartId, level: u8) -> f32 {
        let extent = usize::try_from(chart.0)
            .ok()
            .and_then(|chart| self.extents.get(chart));
        let (Some([along_u, along_v]), Some(size)) = (extent, index.size(chart)) else {
            return 0.0;
        };
        let root = (along_u / size.width as f32).max(along_v / size.height as f32);
        root / f32::from(1u16 << level.min(MAX_LEVEL))
    }
}

/// Walks the trees of the charts in sight. `coarser` (at least 1) is the factor that a budget asks for.
pub fn want(
    document: &Document,
    index: &ColourIndex,
    forest: &Forest,
    scales: &Scales,
    view: &View,
    coarser: f64,
) -> WantedTiles {
    let mut wanted = WantedTiles::default();
    let mut stack: Vec<(TileId, NodeId)> = (0..document.chart_count())
        .map(ChartId)
        .filter_map(|chart| Some((index.root(chart)?, NodeId::root(chart))))
        .collect();
    while let Some((tile, node)) = stack.pop() {
        let Some(bounds) = forest.bounds(document, covering(document, node)) else {
            continue;
        };
        if !view.sees(&bounds) {
            continue;
        }
        let texel_px = |level| view.error_px(scales.texel(index, node.chart, level), &bounds);
        if index.tile(tile).is_none() {
            wanted.blocks.insert(index.block_of(tile));
            continue;
        }
        let own_px = texel_px(node.level);
        wanted.tiles.push(WantedTile {
            tile,
            node,
            // A root is worth more than any child: it stands for the whole chart.
            importance_px: if node.level == 0 {
                1e3 + own_px
            } else {
                2.0 * own_px
            },
        });
        if own_px > TEXEL_PX * coarser && node.level < MAX_LEVEL {
            stack.extend(
                (0..4).map(Quadrant).filter_map(|quadrant| {
                    Some((index.child(tile, quadrant)?, node.child(quadrant)))
                }),
            );
        }
    }
    wanted
}

/// The deepest node at or above `node` that has a page.
fn covering(document: &Document, node: NodeId) -> NodeId {
    let mut found = node;
    while document.page_of_node(found).is_none() {
        match found.parent() {
            Some((parent, _)) => found = parent,
            None => break,
        }
    }
    found
}
