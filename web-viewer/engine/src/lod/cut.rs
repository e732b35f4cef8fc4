//! A cut: for every chart either its root at one resolution, or nodes below the root that cover it exactly once.
//!
//! Resolutions are those of the whole chart: a leaf at level L > 0 is drawn with 32² cells, which is resolution 5 + L.
//! A chart that draws its root has one leaf; so every chart is always covered, whatever is in the cut.

use crate::numbers::NumberSet;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{Chart, ChartId, ClusterGroup, ClusterId, NodeId, Quadrant, Side};
use std::collections::BTreeSet;

/// The four sides of a node.
pub const SIDES: [Side; 4] = [Side(0), Side(1), Side(2), Side(3)];
/// The four quadrants of a node, in page order.
pub const QUADRANTS: [Quadrant; 4] = [Quadrant(0), Quadrant(1), Quadrant(2), Quadrant(3)];

/// A node that a cut draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Leaf {
    /// The node.
    pub node: NodeId,
    /// Resolution of the chart that it is drawn at: 0..=5 for a root, 5 + level below.
    pub resolution: u8,
}

impl Leaf {
    /// log2 of the cells a side that are drawn.
    pub fn grid_resolution(self) -> u8 {
        if self.node.level == 0 {
            self.resolution
        } else {
            PAGE_RESOLUTION
        }
    }

    /// Triangles drawn.
    pub fn triangles(self) -> u64 {
        2 << (2 * u64::from(self.grid_resolution()))
    }
}

/// What a leaf meets at one of its sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Across {
    /// Nothing: the border of the surface.
    Open,
    /// A leaf of a lower resolution.
    Coarser(Leaf),
    /// A leaf of the same resolution.
    Equal(Leaf),
    /// Leaves of a higher resolution.
    Finer,
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct ChartCut {
    /// Resolution of the root; 5 while the root is split, so that equal cuts compare equal.
    resolution: u8,
    /// Nodes whose four children take their place. Closed under taking the parent.
    split: BTreeSet<(u8, u32, u32)>,
}

/// What is drawn of every chart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    charts: Vec<ChartCut>,
    /// Clusters in whose place the children of their group are drawn: of a group all members or none. See
    /// [`cluster`](super::cluster).
    split_clusters: NumberSet,
}

impl Cut {
    /// Every chart at resolution 0: two triangles; and the root of the clusters.
    pub fn coarsest(charts: usize) -> Self {
        Self {
            charts: vec![ChartCut::default(); charts],
            split_clusters: NumberSet::default(),
        }
    }

    /// Whether the children of a cluster's group (or what is below them) are drawn in place of the group.
    pub fn is_cluster_split(&self, id: ClusterId) -> bool {
        self.split_clusters.contains(id.0)
    }

    /// Whether the children of a group of clusters (or what is below them) are drawn in its place.
    pub fn is_group_split(&self, group: &ClusterGroup) -> bool {
        let first = group.members.first();
        first.is_some_and(|first| self.is_cluster_split(*first))
    }

    /// Draws the children of a group of clusters in place of all its members, where all of these are reached.
    pub fn split_group(&mut self, group: &ClusterGroup) {
        let members = group.members.iter();
        self.split_clusters.extend(members.map(|member| member.0));
    }

    /// Draws a group of clusters in place of its children, none of which is split.
    pub fn merge_group(&mut self, group: &ClusterGroup) {
        for member in &group.members {
            self.split_clusters.remove(member.0);
        }
    }

