//! Coarser clusters over those of the components, level by level.
//!
//! Neighbours along the curve are joined four at a time. A node's error is the bound of its distance to its children and,
//! on top of it, the largest of theirs: distances between sets add up, so it bounds the distance to the source, and it
//! never grows on the way down.

use super::Room;
use super::graph::Graph;
use super::simplify::simplified;
use rayon::prelude::*;

/// Most children of a node.
const FAN_OUT: usize = 4;

/// Adds nodes above `roots`, of which there is at least one, up to one that stands for them all: the last of the graph.
pub(super) fn tree(graph: &mut Graph, roots: Vec<u32>, colours: bool, room: Room) {
    let mut level = roots;
    while level.len() > 1 {
        let groups = level.len().div_ceil(FAN_OUT);
        let count = level.len();
        // Of nearly equal size, so that none has a single child.
        let group = |group: usize| &level[group * count / groups..(group + 1) * count / groups];
        let coarser: Vec<_> = (0..groups)
            .into_par_iter()
            .map(|number| simplified(&graph.joined(group(number)), room))
            .collect();
        level = coarser
            .into_iter()
            .enumerate()
            .map(|(number, (shape, error))| {
                graph.above(&shape, group(number).to_vec(), error, colours)
            })
            .collect();
    }
}

/// Adds one node in place of `children`.
pub(super) fn parent(graph: &mut Graph, children: Vec<u32>, colours: bool, room: Room) -> u32 {
    let (shape, error) = simplified(&graph.joined(&children), room);
    graph.above(&shape, children, error, colours)
}
