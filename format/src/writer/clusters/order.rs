//! The order of clusters in a file: level by level, the children of a group when all of its members have their numbers.
//!
//! Kahn, "Topological sorting of large networks", 1962. Of a tree, whose groups have one member each, it is the order level
//! by level. Checks all rules between nodes; every step is proportional to the lists of children given.

use super::super::ClusterInput;
use super::refuse;
use crate::cluster::graph::JOINS;
use crate::cluster::{MAX_CLUSTER_CHILDREN, MAX_CLUSTER_LEVELS};
use crate::{Error, Limits};
use std::ops::Range;

/// Nodes with the same children; all numbers are places in the file.
pub(super) struct Group {
    /// In ascending order.
    pub(super) members: Vec<usize>,
    pub(super) children: Range<usize>,
}

/// Clusters in the order of the file.
pub(super) struct Order {
    /// By place in the file, the place in the input.
    pub(super) places: Vec<usize>,
    /// In the order of their last members.
    pub(super) groups: Vec<Group>,
}

/// What the file says of a node's group.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Link {
    /// Of a group that the node begins; [`JOINS`] where it joins one; 0 for a leaf.
    pub(super) children: u16,
    /// Groups begun after the one that it joins.
    pub(super) back: u32,
}

/// Nodes with the same children; all numbers are places in the input.
struct Family<'a> {
    members: Vec<usize>,
    children: &'a [u32],
}

impl Order {
    /// Of `inputs`, of which there is at least one.
    pub(super) fn new(inputs: &[ClusterInput]) -> Result<Self, Error> {
        if inputs.len() > Limits::default().clusters as usize {
            return refuse(
                "there are not too many clusters",
                format!("{} clusters", inputs.len()),
            );
        }
        let (families, family_of) = families(inputs)?;
        let mut missing: Vec<usize> = families.iter().map(|f| f.members.len()).collect();
        let mut places = vec![0];
        let mut levels = vec![0];
        let mut groups = Vec::new();
        let mut members: Vec<Vec<usize>> = families.iter().map(|_| Vec::new()).collect();
        let mut next = 0;
        while next < places.len() {
            if let Some(family) = family_of[places[next]] {
                members[family].push(next);
                missing[family] -= 1;
                if missing[family] == 0 {
                    // Levels never fall from a place to the next, so the last member's is the greatest.
                    let level = levels[next] + 1;
                    if level >= usize::from(MAX_CLUSTER_LEVELS) {
                        return refuse(
                            "clusters are in at most 32 levels",
                            format!("cluster {} has children at level {level}", places[next]),
                        );
                    }
                    let start = places.len();
                    places.extend(families[family].children.iter().map(|&c| c as usize));
                    levels.resize(places.len(), level);
                    groups.push(Group {
                        members: std::mem::take(&mut members[family]),
                        children: start..places.len(),
                    });
                }
            }
            next += 1;
        }
        if places.len() < inputs.len() {
            let [below, all] = [places.len(), inputs.len()].map(|count| count - 1);
            return refuse(
                "no cluster is below itself",
                format!("{below} of {all} are below the root"),
            );
        }
        Ok(Self { places, groups })
    }

    /// What the file says of the group of each node.
    pub(super) fn links(&self) -> Vec<Link> {
        let mut group_of = vec![None; self.places.len()];
        for (index, group) in self.groups.iter().enumerate() {
            for &member in &group.members {
                group_of[member] = Some(index);
            }
        }
        let mut numbers = vec![None; self.groups.len()];
        let mut begun = 0u32;
        let link = |group: Option<usize>| {
            let Some(group) = group else {
                return Link::default();
            };
            if let Some(number) = numbers[group] {
                return Link {
                    children: JOINS,
                    back: begun - 1 - number,
                };
            }
            numbers[group] = Some(begun);
            begun += 1;
            Link {
                children: self.groups[group].children.len() as u16,
                back: 0,
            }
        };
        group_of.into_iter().map(link).collect()
    }
}

/// The lists of children with the nodes that have them, and the place of each node's own; every node but the root is in one.
fn families(inputs: &[ClusterInput]) -> Result<(Vec<Family<'_>>, Vec<Option<usize>>), Error> {
    let mut families: Vec<Family<'_>> = Vec::new();
    let mut family_of = vec![None; inputs.len()];
    // By node, the list that it is in.
    let mut listed: Vec<Option<usize>> = vec![None; inputs.len()];
    for (index, input) in inputs.iter().enumerate() {
        let children = &input.children;
        if children.len() == 1 || children.len() > MAX_CLUSTER_CHILDREN {
            return refuse(
                "a cluster has no child or 2 to 65 535",
                format!("cluster {index} has {}", children.len()),
            );
        }
        let Some(&first) = children.first() else {
            continue;
        };
        let known = listed.get(first as usize).copied().flatten();
        if let Some(family) = known.filter(|&known| families[known].children == children) {
            families[family].members.push(index);
            family_of[index] = Some(family);
            continue;
        }
        for &child in children {
            let Some(list) = listed.get_mut(child as usize).filter(|_| child != 0) else {
                return refuse(
                    "children are clusters of the file other than the root",
                    format!("cluster {index} names {child} of {}", inputs.len()),
                );
            };
            if list.is_some() {
                return refuse(
                    "the children of two clusters are the same, in the same order, or all different",
                    format!("cluster {index} names {child}, which is named elsewhere"),
                );
            }
            *list = Some(families.len());
        }
        family_of[index] = Some(families.len());
        families.push(Family {
            members: vec![index],
            children,
        });
    }
    if let Some(lost) = listed.iter().skip(1).position(Option::is_none) {
        return refuse(
            "every cluster but the root is a child",
            format!("cluster {} is not", lost + 1),
        );
    }
    for family in &families {
        check_errors(inputs, family)?;
    }
    Ok((families, family_of))
}

fn check_errors(inputs: &[ClusterInput], family: &Family<'_>) -> Result<(), Error> {
    let first = family.members[0];
    let error = inputs[first].error;
    for &member in &family.members {
        let other = inputs[member].error;
        if other.to_bits() != error.to_bits() {
            return refuse(
                "clusters with the same children have the same error",
                format!("cluster {first}: {error}, cluster {member}: {other}"),
            );
        }
    }
    for &child in family.children {
        let below = inputs[child as usize].error;
        if below > error {
            return refuse(
                "errors never grow on the way down",
                format!("cluster {child}: {below} below {error}"),
            );
        }
    }
    Ok(())
}