    /// The clusters whose groups are split, ascending.
    pub fn split_clusters(&self) -> impl Iterator<Item = ClusterId> + '_ {
        self.split_clusters.iter().map(ClusterId)
    }

    /// Whether the charts are cut alike, and no group of clusters is split that `other` does not split.
    pub fn is_in(&self, other: &Self) -> bool {
        self.charts == other.charts && self.split_clusters.is_in(&other.split_clusters)
    }

    /// Draws the root of the clusters.
    pub fn collapse_clusters(&mut self) {
        self.split_clusters.clear();
    }

    /// Number of charts.
    pub fn chart_count(&self) -> usize {
        self.charts.len()
    }

    /// Whether the children of `node` (or their descendants) are drawn in its place.
    pub fn is_split(&self, node: NodeId) -> bool {
        self.chart(node.chart)
            .is_some_and(|chart| chart.split.contains(&key(node)))
    }

    /// Resolution of the root of `chart`, or `None` where it is split.
    pub fn root_resolution(&self, chart: ChartId) -> Option<u8> {
        self.chart(chart)
            .filter(|cut| cut.split.is_empty())
            .map(|cut| cut.resolution)
    }

    /// Draws the root of `chart`, at `resolution` (0..=5), in place of whatever was drawn of it.
    pub fn set_root(&mut self, chart: ChartId, resolution: u8) {
        if let Some(cut) = self.chart_mut(chart) {
            cut.split.clear();
            cut.resolution = resolution;
        }
    }

    /// Draws the children of `node` in its place; a no-op unless its parent is split (or it is a root).
    pub fn split(&mut self, node: NodeId) {
        if node
            .parent()
            .is_none_or(|(parent, _)| self.is_split(parent))
            && let Some(cut) = self.chart_mut(node.chart)
        {
            cut.resolution = PAGE_RESOLUTION;
            cut.split.insert(key(node));
        }
    }

    /// Draws `node` in place of all below it. A root is then at resolution 5.
    pub fn collapse(&mut self, node: NodeId) {
        let Some(cut) = self.chart_mut(node.chart) else {
            return;
        };
        if node.level == 0 {
            cut.split.clear();
            cut.resolution = PAGE_RESOLUTION;
            return;
        }
        cut.split.retain(|&(level, x, y)| {
            let Some(down) = level.checked_sub(node.level) else {
                return true;
            };
            x >> down != node.x || y >> down != node.y
        });
    }

    /// The next finer resolution of `leaf`: its root one up, or its four children.
    pub fn refine(&mut self, leaf: Leaf) {
        if leaf.node.level == 0 && leaf.resolution < PAGE_RESOLUTION {
            self.set_root(leaf.node.chart, leaf.resolution + 1);
        } else {
            self.split(leaf.node);
        }
    }

    /// The leaf that covers `node`; `None` where `node` itself is split (or its chart does not exist).
    pub fn leaf_over(&self, node: NodeId) -> Option<Leaf> {
        let cut = self.chart(node.chart)?;
        if cut.split.is_empty() {
            return Some(Leaf {
                node: NodeId::root(node.chart),
                resolution: cut.resolution,
            });
        }
        (0..=node.level)
            .map(|level| ancestor(node, level))
            .find(|over| !cut.split.contains(&key(*over)))
            .map(leaf_below)
    }

    /// Whether `leaf` is drawn.
    pub fn contains(&self, leaf: Leaf) -> bool {
        self.leaf_over(leaf.node) == Some(leaf)
    }

    /// All leaves: by chart, then quadrant by quadrant.
    pub fn leaves(&self) -> Vec<Leaf> {
        let mut leaves = Vec::with_capacity(self.charts.len());
        for chart in 0..self.charts.len() {
            let Ok(chart) = u32::try_from(chart) else {
                break;
            };
            self.leaves_below(NodeId::root(ChartId(chart)), None, &mut leaves);
        }
        leaves
    }

    /// Appends the leaves in `node`, or those of them that touch `side` of it. Nothing where a leaf above covers it.
    pub fn leaves_below(&self, node: NodeId, side: Option<Side>, leaves: &mut Vec<Leaf>) {
        let Some(cut) = self.chart(node.chart) else {
            return;
        };
        let mut stack = vec![node];
        while let Some(node) = stack.pop() {
            if cut.split.contains(&key(node)) {
                // Reversed, so that the first quadrant comes off the stack first.
                let inside = QUADRANTS
                    .iter()
                    .rev()
                    .filter(|quadrant| side.is_none_or(|side| touches(**quadrant, side)));
                stack.extend(inside.map(|quadrant| node.child(*quadrant)));
            } else if node.level > 0 {
                leaves.push(leaf_below(node));
            } else {
                leaves.push(Leaf {
                    node,
                    resolution: cut.resolution,
                });
            }
        }
    }

    /// Nodes whose children are drawn in their place, by chart, then level.
    pub fn split_nodes(&self) -> impl Iterator<Item = NodeId> {
        self.charts.iter().enumerate().flat_map(|(chart, cut)| {
            let chart = ChartId(u32::try_from(chart).unwrap_or(u32::MAX));
            cut.split
                .iter()
                .map(move |&(level, x, y)| NodeId { chart, level, x, y })
        })
    }

    /// What `leaf` meets at `side`.
    pub fn across(&self, charts: &[Chart], leaf: Leaf, side: Side) -> Across {
        let Some((neighbour, _)) = neighbour(charts, leaf.node, side) else {
            return Across::Open;
        };
        match self.leaf_over(neighbour) {
            Some(other) if other.resolution < leaf.resolution => Across::Coarser(other),
            Some(other) if other.resolution == leaf.resolution => Across::Equal(other),
            _ => Across::Finer,
        }
    }

    /// Whether `leaf` meets a finer one at any side.
    pub fn is_beside_finer(&self, charts: &[Chart], leaf: Leaf) -> bool {
        let mut sides = SIDES.iter();
        sides.any(|&side| self.across(charts, leaf, side) == Across::Finer)
    }

    /// Triangles drawn of the charts, those of zero area included.
    pub fn triangles(&self) -> u64 {
        self.leaves().iter().map(|leaf| leaf.triangles()).sum()
    }

    fn chart(&self, chart: ChartId) -> Option<&ChartCut> {
        self.charts.get(usize::try_from(chart.0).ok()?)
    }

    fn chart_mut(&mut self, chart: ChartId) -> Option<&mut ChartCut> {
        self.charts.get_mut(usize::try_from(chart.0).ok()?)
    }
}

