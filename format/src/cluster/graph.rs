//! What is drawn in place of what: nodes of the cluster layer, and the groups that are replaced together.
//!
//! After Karis, Stubbe & Wihlidal, "A Deep Dive into Nanite Virtualized Geometry", SIGGRAPH 2021, and Yoon, Salomon,
//! Gayle & Manocha, "Quick-VDR", 2004: members of a group may be children of different groups, so borders that are held
//! between groups of one level lie within groups of another. A tree is the case of groups of one member.
//! Every step is proportional to the nodes: children are held against what all members of a group have in common, not
//! against each of them.

use super::directory::{Facts, at, holds, texel_from_code};
use super::{
    ClusterGroup, ClusterGroupId, ClusterId, ClusterNode, MAX_CLUSTER_LEVELS, MAX_CLUSTER_VERTICES,
};
use crate::index::quantize::error_from_code;
use crate::{Bounds, Error};

/// The number of children that says: this node joins a group that an earlier one began.
pub(crate) const JOINS: u16 = 1;

/// What the children of a group must keep to.
struct Above {
    /// The greatest of its members.
    level: u8,
    /// As coded, of all its members.
    error: u16,
    /// What lies in the bounds of every member; its minimum may be above its maximum.
    bounds: Bounds,
}

fn refuse<T>(what: &'static str, found: u32) -> Result<T, Error> {
    Err(Error::Value {
        what,
        found: u64::from(found),
    })
}

/// Nodes without their ranges, and their groups; refuses what has no order, or is not in it. `checksums`: four bytes a node.
pub(super) fn graph(
    facts: &[Facts],
    checksums: &[u8],
) -> Result<(Vec<ClusterNode>, Vec<ClusterGroup>), Error> {
    let count = u32::try_from(facts.len()).unwrap_or(u32::MAX);
    let (mut groups, group_of) = groups(facts)?;
    let mut above: Vec<Option<Above>> = groups.iter().map(|_| None).collect();
    // By node that has its number, the group that it is a child of.
    let mut places: Vec<Option<usize>> = vec![None];
    let mut nodes: Vec<ClusterNode> = Vec::with_capacity(facts.len());
    let mut next = 1u32;
    let mut sums = checksums.chunks_exact(4);
    for ((index, facts), group) in (0u32..).zip(facts).zip(&group_of) {
        let Some(place) = places.get(at(index)).copied() else {
            return refuse("cluster without a parent", index);
        };
        let mut node = node(index, facts, sums.next())?;
        if let Some(place) = place {
            let over = above.get(place).and_then(Option::as_ref);
            node.level = below(over, &node, index)?;
            let members = groups.get(place).map(|group| group.members.as_slice());
            node.parent = members.and_then(|members| members.first().copied());
        }
        if let Some(own) = *group {
            node.group = u32::try_from(own).ok().map(ClusterGroupId);
            let (Some(group), Some(above)) = (groups.get_mut(own), above.get_mut(own)) else {
                return refuse("group of a cluster", index);
            };
            meet(above, facts, &node, index)?;
            // The first member says how many children there are, the last one's place which these are.
            if facts.children != JOINS {
                group.children.end = u32::from(facts.children);
            }
            if group.members.last() == Some(&ClusterId(index)) {
                let end = next.saturating_add(group.children.end);
                if end > count {
                    return refuse("children of a cluster", group.children.end);
                }
                group.children = next..end;
                places.resize(at(end), Some(own));
                next = end;
            }
        }
        nodes.push(node);
    }
    if next != count {
        return Err(Error::Mismatch {
            what: "clusters",
            expected: u64::from(count),
            found: u64::from(next),
        });
    }
    for (node, group) in nodes.iter_mut().zip(group_of) {
        if let Some(group) = group.and_then(|group| groups.get(group)) {
            node.children = group.children.clone();
        }
    }
    for group in &mut groups {
        group.is_nearer = !is_repeated(group, &nodes);
    }
    Ok((nodes, groups))
}

