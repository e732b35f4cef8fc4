//! The cluster layer's part of a cut: which nodes are drawn, in whole, in place of everything below them.
//!
//! After Yoon, Salomon, Gayle & Manocha, "Quick-VDR", 2004, and Karis, Stubbe & Wihlidal, "A Deep Dive into Nanite
//! Virtualized Geometry", SIGGRAPH 2021. The root is *reached*, and so are the children of groups that are split. A group may
//! be split where all of its members are reached; drawn is what is reached and whose group is not split. So everything is
//! drawn once. What two groups have in common is the same on both sides, whichever of them is split, so there is no crack,
//! no balance and no stitching. The root is always in memory, so there is always something to draw. Nanite asks every node by itself
//! whether it is drawn; here one goes down from the root, so that a cut may stop at what is not in memory, and the work is
//! that of what is reached.
//!
//! [`morph`] moves vertices from one group's surface to the next, towards places that [`target`] finds.
//!
//! Limit: a group that is too coarse waits for members that are not reached, whose own parents are fine enough. By their errors alone this cannot be:
//! parents' are as large, and so are their bounds, but for what members have beyond all of the children's. By the lengths of texels it can.

pub mod morph;
mod nearest;
pub mod target;

use super::animate::Drawn;
use super::cut::Cut;
use super::mesh::MeshBuilder;
use crate::EngineError;
use marquetry_format::{
    ByteSource, ClusterGroup, ClusterGroupId, ClusterId, ClusterMesh, ClusterNode, Document, PageId,
};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use target::{GroupSurface, Targets};

/// A page of a cluster that a cut needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NeededCluster {
    /// The page.
    pub page: PageId,
    /// The page of the first member of the group above; `None` below the root.
    pub parent: Option<PageId>,
    /// This first member, which is drawn, with the others, while this node is not there.
    pub above: ClusterId,
}

/// Goes down from the root. `splits` is asked of every group all of whose members are reached, in an order in which these come
/// before their children; `visit` gets every node that is reached, and whether its group is split.
pub(super) fn descend(
    document: &Document,
    mut splits: impl FnMut(&ClusterGroup) -> bool,
    mut visit: impl FnMut(ClusterId, &ClusterNode, bool),
) {
    let Some(clusters) = &document.clusters else {
        return;
    };
    let mut stack = vec![ClusterId(0)];
    // Members of groups of several that are reached, and by group how many.
    let (mut reached, mut counts) = (Vec::new(), vec![0u32; clusters.groups.len()]);
    while let Some(id) = stack.pop() {
        let Some(node) = clusters.node(id) else {
            continue;
        };
        let group = node.group.and_then(|id| Some((id, clusters.group(id)?)));
        let Some((group_id, group)) = group else {
            visit(id, node, false);
            continue;
        };
        if group.members.len() > 1 {
            reached.push((group_id, id));
            let count = &mut counts[group_id.0 as usize];
            *count += 1;
            if (*count as usize) < group.members.len() {
                continue;
            }
        }
        let is_split = splits(group);
        for &member in &group.members {
            if let Some(node) = clusters.node(member) {
                visit(member, node, is_split);
            }
        }
        if is_split {
            stack.extend(group.children.clone().rev().map(ClusterId));
        }
    }
    for (group_id, id) in reached {
        let count = counts[group_id.0 as usize] as usize;
        if let (Some(group), Some(node)) = (clusters.group(group_id), clusters.node(id))
            && count < group.members.len()
        {
            visit(id, node, false);
        }
    }
}

/// The nodes that `cut` draws.
fn walk(document: &Document, cut: &Cut, mut visit: impl FnMut(ClusterId, &ClusterNode)) {
    descend(
        document,
        |group| cut.is_group_split(group),
        |id, node, is_split| {
            if !is_split {
                visit(id, node);
            }
        },
    );
}

/// The nodes that `cut` draws.
pub fn drawn(document: &Document, cut: &Cut) -> Vec<ClusterId> {
    let mut drawn = Vec::new();
    walk(document, cut, |id, _| drawn.push(id));
    drawn
}

/// The pages that `cut` needs beyond the root, each once, all members of a group before its children.
pub fn needed(document: &Document, cut: &Cut) -> Vec<NeededCluster> {
    let mut needed = Vec::new();
    let splits = |group: &ClusterGroup| {
        let Some(&above) = group.members.first().filter(|_| cut.is_group_split(group)) else {
            return false;
        };
        let parent = document.page_of_cluster(above);
        let children = group.children.clone().map(ClusterId);
        needed.extend(
            children
                .filter_map(|child| document.page_of_cluster(child))
                .map(|page| NeededCluster {
                    page,
                    parent,
                    above,
                }),
        );
        true
    };
    descend(document, splits, |_, _, _| ());
    needed
}

/// Splits, from the root down, every group that may be split and has a member that is `too_coarse`, of which that is told its number, it, and how far off it is
/// where its children are nearer to the source, lattice units; else 0.
pub fn refine(
    document: &Document,
    cut: &mut Cut,
    mut too_coarse: impl FnMut(ClusterId, &ClusterNode, f32) -> bool,
) {
    refine_groups(document, cut, |group| {
        let mut members = group.members.iter();
        members.any(|&id| {
            let node = document.clusters.as_ref().and_then(|all| all.node(id));
            node.is_some_and(|node| too_coarse(id, node, error_over(group, node)))
        })
    });
}

