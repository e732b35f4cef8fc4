//! The cut that a view wants, whatever is in memory: projected error against a target, then balanced by refinement.
//!
//! Errors never grow on the way down the tree and bounds only shrink, so a walk from the roots finds the coarsest cut that
//! meets the target. What was wanted before stays wanted down to [`HYSTERESIS`] of the target while the camera moves.
//! Where the index ends (its blocks are read on demand) the walk stops and names the blocks that would take it further.

use super::balance;
use super::cluster;
use super::cut::{Cut, Leaf, QUADRANTS};
use super::residency::children;
use crate::camera::View;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{Bounds, ChartId, ClusterGroup, ClusterNode, Document, NodeId, PageId};
use std::collections::BTreeSet;

/// A leaf that was wanted is given up when a coarser one's error falls below this part of the target: until then it shows the coarser one
/// anyway ([`rest`](super::rest)), and what is above that soon begins to move, which it cannot while the leaf is there.
pub const HYSTERESIS: f64 = 0.85;

/// Outside the picture errors count for less: a turn of the head finds something there, but the memory serves what is seen.
const OUT_OF_SIGHT: f64 = 0.25;

/// What decides a cut.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// The view.
    pub view: &'a View,
    /// Largest screen-space error wanted, pixels.
    pub error_px: f64,
    /// The same for refinement that needs pages beyond the base; at least `error_px`.
    pub paged_error_px: f64,
    /// What was wanted before, for hysteresis; `None` while the camera rests.
    pub previous: Option<&'a Cut>,
}

impl Target<'_> {
    /// Largest screen-space error wanted of what needs a page beyond the base, or of what does not.
    pub(super) fn limit_px(&self, needs_page: bool) -> f64 {
        if needs_page {
            self.paged_error_px
        } else {
            self.error_px
        }
    }
}

/// What a view wants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// The cut, balanced.
    pub cut: Cut,
    /// Index blocks that have to be read before more can be wanted.
    pub blocks: BTreeSet<u32>,
}

/// What a document's tree looks like to the walk, with the bounds of the charts as far as the base knows them.
#[derive(Debug)]
pub struct Forest {
    base_bounds: Vec<Bounds>,
}

impl Forest {
    /// Computes the bounds of the base.
    pub fn new(document: &Document) -> Self {
        let base_bounds = document
            .base
            .iter()
            .map(|samples| {
                let mut bounds = Bounds {
                    min: [u32::MAX; 3],
                    max: [0; 3],
                };
                for point in &samples.positions {
                    for (axis, value) in point.iter().enumerate() {
                        bounds.min[axis] = bounds.min[axis].min(*value);
                        bounds.max[axis] = bounds.max[axis].max(*value);
                    }
                }
                bounds
            })
            .collect();
        Self { base_bounds }
    }

    /// Bounds of `node` and of everything below it; of what the base holds of it where the index is not loaded.
    pub fn bounds(&self, document: &Document, node: NodeId) -> Option<Bounds> {
        let entry = document
            .page_of_node(node)
            .and_then(|page| document.page(page));
        entry
            .map(|entry| entry.bounds)
            .or_else(|| self.base_bounds(node.chart))
    }

    fn base_bounds(&self, chart: ChartId) -> Option<Bounds> {
        self.base_bounds
            .get(usize::try_from(chart.0).ok()?)
            .copied()
    }

    /// The cut that `target` asks for.
    pub fn want(&self, document: &Document, target: &Target<'_>) -> Wanted {
        let mut walk = Walk {
            document,
            target,
            blocks: BTreeSet::new(),
            cut: Cut::coarsest(document.charts.len()),
        };
        for index in 0..document.charts.len() {
            let Ok(id) = u32::try_from(index) else { break };
            walk.root(self, ChartId(id));
        }
        let Walk {
            mut blocks,
            mut cut,
            ..
        } = walk;
        balance::refine(&mut cut, &document.charts, |leaf| {
            is_refinable(document, leaf, &mut blocks)
        });
        balance::coarsen(&mut cut, &document.charts);
        cluster::refine(document, &mut cut, |id, node, error| {
            let was_split = target.previous.is_some_and(|cut| cut.is_cluster_split(id));
            let limit = if was_split {
                HYSTERESIS * target.paged_error_px
            } else {
                target.paged_error_px
            };
            // A texel may be as long as a pixel, or longer by as much as the budget raises the error.
            let texels = target.paged_error_px / target.error_px;
            let texels = if was_split {
                HYSTERESIS * texels
            } else {
                texels
            };
            is_more_important(target.view, error, &node.bounds, limit)
                || node.texel.is_some_and(|texel| {
                    is_more_important(target.view, texel, &node.bounds, texels)
                })
        });
        Wanted { cut, blocks }
    }
}

struct Walk<'a> {
    document: &'a Document,
    target: &'a Target<'a>,
    blocks: BTreeSet<u32>,
    cut: Cut,
}