/// Whether the children are as many triangles as the members, all of them leaves, and one is no nearer to the source.
fn is_repeated(group: &ClusterGroup, nodes: &[ClusterNode]) -> bool {
    let node = |id: u32| nodes.get(at(id));
    let members = || group.members.iter().filter_map(|id| node(id.0));
    let children = || group.children.clone().filter_map(node);
    let triangles = |sum: u32, node: &ClusterNode| sum.saturating_add(u32::from(node.triangles));
    let Some(first) = members().next() else {
        return false;
    };
    children().all(|child| child.children.is_empty())
        && children().any(|child| child.error >= first.error)
        && children().fold(0, triangles) == members().fold(0, triangles)
}

/// The groups, in the order of their first members, without their children; and the place of each node's own among them.
fn groups(facts: &[Facts]) -> Result<(Vec<ClusterGroup>, Vec<Option<usize>>), Error> {
    let mut groups: Vec<ClusterGroup> = Vec::new();
    let mut group_of = Vec::with_capacity(facts.len());
    for (index, facts) in (0u32..).zip(facts) {
        if facts.back != 0 && facts.children != JOINS {
            return refuse("group of a cluster", facts.back);
        }
        let place = match facts.children {
            0 => None,
            JOINS => {
                let place = groups
                    .len()
                    .checked_sub(1)
                    .and_then(|last| last.checked_sub(at(facts.back)));
                let Some(place) = place else {
                    return refuse("group of a cluster", facts.back);
                };
                Some(place)
            }
            _ => {
                groups.push(ClusterGroup {
                    members: Vec::new(),
                    children: 0..0,
                    is_nearer: true,
                });
                groups.len().checked_sub(1)
            }
        };
        if let Some(group) = place.and_then(|place| groups.get_mut(place)) {
            group.members.push(ClusterId(index));
        }
        group_of.push(place);
    }
    Ok((groups, group_of))
}

/// The node of these facts, as if it were the root and a leaf.
fn node(index: u32, facts: &Facts, checksum: Option<&[u8]>) -> Result<ClusterNode, Error> {
    let Some(bounds) = facts.bounds.bounds() else {
        return refuse("bounds of a cluster", index);
    };
    let vertices = u16::from(facts.vertices).saturating_add(1);
    if vertices < 3 || usize::from(vertices) > MAX_CLUSTER_VERTICES {
        return refuse("vertices of a cluster", u32::from(vertices));
    }
    Ok(ClusterNode {
        parent: None,
        group: None,
        children: 0..0,
        level: 0,
        vertices,
        triangles: u16::from(facts.triangles).saturating_add(1),
        error: error_from_code(facts.error),
        texel: texel_from_code(facts.texel),
        bounds,
        range: 0..0,
        checksum: checksum
            .and_then(|sum| sum.first_chunk::<4>())
            .map_or(0, |sum| u32::from_le_bytes(*sum)),
    })
}

/// The level of `node`, a child of a group that is as `over` says.
fn below(over: Option<&Above>, node: &ClusterNode, index: u32) -> Result<u8, Error> {
    let Some(over) = over else {
        return refuse("cluster without a parent", index);
    };
    let level = over.level.saturating_add(1);
    if level >= MAX_CLUSTER_LEVELS {
        return refuse("level of a cluster", u32::from(level));
    }
    if node.error > error_from_code(over.error) {
        return refuse("cluster whose error is above its parent's", index);
    }
    if !holds(&over.bounds, &node.bounds.min) || !holds(&over.bounds, &node.bounds.max) {
        return refuse("cluster whose bounds leave its parent's", index);
    }
    Ok(level)
}

