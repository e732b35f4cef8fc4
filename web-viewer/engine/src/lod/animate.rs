//! Rule R6: what is drawn moves towards the target cut in steps that do not pop.
//!
//! A finer surface appears with morph 1, which is exactly the coarser one, and moves towards 0, as far as the view wants
//! ([`rest`](super::rest)); a coarser one replaces a finer when that is at 1. Two conditions keep both sides of every border in step: a leaf gets finer only while it and its
//! neighbours of the same resolution are at 0, and starts towards coarser only while no neighbour is finer. Together with
//! a balanced target every step that is needed becomes possible: the coarsest leaf that must be refined and the finest that
//! must be merged are never blocked for longer than one morph.
//!
//! Limit: beside a coarser neighbour odd border samples sit on even ones, so when that neighbour is refined the row of
//! cells along the border changes shape at once, by less than the parent's error.

use super::cluster::morph::{self, GroupMorphs, towards};
use super::cut::{Across, Cut, Leaf, QUADRANTS, SIDES};
use super::edge_morph::{Morphs, morph_of};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{Chart, ClusterGroup, ClusterId, Clusters, Document};

/// What is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// The leaves; balanced.
    pub cut: Cut,
    /// Their morphs.
    pub morphs: Morphs,
    /// Those of the children of split groups of clusters.
    pub group_morphs: GroupMorphs,
}

impl Drawn {
    /// Draws `cut`, all of it at its own place.
    pub fn of(cut: Cut) -> Self {
        Self {
            cut,
            morphs: Morphs::new(),
            group_morphs: GroupMorphs::new(),
        }
    }

    /// The morph of a cluster that is drawn.
    pub fn cluster_morph(&self, clusters: &Clusters, id: ClusterId) -> f32 {
        morph::morph_of(clusters, &self.group_morphs, id)
    }

    /// Moves the charts towards `target`, which is balanced and moves nothing beside what is finer, by at most `step` in every morph
    /// (0 < `step`; 1 is the whole way). Whether another cut is drawn than before.
    pub fn advance(&mut self, target: &Self, charts: &[Chart], step: f32) -> bool {
        let (target, at_rest) = (&target.cut, &target.morphs);
        let mut changes = false;
        let leaves = self.cut.leaves();
        let mut merging = Vec::new();
        for leaf in &leaves {
            let merges = self.may_merge(target, charts, *leaf);
            let goal = if merges {
                1.0
            } else if target.contains(*leaf) && !self.cut.is_beside_finer(charts, *leaf) {
                morph_of(at_rest, *leaf)
            } else {
                0.0
            };
            let morph = towards(morph_of(&self.morphs, *leaf), goal, step);
            if morph > 0.0 {
                self.morphs.insert(leaf.node, morph);
            } else {
                self.morphs.remove(&leaf.node);
            }
            if merges && morph >= 1.0 {
                merging.push(*leaf);
            }
        }
        for leaf in merging {
            changes |= self.merge(charts, leaf);
        }
        for leaf in leaves {
            if self.may_refine(target, charts, leaf) {
                self.cut.refine(leaf);
                changes = true;
                let mut finer = Vec::new();
                self.cut.leaves_below(leaf.node, None, &mut finer);
                self.morphs
                    .extend(finer.into_iter().map(|leaf| (leaf.node, 1.0)));
            }
        }
        changes
    }

    /// Moves the clusters towards `target`, every group by its `step`; see [`morph::advance`]. Whether other ones are drawn than before.
    pub fn advance_clusters(
        &mut self,
        target: &Self,
        document: &Document,
        step: impl Fn(&ClusterGroup) -> f32,
    ) -> bool {
        morph::advance(document, self, target, step)
    }

    /// Whether `leaf` and those that merge with it want to, and no finer neighbour is in the way.
    fn may_merge(&self, target: &Cut, charts: &[Chart], leaf: Leaf) -> bool {
        if !wants_coarser(target, leaf) {
            return false;
        }
        merge_group(leaf).iter().flatten().all(|sibling| {
            self.cut.contains(*sibling) && !self.cut.is_beside_finer(charts, *sibling)
        })
    }

    /// Replaces `leaf` and its siblings by the coarser surface that they all show; not while one is still on its way. Whether it did.
    fn merge(&mut self, charts: &[Chart], leaf: Leaf) -> bool {
        let group = merge_group(leaf);
        let ready = group.iter().flatten().all(|sibling| {
            self.cut.contains(*sibling)
                && morph_of(&self.morphs, *sibling) >= 1.0
                && !self.cut.is_beside_finer(charts, *sibling)
        });
        if !ready {
            return false;
        }
        for sibling in group.iter().flatten() {
            self.morphs.remove(&sibling.node);
        }
        match leaf.node.parent() {
            None => self.cut.set_root(leaf.node.chart, leaf.resolution - 1),
            Some((parent, _)) => self.cut.collapse(parent),
        }
        true
    }

