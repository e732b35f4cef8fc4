//! Rule R6 for clusters: groups that are split and groups that are not take each other's place without a jump.
//!
//! The children of a group appear a step from where its members show their vertices (morph 1, [`target`](super::target)) and move towards their own
//! places (0), as far as the view wants ([`rest`](crate::lod::rest)); they give way once they are back. All children of a group move alike, and its outer border does not move. So two conditions
//! keep everything whole: children move only while none of their own groups is split, since the border between such a group
//! and other children lies within the surface that moves; and a group is split only while none of its members moves.
//!
//! Groups that are only passed by, since something finer or coarser is wanted, move faster.
//!
//! Whatever is on the way gets there: of the groups that are to be merged the lowest have no split group below them, and of those that
//! are to be split the highest have members that are wanted, whose morphs end at 0.

use super::descend;
use crate::lod::animate::Drawn;
use crate::lod::cut::Cut;
use crate::numbers::NumberSet;
use marquetry_format::{Bounds, ClusterGroup, ClusterGroupId, ClusterId, Clusters, Document};
use std::collections::BTreeMap;

/// Many levels at once do not take as many times as long.
const HASTE: f32 = 3.0;

/// How far the children of split groups are on their way to what their group's members show: 0 = own places, 1 = there. Absent = 0.
pub type GroupMorphs = BTreeMap<ClusterGroupId, f32>;

/// The morph of a cluster: that of the group that it is a child of.
pub fn morph_of(clusters: &Clusters, morphs: &GroupMorphs, id: ClusterId) -> f32 {
    above(clusters, id)
        .and_then(|group| morphs.get(&group))
        .copied()
        .unwrap_or(0.0)
}

/// Holds a cluster wherever it is on its way: the bounds of all members of the group that it is a child of, each of which holds the
/// children. `None` for the root.
pub fn bounds(clusters: &Clusters, id: ClusterId) -> Option<Bounds> {
    let members = &clusters.group(above(clusters, id)?)?.members;
    let bounds = members
        .iter()
        .map(|&id| clusters.node(id).map(|node| node.bounds));
    bounds.flatten().reduce(|a, b| Bounds {
        min: [0, 1, 2].map(|axis: usize| a.min[axis].min(b.min[axis])),
        max: [0, 1, 2].map(|axis: usize| a.max[axis].max(b.max[axis])),
    })
}

/// The group that a cluster is a child of; `None` for the root.
pub(super) fn above(clusters: &Clusters, id: ClusterId) -> Option<ClusterGroupId> {
    clusters.node(clusters.node(id)?.parent?)?.group
}

/// Moves the clusters of `drawn` towards those of `target`, every morph by at most `step` of its group (above 0; 1 is the whole way).
/// Whether others are drawn than before.
pub fn advance(
    document: &Document,
    drawn: &mut Drawn,
    target: &Drawn,
    step: impl Fn(&ClusterGroup) -> f32,
) -> bool {
    let Some(clusters) = &document.clusters else {
        return false;
    };
    let (cut, morphs) = (&mut drawn.cut, &mut drawn.group_morphs);
    let at_rest = |id| target.group_morphs.get(&id).copied().unwrap_or(0.0);
    let target = &target.cut;
    let mut changes = false;
    for id in split_groups(clusters, cut) {
        let Some(group) = clusters.group(id) else {
            continue;
        };
        let children = || group.children.clone().map(ClusterId);
        let is_kept = target.is_group_split(group);
        let is_fixed = children().any(|child| cut.is_cluster_split(child));
        let goal = match (is_fixed, is_kept) {
            (true, _) => 0.0,
            (false, true) => at_rest(id),
            (false, false) => 1.0,
        };
        let before = morphs.get(&id).copied().unwrap_or(0.0);
        if before.total_cmp(&goal).is_eq() && goal < 1.0 {
            continue;
        }
        let step = step(group) * haste(clusters, group, target);
        let morph = towards(before, goal, step);
        if morph >= 1.0 && !is_kept {
            cut.merge_group(group);
            changes = true;
            morphs.remove(&id);
        } else if morph > 0.0 {
            morphs.insert(id, morph);
        } else {
            morphs.remove(&id);
        }
    }
    let mut refined = Vec::new();
    let splits = |group: &ClusterGroup| {
        let is_split = cut.is_group_split(group);
        let moves = |&id: &ClusterId| morph_of(clusters, morphs, id) > 0.0;
        if !is_split && target.is_group_split(group) && !group.members.iter().any(moves) {
            refined.push(group.clone());
        }
        is_split
    };
    descend(document, splits, |_, _, _| ());
    for group in refined {
        let first = group.members.first().and_then(|&id| clusters.node(id));
        if let Some(id) = first.and_then(|node| node.group) {
            cut.split_group(&group);
            changes = true;
            // Not at 1, where triangles lie on each other.
            let morph = towards(1.0, at_rest(id), step(&group));
            if morph > 0.0 {
                morphs.insert(id, morph);
            }
        }
    }
    changes
}

/// From `morph` to `goal`, by at most `step`.
pub(in crate::lod) fn towards(morph: f32, goal: f32, step: f32) -> f32 {
    if morph < goal {
        (morph + step).min(goal)
    } else {
        (morph - step).max(goal)
    }
}

/// How much faster a group moves that is only passed by on the way to `target`.
fn haste(clusters: &Clusters, group: &ClusterGroup, target: &Cut) -> f32 {
    let is_passed_by = if target.is_group_split(group) {
        let mut children = group.children.clone();
        children.any(|child| target.is_cluster_split(ClusterId(child)))
    } else {
        let above = group.members.iter().filter_map(|&id| above(clusters, id));
        let mut above = above.filter_map(|id| clusters.group(id));
        above.any(|above| !target.is_group_split(above))
    };
    if is_passed_by { HASTE } else { 1.0 }
}

/// The groups that `cut` splits, those below first.
pub(in crate::lod) fn split_groups(clusters: &Clusters, cut: &Cut) -> Vec<ClusterGroupId> {
    let nodes = cut.split_clusters();
    let groups: NumberSet = nodes
        .filter_map(|id| Some(clusters.node(id)?.group?.0))
        .collect();
    groups.iter().rev().map(ClusterGroupId).collect()
}

#[cfg(test)]
mod tests;
