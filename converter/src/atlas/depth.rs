//! How deep every chart's quadtree goes, and the 2:1 balance of the stored trees.

use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, Glue, NodeId, Quadrant, Side};
use std::collections::BTreeSet;

/// The nodes that the file will hold.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Depth {
    /// Finest resolution of every chart's root, `0..=5`.
    pub roots: Vec<u8>,
    /// Nodes below the roots; siblings come together.
    pub nodes: BTreeSet<NodeId>,
}

impl Depth {
    /// Adds what 2:1 balance asks: along every shared border, inside charts and across `glue`, the finest resolutions
    /// differ by at most one.
    pub fn balance(&mut self, glue: &[[Option<Glue>; 4]]) {
        let mut queue: Vec<NodeId> = self.nodes.iter().copied().collect();
        queue.extend(
            (0u32..)
                .zip(&self.roots)
                .map(|(chart, _)| NodeId::root(ChartId(chart))),
        );
        while let Some(node) = queue.pop() {
            let sides = &glue[node.chart.0 as usize];
            for side in (0..4).map(Side) {
                let Some((beside, _, _)) = node.neighbour(side, sides) else {
                    continue;
                };
                if let Some((coarser, _)) = beside.parent() {
                    self.ensure(coarser, PAGE_RESOLUTION, &mut queue);
                } else {
                    let least = self.roots[node.chart.0 as usize].saturating_sub(1);
                    self.ensure(beside, least, &mut queue);
                }
            }
        }
    }

    /// Draws `node`, a leaf, finer by one resolution; balance is up to the caller.
    pub(super) fn refine(&mut self, node: NodeId) {
        let root = &mut self.roots[node.chart.0 as usize];
        if node.level == 0 && *root < PAGE_RESOLUTION {
            *root += 1;
        } else {
            self.nodes.extend((0..4).map(|q| node.child(Quadrant(q))));
        }
    }

    /// Makes sure that `node` exists, a root with at least `resolution`; queues what it changed.
    fn ensure(&mut self, node: NodeId, resolution: u8, queue: &mut Vec<NodeId>) {
        match node.parent() {
            None => {
                let root = &mut self.roots[node.chart.0 as usize];
                if *root < resolution {
                    *root = resolution;
                    queue.push(node);
                }
            }
            Some((parent, _)) => {
                if self.nodes.contains(&node) {
                    return;
                }
                self.ensure(parent, PAGE_RESOLUTION, queue);
                for child in (0..4).map(|q| parent.child(Quadrant(q))) {
                    self.nodes.insert(child);
                    queue.push(child);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(charts: u32) -> Vec<[Option<Glue>; 4]> {
        (0..charts)
            .map(|c| {
                let to = |chart: u32, side| {
                    Some(Glue {
                        chart: ChartId(chart),
                        side: Side(side),
                        reversed: true,
                    })
                };
                [
                    None,
                    if c + 1 < charts { to(c + 1, 3) } else { None },
                    None,
                    if c > 0 { to(c - 1, 1) } else { None },
                ]
            })
            .collect()
    }

    #[test]
    fn resolutions_fall_by_one_a_chart() {
        let mut depth = Depth {
            roots: vec![5, 1, 1, 1, 1, 1],
            nodes: BTreeSet::new(),
        };
        depth.balance(&strip(6));
        assert_eq!(depth.roots, [5, 4, 3, 2, 1, 1]);
    }

    #[test]
    fn a_deep_node_deepens_its_neighbours() {
        let mut depth = Depth {
            roots: vec![2, 5, 2],
            nodes: BTreeSet::new(),
        };
        let root = NodeId::root(ChartId(1));
        for q in (0..4).map(Quadrant) {
            depth.nodes.insert(root.child(q));
            depth.nodes.insert(root.child(Quadrant(0)).child(q));
        }
        depth.balance(&strip(3));
        // Level 2 at the left border asks for level 1 there; level 1 at the right for resolution 5.
        assert_eq!(depth.roots, [5, 5, 5]);
        assert_eq!(
            depth.nodes.iter().filter(|n| n.chart == ChartId(0)).count(),
            4
        );
        assert_eq!(
            depth.nodes.iter().filter(|n| n.chart == ChartId(2)).count(),
            0
        );
    }
}
