//! Rule R1: along every shared border, inside a chart or across glue, resolutions differ by at most one.
//!
//! Von Herzen and Barr, "Accurate Triangulations of Deformed, Intersecting Surfaces", 1987 (restricted quadtrees).
//! Differs: sides of charts are glued in any of eight ways, and roots have resolutions of their own.
//! Two closures: [`refine`] gives the coarsest balanced cut that is nowhere coarser than asked, [`coarsen`] the finest
//! that is nowhere finer. Nodes that touch in a corner only are not constrained: corners are in every resolution.

use super::cut::{Cut, Leaf, SIDES, neighbour};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{Chart, Side};

/// Refines the coarser of two neighbours until all are balanced.
///
/// `refinable` says whether a leaf has anything finer. Where it says no, the border stays unbalanced: follow with [`coarsen`].
pub fn refine(cut: &mut Cut, charts: &[Chart], mut refinable: impl FnMut(Leaf) -> bool) {
    let mut pending = cut.leaves();
    while let Some(leaf) = pending.pop() {
        if !cut.contains(leaf) {
            continue;
        }
        for side in SIDES {
            while let Some(other) = coarser_by_more_than_one(cut, charts, leaf, side) {
                if !refinable(other) {
                    break;
                }
                cut.refine(other);
                cut.leaves_below(other.node, None, &mut pending);
            }
        }
    }
}

/// Coarsens the finer of two neighbours until all are balanced. Always ends with a balanced cut.
pub fn coarsen(cut: &mut Cut, charts: &[Chart]) {
    let mut pending = cut.leaves();
    while let Some(leaf) = pending.pop() {
        if !cut.contains(leaf) {
            continue;
        }
        let Some(other) = SIDES
            .iter()
            .find_map(|side| coarser_by_more_than_one(cut, charts, leaf, *side))
        else {
            continue;
        };
        let coarser = match leaf.node.parent() {
            None => {
                cut.set_root(leaf.node.chart, other.resolution + 1);
                Leaf {
                    resolution: other.resolution + 1,
                    ..leaf
                }
            }
            Some((parent, _)) => {
                cut.collapse(parent);
                Leaf {
                    node: parent,
                    resolution: PAGE_RESOLUTION + parent.level,
                }
            }
        };
        pending.push(coarser);
        for side in SIDES {
            if let Some((node, back)) = neighbour(charts, coarser.node, side) {
                match cut.leaf_over(node) {
                    Some(leaf) => pending.push(leaf),
                    None => cut.leaves_below(node, Some(back), &mut pending),
                }
            }
        }
    }
}

/// Whether rule R1 holds everywhere.
pub fn is_balanced(cut: &Cut, charts: &[Chart]) -> bool {
    cut.leaves().iter().all(|leaf| {
        SIDES
            .iter()
            .all(|side| coarser_by_more_than_one(cut, charts, *leaf, *side).is_none())
    })
}

fn coarser_by_more_than_one(cut: &Cut, charts: &[Chart], leaf: Leaf, side: Side) -> Option<Leaf> {
    let (node, _) = neighbour(charts, leaf.node, side)?;
    cut.leaf_over(node)
        .filter(|other| other.resolution + 1 < leaf.resolution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, cube_charts, random_cut, self_glued_charts};
    use marquetry_format::{ChartId, NodeId, Quadrant};

    /// Resolution over every cell of a fine grid of each chart.
    fn resolutions(cut: &Cut) -> Vec<u8> {
        let charts = u32::try_from(cut.chart_count()).unwrap();
        let nodes = (0..charts).flat_map(|chart| {
            (0..256).map(move |n| NodeId {
                chart: ChartId(chart),
                level: 4,
                x: n % 16,
                y: n / 16,
            })
        });
        nodes
            .map(|node| cut.leaf_over(node).unwrap().resolution)
            .collect()
    }

    #[test]
    fn closures_balance_and_bracket_the_cut() {
        let mut random = Random::new(7);
        for charts in [cube_charts(5), self_glued_charts(5)] {
            for _ in 0..60 {
                let cut = random_cut(&mut random, &charts, 3);
                let (mut finer, mut coarser) = (cut.clone(), cut.clone());
                refine(&mut finer, &charts, |_| true);
                coarsen(&mut coarser, &charts);
                assert!(is_balanced(&finer, &charts) && is_balanced(&coarser, &charts));
                let (low, middle, high) = (
                    resolutions(&coarser),
                    resolutions(&cut),
                    resolutions(&finer),
                );
                assert!(low.iter().zip(&middle).all(|(a, b)| a <= b));
                assert!(middle.iter().zip(&high).all(|(a, b)| a <= b));
            }
        }
    }

    #[test]
    fn one_deep_node_pulls_its_neighbours_along_across_glue() {
        let charts = cube_charts(5);
        let mut cut = Cut::coarsest(6);
        let root = NodeId::root(ChartId(0));
        cut.split(root);
        cut.split(root.child(Quadrant(0)));
        refine(&mut cut, &charts, |_| true);
        assert!(is_balanced(&cut, &charts));
        assert!((1..6).all(|chart| cut.root_resolution(ChartId(chart)) != Some(0)));
    }

    #[test]
    fn coarsening_is_the_way_out_where_nothing_can_be_refined() {
        let charts = cube_charts(5);
        let mut cut = Cut::coarsest(6);
        cut.split(NodeId::root(ChartId(4)));
        refine(&mut cut, &charts, |_| false);
        assert!(!is_balanced(&cut, &charts));
        coarsen(&mut cut, &charts);
        assert!(is_balanced(&cut, &charts));
        assert_eq!(cut.root_resolution(ChartId(4)), Some(1));
    }
}
