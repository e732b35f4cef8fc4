//! Components that do not fit a leaf.
//!
//! Such a component is divided until its parts fit leaves. From there on up about 16 neighbouring nodes at a time ([`Room`]), a *group*, become
//! about four (where a scan has few nodes about 8 become four), with the vertices that others share held where they are, so that whatever is drawn of the others fits without a crack.
//! The nodes of the next level are grouped anew, across the borders that were held below, so these are coarser one level up: no level
//! keeps what another needed. Nodes of one group are replaced together, by the same children; where they are in different groups above,
//! those have to be replaced first. (Yoon, Salomon, Gayle & Manocha, "Quick-VDR: Interactive View-Dependent Rendering of Massive
//! Models", 2004; Karis, Stubbe & Wihlidal, "Nanite: A Deep Dive", SIGGRAPH 2021 course; groups by meshoptimizer's partition.)
//!
//! A group that does not become two thirds of its nodes or fewer is left for the next level, with other neighbours. Where no group does,
//! that ends: the nodes left are the children of one, which stands for them all.

use super::Room;
use super::became::Became;
use super::graph::Graph;
use super::leaf::Piece;
use super::local::Link;
use super::shape::Shape;
use super::simplify::{Simplified, simplified_within};
use super::tree;
use marquetry_format::LatticePoint;
use meshopt::{VertexDataAdapter, partition_clusters_with_positions, typed_to_bytes};
use rayon::prelude::*;
use std::collections::HashMap;

/// Nodes that become one, about.
const REDUCTION: usize = 4;
/// Groups of a level of the whole scan that are few: a cut is much coarser than asked by one that is not split. Those of so few are half as large, and their
/// nodes are halved, which costs little where few nodes are below; leaves are most of a file.
const FEW: usize = 4;
/// Share of a component that is as good as all of its scan. Bounds of more levels add up to more, so that beside components of fewer ones it would be drawn finer than they are.
const ALONE: f64 = 0.9;
/// Triangles of a node that is made, at most; some room is left for parts of different sizes.
const FULL: usize = 240;

/// A node that nothing stands for so far.
struct Node {
    id: u32,
    shape: Shape,
}

/// The graph of a component whose leaves are `pieces`, of which there is at least one, with vertices at multiples of `unit`, and which is `share` of the scan's triangles; the last
/// node stands for all of it.
pub(super) fn graph(pieces: Vec<Piece>, share: f64, unit: u32, colours: bool, room: Room) -> Graph {
    let mut graph = Graph::default();
    let mut front: Vec<Node> = pieces
        .into_iter()
        .map(|piece| Node {
            id: graph.leaf(&piece.shape, piece.error, colours),
            shape: piece.shape,
        })
        .collect();
    for level in 0..room.levels() {
        if front.len() == 1 {
            return graph;
        }
        let step = Step::from(front.len(), level == 0, share, room);
        let groups = Groups::of(&front, step.group);
        let coarser: Vec<Option<Coarser>> = groups
            .members
            .par_iter()
            .map(|members| coarser(&front, members, &groups, unit, step.reduction, room))
            .collect();
        if coarser.iter().all(Option::is_none) {
            break;
        }
        front = next(
            &mut graph,
            front,
            groups.members.into_iter().zip(coarser),
            colours,
        );
    }
    if front.len() > 1 {
        tree::parent(
            &mut graph,
            front.iter().map(|node| node.id).collect(),
            colours,
            room,
        );
    }
    graph
}

/// How one level is made from the one below.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Nodes of a group, about.
    group: usize,
    /// Nodes that become one, about.
    reduction: usize,
}

impl Step {
    /// The step from a level of `front` nodes, `share` of all that the scan has.
    fn from(front: usize, are_leaves: bool, share: f64, room: Room) -> Self {
        let full = room.group();
        // Less than 2^32.
        let are_few = front as f64 <= share * (FEW * full) as f64;
        if are_few && share >= ALONE && room.has_halves() && !are_leaves {
            Self {
                group: full / 2,
                reduction: 2,
            }
        } else {
            let group = if are_few { full / 2 } else { full };
            Self {
                group: group.max(REDUCTION),
                reduction: REDUCTION,
            }
        }
    }
}

/// Nodes of the front by group, and which places groups share.
struct Groups {
    members: Vec<Vec<usize>>,
    /// The group that has a vertex at a place, [`SHARED`] where several do.
    owners: HashMap<LatticePoint, u32>,
}