    fn may_refine(&self, target: &Cut, charts: &[Chart], leaf: Leaf) -> bool {
        wants_finer(target, leaf)
            && self.cut.contains(leaf)
            && morph_of(&self.morphs, leaf) == 0.0
            && SIDES
                .iter()
                .all(|side| match self.cut.across(charts, leaf, *side) {
                    Across::Open | Across::Finer => true,
                    Across::Equal(other) => morph_of(&self.morphs, other) == 0.0,
                    Across::Coarser(_) => false,
                })
    }
}

/// The leaves that give way together with `leaf`: itself for a root, else its parent's four children.
fn merge_group(leaf: Leaf) -> [Option<Leaf>; 4] {
    match leaf.node.parent() {
        None => [Some(leaf), None, None, None],
        Some((parent, _)) => QUADRANTS.map(|quadrant| {
            Some(Leaf {
                node: parent.child(quadrant),
                ..leaf
            })
        }),
    }
}

fn wants_coarser(target: &Cut, leaf: Leaf) -> bool {
    match leaf.node.parent() {
        None => target
            .root_resolution(leaf.node.chart)
            .is_some_and(|resolution| resolution < leaf.resolution),
        Some((parent, _)) => !target.is_split(parent),
    }
}

fn wants_finer(target: &Cut, leaf: Leaf) -> bool {
    if leaf.node.level == 0 && leaf.resolution < PAGE_RESOLUTION {
        target
            .root_resolution(leaf.node.chart)
            .is_none_or(|resolution| resolution > leaf.resolution)
    } else {
        target.is_split(leaf.node)
    }
}

/// Nodes of `morphs` that are not leaves of `cut`: none, unless there is a mistake here.
#[cfg(test)]
fn stray(drawn: &Drawn) -> Vec<marquetry_format::NodeId> {
    drawn
        .morphs
        .keys()
        .copied()
        .filter(|node| {
            drawn
                .cut
                .leaf_over(*node)
                .is_none_or(|leaf| leaf.node != *node)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::balance;
    use crate::testing::{Random, cube_charts, random_cut, random_rest, self_glued_charts};

    fn balanced(random: &mut Random, charts: &[Chart]) -> Drawn {
        let mut cut = random_cut(random, charts, 3);
        balance::coarsen(&mut cut, charts);
        random_rest(random, charts, cut)
    }

    fn check(drawn: &Drawn, charts: &[Chart]) {
        assert!(balance::is_balanced(&drawn.cut, charts));
        assert!(stray(drawn).is_empty());
        for leaf in drawn.cut.leaves() {
            let finer = drawn.cut.is_beside_finer(charts, leaf);
            assert!(
                !finer || morph_of(&drawn.morphs, leaf) == 0.0,
                "a leaf beside a finer one moves"
            );
        }
    }

    #[test]
    fn drawn_cut_reaches_its_target_through_balanced_steps() {
        let mut random = Random::new(11);
        for charts in [cube_charts(5), self_glued_charts(5)] {
            let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
            for _ in 0..40 {
                let target = balanced(&mut random, &charts);
                let mut steps = 0;
                while drawn != target {
                    drawn.advance(&target, &charts, 0.3);
                    check(&drawn, &charts);
                    steps += 1;
                    assert!(steps < 400, "stuck");
                }
            }
        }
    }

    #[test]
    fn targets_that_change_on_the_way_do_no_harm() {
        let mut random = Random::new(12);
        let charts = cube_charts(5);
        let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
        for _ in 0..300 {
            let target = balanced(&mut random, &charts);
            for _ in 0..random.below(6) {
                drawn.advance(&target, &charts, 0.4);
                check(&drawn, &charts);
            }
        }
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "exact by construction")]
    fn refinement_appears_at_morph_one_and_ends_at_zero() {
        let charts = cube_charts(5);
        let mut drawn = Drawn::of(Cut::coarsest(6));
        let mut target = Cut::coarsest(6);
        for chart in 0..6 {
            target.set_root(marquetry_format::ChartId(chart), 1);
        }
        let target = Drawn::of(target);
        drawn.advance(&target, &charts, 0.25);
        // Each chart was refined once its neighbours were: those still at 0 cells beside a moving one need not wait.
        assert!(drawn.morphs.values().all(|morph| *morph == 1.0) && !drawn.morphs.is_empty());
        for _ in 0..20 {
            drawn.advance(&target, &charts, 0.25);
        }
        assert_eq!(drawn, target);
    }
}