/// Counts `node`, of these facts, among the members of a group.
fn meet(
    above: &mut Option<Above>,
    facts: &Facts,
    node: &ClusterNode,
    index: u32,
) -> Result<(), Error> {
    let Some(above) = above else {
        *above = Some(Above {
            level: node.level,
            error: facts.error,
            bounds: node.bounds,
        });
        return Ok(());
    };
    if above.error != facts.error {
        return refuse("cluster whose error is not its group's", index);
    }
    above.level = above.level.max(node.level);
    above.bounds = above.bounds.common(&node.bounds);
    Ok(())
}

#[cfg(test)]
#[allow(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "small numbers, and a panic fails the test"
)]
mod tests {
    use super::*;
    use crate::index::quantize::BoundsCode;
    use proptest::prelude::*;
    use std::ops::Range;

    fn facts(children: u16, back: u32) -> Facts {
        Facts {
            children,
            back,
            length: 1,
            vertices: 2,
            triangles: 0,
            error: 5,
            bounds: BoundsCode {
                shift: 0,
                min: [0; 3],
                size: [9; 3],
            },
            texel: 0,
        }
    }

    /// The groups by the words of the specification, or nothing where it has none.
    fn naive(links: &[(u16, u32)]) -> Option<Vec<(Vec<u32>, Range<u32>)>> {
        let mut groups: Vec<(Vec<u32>, u32)> = Vec::new();
        for (node, &(children, back)) in (0u32..).zip(links) {
            match (children, back) {
                (0, 0) => {}
                (1, _) => {
                    let after = usize::try_from(back).ok()? + 1;
                    let place = groups.len().checked_sub(after)?;
                    groups[place].0.push(node);
                }
                (_, 0) => groups.push((vec![node], u32::from(children))),
                _ => return None,
            }
        }
        let mut order: Vec<usize> = (0..groups.len()).collect();
        order.sort_by_key(|&group| groups[group].0.last().copied());
        let mut taken = vec![0..0; groups.len()];
        let mut next = 1;
        for group in order {
            let (members, count) = &groups[group];
            // When the last member's turn comes it has its number.
            if members.last()? >= &next {
                return None;
            }
            taken[group] = next..next + count;
            next += count;
        }
        let is_whole = usize::try_from(next).ok()? == links.len();
        is_whole.then(|| groups.into_iter().map(|group| group.0).zip(taken).collect())
    }

    /// Mostly links that fit: as many children as there are nodes.
    fn links() -> impl Strategy<Value = Vec<(u16, u32)>> {
        let link = prop_oneof![
            4 => Just((0u16, 0u32)),
            3 => (2u16..4).prop_map(|children| (children, 0)),
            2 => (0u32..3).prop_map(|back| (1, back)),
            1 => (0u16..4, 0u32..2),
        ];
        (prop::collection::vec(link, 1..14), 0..3usize).prop_map(|(mut links, more)| {
            let children = links.iter().map(|link| usize::from(link.0));
            let needed = 1 + children.filter(|&children| children > 1).sum::<usize>();
            links.resize(needed.max(links.len()) + more / 2, (0, 0));
            links
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn groups_are_those_of_the_specification(links in links()) {
            let all: Vec<Facts> = links.iter().map(|&(children, back)| facts(children, back)).collect();
            let read = graph(&all, &vec![0; 4 * all.len()]).ok();
            let expected = naive(&links);
            prop_assert_eq!(read.is_some(), expected.is_some());
            if let (Some((nodes, groups)), Some(expected)) = (read, expected) {
                for (group, (members, children)) in groups.iter().zip(&expected) {
                    prop_assert!(group.members.iter().map(|id| id.0).eq(members.iter().copied()));
                    prop_assert_eq!(&group.children, children);
                    let level = group.members.iter().map(|id| nodes[at(id.0)].level).max();
                    for child in children.clone() {
                        let child = &nodes[at(child)];
                        prop_assert_eq!(Some(child.level), level.map(|level| level + 1));
                        prop_assert_eq!(child.parent, group.members.first().copied());
                    }
                }
                prop_assert_eq!(groups.len(), expected.len());
                prop_assert!(nodes.is_sorted_by_key(|node| node.level));
            }
        }
    }
}