/// Of several groups.
const SHARED: u32 = u32::MAX;

impl Groups {
    fn of(front: &[Node], size: usize) -> Self {
        let mut places: HashMap<LatticePoint, u32> = HashMap::new();
        let mut points: Vec<f32> = Vec::new();
        let (mut indices, mut counts) = (Vec::new(), Vec::with_capacity(front.len()));
        for node in front {
            let numbers: Vec<u32> = node
                .shape
                .vertices
                .iter()
                .map(|vertex| {
                    let next = u32::try_from(places.len()).unwrap_or(u32::MAX);
                    *places.entry(vertex.0).or_insert_with(|| {
                        // Less than 2^21.
                        points.extend(vertex.0.map(|c| c as f32));
                        next
                    })
                })
                .collect();
            let corners = node.shape.triangles.as_flattened();
            indices.extend(corners.iter().map(|&v| numbers[v as usize]));
            counts.push(u32::try_from(corners.len()).unwrap_or(u32::MAX));
        }
        let mut group_of = vec![0; front.len()];
        if let Ok(vertices) = VertexDataAdapter::new(typed_to_bytes(&points), 12, 0) {
            partition_clusters_with_positions(&mut group_of, &indices, &counts, &vertices, size);
        }
        let count = group_of.iter().max().map_or(0, |&last| last as usize + 1);
        let mut members = vec![Vec::new(); count];
        let mut owners = HashMap::with_capacity(places.len());
        for ((number, node), &group) in front.iter().enumerate().zip(&group_of) {
            members[group as usize].push(number);
            for vertex in &node.shape.vertices {
                let owner = owners.entry(vertex.0).or_insert(group);
                if *owner != group {
                    *owner = SHARED;
                }
            }
        }
        Self { members, owners }
    }

    fn is_held(&self, place: &LatticePoint) -> bool {
        self.owners.get(place) == Some(&SHARED)
    }
}

/// What stands for a group.
struct Coarser {
    parts: Vec<Shape>,
    squares: f64,
    links: Option<Vec<Link>>,
    became: Became,
}

/// What is to stand for the group of `members`; `None` where that is hardly less.
fn coarser(
    front: &[Node],
    members: &[usize],
    groups: &Groups,
    unit: u32,
    reduction: usize,
    room: Room,
) -> Option<Coarser> {
    if members.len() < 2 {
        return None;
    }
    let mut whole = Shape::default();
    for &member in members {
        whole.append(&front[member].shape);
    }
    if whole.fits(room) {
        return Some(Coarser {
            parts: vec![whole],
            squares: 0.0,
            links: None,
            became: Became::itself(),
        });
    }
    let target = (FULL * members.len().div_ceil(reduction)).min(whole.triangles.len() / 2);
    let is_held = |place: &LatticePoint| groups.is_held(place);
    let simplified = simplified_within(&whole, is_held, target, unit, room)?;
    let Simplified {
        shape,
        squares,
        mut links,
        became,
    } = simplified;
    let (parts, order) = shape.split(FULL, room);
    let mut place = vec![0; order.len()];
    for (number, &triangle) in (0u32..).zip(&order) {
        place[triangle as usize] = number;
    }
    for link in &mut links {
        link.member = place[link.member as usize];
    }
    (3 * parts.len() <= 2 * members.len()).then_some(Coarser {
        parts,
        squares,
        links: Some(links),
        became,
    })
}

/// The front above: what stands for groups, and nodes of groups that nothing does.
fn next(
    graph: &mut Graph,
    front: Vec<Node>,
    groups: impl Iterator<Item = (Vec<usize>, Option<Coarser>)>,
    colours: bool,
) -> Vec<Node> {
    let mut front: Vec<Option<Node>> = front.into_iter().map(Some).collect();
    let mut above = Vec::new();
    for (members, coarser) in groups {
        let members = members
            .into_iter()
            .filter_map(|member| front[member].take());
        let Some(Coarser {
            parts,
            squares,
            links,
            became,
        }) = coarser
        else {
            above.extend(members);
            continue;
        };
        let children: Vec<u32> = members.map(|node| node.id).collect();
        let ids = graph.group(&parts, &children, squares, links, &became, colours);
        let nodes = ids.into_iter().zip(parts);
        above.extend(nodes.map(|(id, shape)| Node { id, shape }));
    }
    above
}
