//! Nodes of clusters and what replaces them: a graph without cycles, in which nodes with the same children are replaced together.

use super::became::Became;
use super::leaf::upwards;
use super::shape::Shape;
use marquetry_format::LatticePoint;
use marquetry_format::cluster::morph::{Places, UNRANKED};
use marquetry_format::writer::ClusterInput;

/// Nodes, children before what they replace.
#[derive(Debug, Default)]
pub(super) struct Graph {
    nodes: Vec<ClusterInput>,
    groups: Vec<Group>,
}

/// Nodes of a component, and what replaces them.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) members: Vec<u32>,
    pub(super) children: Vec<u32>,
    /// Integral of the squared distance between them over the children's area, lattice units to the fourth power.
    pub(super) squares: f64,
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
        let errors = children.iter().map(|&child| self.node(child).error);
        let error = upwards(f64::from(errors.fold(0.0, f32::max)) + distance);
        self.push(shape, error, children, colours)
    }

    /// Adds nodes that all together `children` replace, whose vertices `became` theirs; their numbers.
    pub(super) fn group(
        &mut self,
        shapes: &[Shape],
        children: &[u32],
        distance: Distance,
        became: &Became,
        colours: bool,
    ) -> Vec<u32> {
        let above = |shape| self.above(shape, children.to_vec(), distance.bound, colours);
        let members: Vec<u32> = shapes.iter().map(above).collect();
        let places = Places::of(members.iter().map(|&member| &self.node(member).mesh));
        for &child in children {
            let mesh = &mut self.nodes[child as usize].mesh;
            let rank = |&place: &LatticePoint| {
                let to = became.of(place);
                to.map_or(UNRANKED, |to| places.rank(place, to))
            };
            mesh.ranks = mesh.positions.iter().map(rank).collect();
        }
        self.groups.push(Group {
            members: members.clone(),
            children: children.to_vec(),
            squares: distance.squares,
        });
        members
    }

    fn push(&mut self, shape: &Shape, error: f32, children: Vec<u32>, colours: bool) -> u32 {
        let id = id(self.nodes.len());
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
        for node in &mut self.nodes {
            node.error = upwards(f64::from(node.error) + distance);
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