/// How far off a member of a group is at most, lattice units; 0 where its children are no nearer to the source, and have finer images alone.
pub(super) fn error_over(group: &ClusterGroup, member: &ClusterNode) -> f32 {
    if group.is_nearer { member.error } else { 0.0 }
}

/// Splits, from the root down, every group that may be split and of which `splits` is true.
fn refine_groups(
    document: &Document,
    cut: &mut Cut,
    mut splits: impl FnMut(&ClusterGroup) -> bool,
) {
    let split = |group: &ClusterGroup| {
        let is_split = splits(group);
        if is_split {
            cut.split_group(group);
        }
        is_split
    };
    descend(document, split, |_, _, _| ());
}

/// The groups that `cut` draws and that may be split, but for those whose children are no nearer to the source; the coarsest first.
pub fn splittable<'d>(document: &'d Document, cut: &Cut) -> Vec<&'d ClusterGroup> {
    let Some(clusters) = &document.clusters else {
        return Vec::new();
    };
    let mut groups = Vec::new();
    let split = |group: &ClusterGroup| {
        let is_split = cut.is_group_split(group);
        if !is_split && group.is_nearer {
            groups.extend(group.members.first().copied());
        }
        is_split
    };
    descend(document, split, |_, _, _| ());
    let group_of = |first: ClusterId| clusters.group(clusters.node(first)?.group?);
    let error = |group: &ClusterGroup| {
        let members = group.members.iter().filter_map(|&id| clusters.node(id));
        members.map(|node| node.error).fold(0.0, f32::max)
    };
    let mut groups: Vec<&ClusterGroup> = groups.into_iter().filter_map(group_of).collect();
    groups.sort_by(|a, b| error(b).total_cmp(&error(a)));
    groups
}

/// Undoes every split of a group whose children are not all resident, and what is below it (rule R7).
pub fn restrict(document: &Document, cut: &mut Cut, mut resident: impl FnMut(PageId) -> bool) {
    let wanted = cut.clone();
    cut.collapse_clusters();
    refine_groups(document, cut, |group| {
        wanted.is_group_split(group)
            && group.children.clone().all(|child| {
                document
                    .page_of_cluster(ClusterId(child))
                    .is_some_and(&mut resident)
            })
    });
}

/// Triangles of the nodes that `cut` draws.
pub fn triangles(document: &Document, cut: &Cut) -> u64 {
    let mut sum = 0;
    walk(document, cut, |_, node| sum += u64::from(node.triangles));
    sum
}

/// Largest geometric error of the nodes that `cut` draws, lattice units.
pub fn error(document: &Document, cut: &Cut) -> f64 {
    let mut largest = 0.0f64;
    walk(document, cut, |_, node| {
        largest = largest.max(f64::from(node.error));
    });
    largest
}

/// Stored bytes of the pages that `cut` needs beyond the root.
pub fn bytes(document: &Document, cut: &Cut) -> u64 {
    needed(document, cut)
        .iter()
        .filter_map(|needed| document.page_range(needed.page))
        .map(|range| range.end - range.start)
        .sum()
}

/// Adds the clusters that are drawn to a mesh, where they are on their way.
///
/// # Errors
/// When a page cannot be read or is not valid.
pub fn append(
    document: &Document,
    source: &dyn ByteSource,
    drawn_now: &Drawn,
    builder: &mut MeshBuilder,
) -> Result<(), EngineError> {
    let Some(clusters) = &document.clusters else {
        return Ok(());
    };
    let mut surfaces: BTreeMap<ClusterGroupId, GroupSurface> = BTreeMap::new();
    for id in drawn(document, &drawn_now.cut) {
        let mesh = read(document, source, id)?;
        let morph = drawn_now.cluster_morph(clusters, id);
        let group = morph::above(clusters, id).filter(|_| morph > 0.0);
        let targets = match group.and_then(|id| Some((id, clusters.group(id)?))) {
            None => Targets::default(),
            Some((number, group)) => {
                let surface = match surfaces.entry(number) {
                    Entry::Occupied(known) => known.into_mut(),
                    Entry::Vacant(place) => {
                        let members = group.members.iter();
                        let members = members.map(|&id| read(document, source, id).map(Arc::new));
                        place.insert(GroupSurface::new(members.collect::<Result<_, _>>()?))
                    }
                };
                surface.targets(&mesh)
            }
        };
        builder
            .add_cluster(&mesh, &targets, morph)
            .ok_or(EngineError::IndexIncomplete(id.0))?;
    }
    Ok(())
}

/// The mesh of a cluster, from the file.
fn read(
    document: &Document,
    source: &dyn ByteSource,
    id: ClusterId,
) -> Result<ClusterMesh, EngineError> {
    let missing = EngineError::IndexIncomplete(id.0);
    let Some(page) = document.page_of_cluster(id) else {
        let clusters = document.clusters.as_ref();
        return clusters.map(|all| all.root.clone()).ok_or(missing);
    };
    let range = document.page_range(page).ok_or(missing)?;
    let bytes = source.read(range).map_err(marquetry_format::Error::from)?;
    Ok(document.decode_cluster(id, &bytes)?)
}

#[cfg(test)]
mod tests;