/// The node of the same level across `side` of `node`, and its side that faces back; `None` at an open border.
pub fn neighbour(charts: &[Chart], node: NodeId, side: Side) -> Option<(NodeId, Side)> {
    let chart = charts.get(usize::try_from(node.chart.0).ok()?)?;
    node.neighbour(side, &chart.glue)
        .map(|(neighbour, back, _)| (neighbour, back))
}

/// The ancestor of `node` at `level`, which is at most its own.
pub fn ancestor(node: NodeId, level: u8) -> NodeId {
    let up = node.level - level;
    NodeId {
        level,
        x: node.x >> up,
        y: node.y >> up,
        ..node
    }
}

fn key(node: NodeId) -> (u8, u32, u32) {
    (node.level, node.x, node.y)
}

fn leaf_below(node: NodeId) -> Leaf {
    Leaf {
        node,
        resolution: PAGE_RESOLUTION + node.level,
    }
}

fn touches(quadrant: Quadrant, side: Side) -> bool {
    let (right, upper) = (quadrant.0 & 1 == 1, quadrant.0 & 2 == 2);
    match side.0 {
        0 => !upper,
        1 => right,
        2 => upper,
        _ => !right,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, cube_charts, random_cut};

    #[test]
    #[expect(clippy::float_cmp, reason = "exact by construction")]
    fn cut_covers_each_chart_once() {
        let mut random = Random::new(1);
        for _ in 0..50 {
            let cut = random_cut(&mut random, &cube_charts(5), 3);
            let mut area = [0.0f64; 6];
            for leaf in cut.leaves() {
                assert!(cut.contains(leaf));
                area[leaf.node.chart.0 as usize] += 0.25f64.powi(i32::from(leaf.node.level));
            }
            assert_eq!(area, [1.0; 6]);
        }
    }

    #[test]
    fn collapsing_undoes_everything_below() {
        let mut cut = Cut::coarsest(2);
        let root = NodeId::root(ChartId(1));
        let child = root.child(Quadrant(2));
        cut.split(root);
        let before = cut.clone();
        cut.split(child);
        cut.split(child.child(Quadrant(3)));
        assert_eq!(cut.leaves().len(), 1 + 3 + 3 + 4);
        cut.collapse(child);
        assert_eq!(cut, before);
        cut.collapse(root);
        assert_eq!(cut.root_resolution(ChartId(1)), Some(PAGE_RESOLUTION));
    }

    #[test]
    fn a_node_under_an_unsplit_parent_cannot_be_split() {
        let mut cut = Cut::coarsest(1);
        cut.split(NodeId::root(ChartId(0)).child(Quadrant(0)));
        assert_eq!(cut, Cut::coarsest(1));
    }

    #[test]
    fn charts_that_do_not_exist_are_ignored() {
        let mut cut = Cut::coarsest(0);
        cut.set_root(ChartId(3), 2);
        cut.split(NodeId::root(ChartId(3)));
        assert!(cut.leaves().is_empty());
        assert!(cut.leaf_over(NodeId::root(ChartId(0))).is_none());
    }

    #[test]
    fn across_is_mutual() {
        let mut random = Random::new(2);
        let charts = cube_charts(5);
        for _ in 0..30 {
            let cut = random_cut(&mut random, &charts, 2);
            for leaf in cut.leaves() {
                for side in SIDES {
                    let (node, back) = neighbour(&charts, leaf.node, side).unwrap();
                    match cut.across(&charts, leaf, side) {
                        Across::Equal(other) => {
                            assert_eq!(other.node, node);
                            assert_eq!(cut.across(&charts, other, back), Across::Equal(leaf));
                        }
                        Across::Coarser(other) => assert!(other.resolution < leaf.resolution),
                        Across::Finer => {
                            let mut finer = Vec::new();
                            cut.leaves_below(node, Some(back), &mut finer);
                            assert!(finer.iter().all(|other| other.resolution > leaf.resolution));
                        }
                        Across::Open => panic!("a cube has no border"),
                    }
                }
            }
        }
    }
}
