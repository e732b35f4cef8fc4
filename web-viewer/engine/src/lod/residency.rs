//! Rule R7: a cut refines only into what is resident; and which pages a cut needs.

use super::balance;
use super::cluster;
use super::cut::{Cut, QUADRANTS};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, Document, NodeId, PageId};

/// The finest balanced cut that is nowhere finer than `wanted` and needs only pages for which `resident` is true.
///
/// Always exists: the base is resident, so every chart can be drawn.
pub fn restrict(
    wanted: &Cut,
    document: &Document,
    mut resident: impl FnMut(PageId) -> bool,
) -> Cut {
    let mut cut = wanted.clone();
    let mut split: Vec<NodeId> = cut.split_nodes().collect();
    split.sort_unstable_by_key(|node| node.level);
    for node in split {
        if !cut.is_split(node) {
            continue;
        }
        let first = document
            .page_of_node(node)
            .and_then(|page| document.first_child(page));
        let root_there =
            node.level > 0 || root_limit(document, node.chart, &mut resident) == PAGE_RESOLUTION;
        if !root_there || !first.is_some_and(|first| children(first).into_iter().all(&mut resident))
        {
            cut.collapse(node);
        }
    }
    for id in (0..document.charts.len())
        .map_while(|index| u32::try_from(index).ok())
        .map(ChartId)
    {
        if let Some(resolution) = cut.root_resolution(id) {
            cut.set_root(id, resolution.min(root_limit(document, id, &mut resident)));
        }
    }
    balance::coarsen(&mut cut, &document.charts);
    cluster::restrict(document, &mut cut, resident);
    cut
}

/// Finest resolution that the root of `chart` can be drawn at.
fn root_limit(
    document: &Document,
    chart: ChartId,
    resident: &mut impl FnMut(PageId) -> bool,
) -> u8 {
    let finest = usize::try_from(chart.0)
        .ok()
        .and_then(|index| document.charts.get(index))
        .map_or(0, |c| c.resolution);
    let base = document.base_resolution.min(finest);
    if finest > base && resident(PageId(chart.0)) {
        finest
    } else {
        base
    }
}

/// A page that a cut needs, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NeededPage {
    /// The page.
    pub page: PageId,
    /// Its node.
    pub node: NodeId,
    /// The page that it is decoded from; `None` for a root page, or a child of a root that lies wholly in the base.
    pub parent: Option<PageId>,
}

/// The pages that `cut` needs beyond the base, parents before children; those whose index is not loaded are left out.
pub fn needed_pages(cut: &Cut, document: &Document) -> Vec<NeededPage> {
    let mut pages = Vec::new();
    let mut stack = Vec::new();
    for (index, chart) in document.charts.iter().enumerate() {
        let Ok(id) = u32::try_from(index) else { break };
        let (root, page) = (NodeId::root(ChartId(id)), PageId(id));
        let base = document.base_resolution.min(chart.resolution);
        let in_page = chart.resolution > base;
        if in_page
            && cut
                .root_resolution(ChartId(id))
                .is_none_or(|resolution| resolution > base)
        {
            pages.push(NeededPage {
                page,
                node: root,
                parent: None,
            });
        }
        stack.push((root, page, in_page.then_some(page)));
        while let Some((node, page, source)) = stack.pop() {
            if !cut.is_split(node) {
                continue;
            }
            let Some(first) = document.first_child(page) else {
                continue;
            };
            for (quadrant, child) in QUADRANTS.into_iter().zip(children(first)) {
                let node = node.child(quadrant);
                pages.push(NeededPage {
                    page: child,
                    node,
                    parent: source,
                });
                stack.push((node, child, Some(child)));
            }
        }
    }
    pages
}

/// The four pages from `first` on.
pub fn children(first: PageId) -> [PageId; 4] {
    [0, 1, 2, 3].map(|n| PageId(first.0.saturating_add(n)))
}