impl Walk<'_> {
    fn root(&mut self, forest: &Forest, id: ChartId) {
        let Some(chart) = usize::try_from(id.0)
            .ok()
            .and_then(|index| self.document.charts.get(index))
        else {
            return;
        };
        let entry = self.document.page(PageId(id.0));
        let Some(bounds) = entry
            .map(|entry| entry.bounds)
            .or_else(|| forest.base_bounds(id))
        else {
            return;
        };
        let base = self.document.base_resolution.min(chart.resolution);
        let mut resolution = 0;
        while let Some(error) = root_error(self.document, id, resolution) {
            let root = NodeId::root(id);
            let was_finer = self.target.previous.is_some_and(|cut| {
                cut.root_resolution(id)
                    .is_none_or(|previous| previous > resolution)
            });
            if !self.is_too_coarse(error, &bounds, resolution >= base, was_finer)
                || !is_refinable(
                    self.document,
                    Leaf {
                        node: root,
                        resolution,
                    },
                    &mut self.blocks,
                )
            {
                break;
            }
            if resolution == PAGE_RESOLUTION {
                self.split(root, PageId(id.0));
                return;
            }
            resolution += 1;
        }
        self.cut.set_root(id, resolution);
    }

    /// Splits `node`, and what is below it as far as the target asks.
    fn split(&mut self, node: NodeId, page: PageId) {
        let mut stack = vec![(node, page)];
        while let Some((node, page)) = stack.pop() {
            let Some(first) = self.document.first_child(page) else {
                continue;
            };
            self.cut.split(node);
            for (quadrant, page) in QUADRANTS.into_iter().zip(children(first)) {
                let child = node.child(quadrant);
                let Some(entry) = self.document.page(page) else {
                    continue;
                };
                let Some(error) = entry.errors.first() else {
                    continue;
                };
                let was_finer = self.target.previous.is_some_and(|cut| cut.is_split(child));
                let leaf = Leaf {
                    node: child,
                    resolution: PAGE_RESOLUTION + child.level,
                };
                if self.is_too_coarse(*error, &entry.bounds, true, was_finer)
                    && is_refinable(self.document, leaf, &mut self.blocks)
                {
                    stack.push((child, page));
                }
            }
        }
    }

    fn is_too_coarse(
        &self,
        error: f32,
        bounds: &Bounds,
        needs_page: bool,
        was_finer: bool,
    ) -> bool {
        let limit = self.target.limit_px(needs_page);
        let limit = if was_finer { HYSTERESIS * limit } else { limit };
        is_more_important(self.target.view, error, bounds, limit)
    }
}

/// Geometric error of the root of `chart` at a resolution, lattice units.
pub(super) fn root_error(document: &Document, chart: ChartId, resolution: u8) -> Option<f32> {
    let index = usize::from(resolution);
    let entry = document.page(PageId(chart.0));
    let base = document.charts.get(usize::try_from(chart.0).ok()?)?;
    let error = entry.and_then(|entry| entry.errors.get(index));
    error.or_else(|| base.base_errors.get(index)).copied()
}

/// Screen-space error, pixels, of a geometric error in `bounds`, less where it cannot be seen.
pub fn importance_px(view: &View, error: f32, bounds: &Bounds) -> f64 {
    let factor = if view.sees(bounds) { 1.0 } else { OUT_OF_SIGHT };
    factor * view.error_px(error, bounds)
}

/// Whether [`importance_px`] is above `limit`; whether it can be seen is only asked where that decides it.
fn is_more_important(view: &View, error: f32, bounds: &Bounds, limit: f64) -> bool {
    let px = view.error_px(error, bounds);
    OUT_OF_SIGHT * px > limit || (px > limit && view.sees(bounds))
}

/// Length of a texel of a cluster's texture, pixels, less where it cannot be seen; 0 without a texture.
fn texel_px(view: &View, node: &ClusterNode) -> f64 {
    node.texel
        .map_or(0.0, |texel| importance_px(view, texel, &node.bounds))
}

/// What is shown in place of the children of a member of a group, pixels: its error, where theirs is less, or the length of its texels.
pub fn cluster_importance_px(view: &View, group: &ClusterGroup, node: &ClusterNode) -> f64 {
    let error = cluster::error_over(group, node);
    importance_px(view, error, &node.bounds).max(texel_px(view, node))
}

/// Whether the file holds anything finer than `leaf` and the index of it is loaded; notes the blocks that are not.
fn is_refinable(document: &Document, leaf: Leaf, blocks: &mut BTreeSet<u32>) -> bool {
    let Some(chart) = usize::try_from(leaf.node.chart.0)
        .ok()
        .and_then(|index| document.charts.get(index))
    else {
        return false;
    };
    let root_page = PageId(leaf.node.chart.0);
    if leaf.node.level == 0 && leaf.resolution < chart.resolution {
        return leaf.resolution < document.base_resolution
            || is_indexed(document, root_page, blocks);
    }
    if chart.resolution < PAGE_RESOLUTION || !is_indexed(document, root_page, blocks) {
        return false;
    }
    let Some(page) = document.page_of_node(leaf.node) else {
        return false;
    };
    let Some(first) = document.first_child(page) else {
        return false;
    };
    // All four are asked before the answer, so that blocks of all four are noted.
    children(first).map(|child| is_indexed(document, child, blocks)) == [true; 4]
}

fn is_indexed(document: &Document, page: PageId, blocks: &mut BTreeSet<u32>) -> bool {
    if document.page(page).is_some() {
        return true;
    }
    if page.0 < document.page_count() {
        let block = document.index_block_of(page);
        if !document.has_index_block(block) {
            blocks.insert(block);
        }
    }
    false
}
