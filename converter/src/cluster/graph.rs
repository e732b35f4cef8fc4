//! Nodes of clusters and what replaces them: a graph without cycles, in which nodes with the same children are replaced together.

use super::became::Became;
use super::leaf::upwards;
use super::local::{self, Link};
use super::shape::Shape;
use marquetry_format::LatticePoint;
use marquetry_format::cluster::morph::{Places, UNRANKED};
use marquetry_format::writer::ClusterInput;
use std::collections::HashMap;

/// Nodes, children before what they replace.
#[derive(Debug, Default)]
pub(super) struct Graph {
    nodes: Vec<ClusterInput>,
    groups: Vec<Group>,
    /// By node a bound of each of its triangles, at most its error.
    local: Vec<Vec<f32>>,
}

/// Nodes of a component, and what replaces them.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) members: Vec<u32>,
    pub(super) children: Vec<u32>,
    /// Integral of the squared distance between them over the children's area, lattice units to the fourth power.
    pub(super) squares: f64,
    /// `None` where members have the triangles of the children, in their order.
    links: Option<Vec<Link>>,
}

/// What is known of a node, lattice units.
#[derive(Debug, Clone)]
pub(super) struct Known {
    /// At least the largest of the bounds.
    pub(super) error: f32,
    /// A bound of each of its triangles.
    pub(super) local: Vec<f32>,
}

/// How far a mesh is from those that it stands for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distance {
    /// Bound, lattice units.
    pub(super) bound: f64,
    /// As [`Group::squares`].
    pub(super) squares: f64,
}

impl Graph {
    /// The node numbered `id`.
    pub(super) fn node(&self, id: u32) -> &ClusterInput {
        &self.nodes[id as usize]
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// What replaces a node.
    pub(super) fn children(&self, id: usize) -> &[u32] {
        &self.nodes[id].children
    }

    /// Groups of components, those below first.
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Triangles of some nodes.
    pub(super) fn triangles(&self, nodes: &[u32]) -> usize {
        let of = |&id: &u32| self.node(id).mesh.triangles.len();
        nodes.iter().map(of).sum()
    }

    /// Adds a leaf; its number.
    pub(super) fn leaf(&mut self, shape: &Shape, error: f64, colours: bool) -> u32 {
        self.push(shape, upwards(error), Vec::new(), colours)
    }

    /// Adds a node that `children` replace, whose distance to them is at most `distance`, lattice units; its number.
    pub(super) fn above(
        &mut self,
        shape: &Shape,
        children: Vec<u32>,
        distance: f64,
        colours: bool,
    ) -> u32 {
        let error = upwards(f64::from(self.largest(&children)) + distance);
        self.push(shape, error, children, colours)
    }

    /// The largest error of some nodes.
    fn largest(&self, nodes: &[u32]) -> f32 {
        let errors = nodes.iter().map(|&id| self.node(id).error);
        errors.fold(0.0, f32::max)
    }

    /// Adds nodes that all together `children` replace, whose vertices `became` theirs; their numbers. `links` are as [`Group`] has them.
    pub(super) fn group(
        &mut self,
        shapes: &[Shape],
        children: &[u32],
        squares: f64,
        links: Option<Vec<Link>>,
        became: &Became,
        colours: bool,
    ) -> Vec<u32> {
        let add = |shape| self.push(shape, 0.0, children.to_vec(), colours);
        let members: Vec<u32> = shapes.iter().map(add).collect();
        let places = Places::of(members.iter().map(|&member| &self.node(member).mesh));
        for &child in children {
            let mesh = &mut self.nodes[child as usize].mesh;
            let rank = |&place: &LatticePoint| {
                let to = became.of(place);
                to.map_or(UNRANKED, |to| places.rank(place, to))
            };
            mesh.ranks = mesh.positions.iter().map(rank).collect();
        }
        let group = Group {
            members: members.clone(),
            children: children.to_vec(),
            squares,
            links,
        };
        self.add_up(&group);
        self.groups.push(group);
        members
    }

    /// States the errors of a group's members from what is known of its children's triangles.
    fn add_up(&mut self, group: &Group) {
        let local = |&child: &u32| self.local[child as usize].as_slice();
        let below = (group.children.iter().map(local)).collect::<Vec<_>>();
        let mut all = below.concat();
        if let Some(links) = &group.links {
            all = local::above(links, &all, self.triangles(&group.members));
        }
        let below = self.largest(&group.children);
        let error = all.iter().copied().fold(below, f32::max);
        let mut rest = all.as_slice();
        for &member in &group.members {
            let own;
            (own, rest) = rest.split_at(self.node(member).mesh.triangles.len());
            self.local[member as usize] = own.to_vec();
            self.nodes[member as usize].error = error;
        }
    }

    /// Replaces the errors of all nodes that are `shown` by those that follow from what is `known` of some, by node; something is of all leaves among them.
    pub(super) fn tighten(&mut self, shown: &[u32], known: Vec<Option<Known>>) {
        let groups = std::mem::take(&mut self.groups);
        let mut group_of: HashMap<u32, &Group> = HashMap::new();
        for group in &groups {
            group_of.extend(group.members.iter().map(|&member| (member, group)));
        }
        let steps: Vec<f64> = (self.nodes.iter())
            .map(|node| f64::from(node.error) - f64::from(self.largest(&node.children)))
            .collect();
        let mut is_shown = vec![false; self.nodes.len()];
        for &id in shown {
            is_shown[id as usize] = true;
        }
        for (id, known) in (0u32..).zip(known) {
            let number = id as usize;
            let Known { error, local } = match (known, group_of.get(&id)) {
                _ if !is_shown[number] => continue,
                (Some(known), _) => known,
                (None, Some(group)) => {
                    if group.members.first() == Some(&id) {
                        self.add_up(group);
                    }
                    continue;
                }
                (None, None) => {
                    let below = f64::from(self.largest(self.children(number)));
                    let error = upwards(below + steps[number]);
                    Known {
                        error,
                        local: vec![error; self.local[number].len()],
                    }
                }
            };
            self.nodes[number].error = error;
            self.local[number] = local;
        }
        self.groups = groups;
    }

    fn push(&mut self, shape: &Shape, error: f32, children: Vec<u32>, colours: bool) -> u32 {
        let id = id(self.nodes.len());
        self.local.push(vec![error; shape.triangles.len()]);
        self.nodes.push(ClusterInput {
            mesh: shape.cluster(colours),
            error,
            texel: None,
            children,
        });
        id
    }

    /// Adds all nodes of `other`, which has one; the number of its last.
    pub(super) fn append(&mut self, other: Self) -> u32 {
        let first = id(self.nodes.len());
        self.local.extend(other.local);
        let moved = |ids: &mut Vec<u32>| ids.iter_mut().for_each(|id| *id += first);
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            moved(&mut node.children);
            node
        }));
        self.groups
            .extend(other.groups.into_iter().map(|mut group| {
                moved(&mut group.children);
                moved(&mut group.members);
                group
            }));
        id(self.nodes.len()) - 1
    }

    /// The meshes of some nodes as one.
    pub(super) fn joined(&self, nodes: &[u32]) -> Shape {
        let mut shape = Shape::default();
        for &id in nodes {
            shape.append_cluster(&self.node(id).mesh);
        }
        shape
    }

    /// Counts what the leaves are made of is from the source, lattice units, as error of every node.
    pub(super) fn add_error(&mut self, distance: f64) {
        let own = self.nodes.iter_mut().map(|node| &mut node.error);
        for error in own.chain(self.local.iter_mut().flatten()) {
            *error = upwards(f64::from(*error) + distance);
        }
    }

    /// Area of the leaves, lattice units.
    pub(super) fn area(&self) -> f64 {
        let leaves = self.nodes.iter().filter(|node| node.children.is_empty());
        leaves
            .map(|node| {
                let mut shape = Shape::default();
                shape.append_cluster(&node.mesh);
                shape.area()
            })
            .sum()
    }

    /// All nodes but those that are gone, the last first, which is the root: children after what they replace. Where a child is gone, all
    /// beside it are, and what is below.
    pub(super) fn nodes(&self, is_gone: &[bool]) -> Vec<ClusterInput> {
        let mut number = vec![0; self.nodes.len()];
        let mut count = 0;
        for (number, &is_gone) in number.iter_mut().zip(is_gone).rev() {
            *number = count;
            count += u32::from(!is_gone);
        }
        let kept = self.nodes.iter().zip(is_gone).rev();
        kept.filter(|(_, is_gone)| !**is_gone)
            .map(|(node, _)| {
                let children = node.children.iter();
                let kept = children.filter(|&&child| !is_gone[child as usize]);
                ClusterInput {
                    mesh: node.mesh.clone(),
                    error: node.error,
                    texel: None,
                    children: kept.map(|&child| number[child as usize]).collect(),
                }
            })
            .collect()
    }
}

fn id(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}
