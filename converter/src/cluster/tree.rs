//! Coarser clusters over those of the components, level by level.
//!
//! Neighbours along the curve are joined four at a time. A node's error is the bound of its distance to its children and,
//! on top of it, the largest of theirs: distances between sets add up, so it bounds the distance to the source, and it
//! never grows on the way down.

use super::Room;
use super::leaf::upwards;
use super::shape::Shape;
use super::simplify::simplified;
use crate::cluster::ClusterInput;
use rayon::prelude::*;

/// Most children of a node.
const FAN_OUT: usize = 4;

/// The root over `nodes`, of which there is at least one.
pub fn tree(nodes: Vec<ClusterInput>, room: Room) -> ClusterInput {
    let mut level = nodes;
    while level.len() > 1 {
        let groups = level.len().div_ceil(FAN_OUT);
        // Of nearly equal size, so that none has a single child.
        let mut rest = level.into_iter();
        let mut sizes = Vec::with_capacity(groups);
        let count = rest.len();
        for group in 0..groups {
            let size = (group + 1) * count / groups - group * count / groups;
            sizes.push(rest.by_ref().take(size).collect::<Vec<_>>());
        }
        level = sizes
            .into_par_iter()
            .map(|children| parent(children, room))
            .collect();
    }
    level.pop().unwrap_or_default()
}

/// One node in place of `children`.
pub(super) fn parent(children: Vec<ClusterInput>, room: Room) -> ClusterInput {
    let (coarser, error) = simplified(&joined(&children), room);
    above(children, &coarser, error)
}

/// The meshes of `children` as one.
pub(super) fn joined(children: &[ClusterInput]) -> Shape {
    let mut shape = Shape::default();
    for child in children {
        shape.append_cluster(&child.mesh);
    }
    shape
}

/// The node over `children` that shows `coarser` in their place, whose distance to theirs is at most `error`.
pub(super) fn above(children: Vec<ClusterInput>, coarser: &Shape, error: f64) -> ClusterInput {
    let errors = children.iter().map(|child| f64::from(child.error));
    let below = errors.fold(0.0, f64::max);
    let colours = children.iter().any(|child| !child.mesh.colours.is_empty());
    ClusterInput {
        mesh: coarser.cluster(colours),
        error: upwards(below + error),
        texel: None,
        children,
    }
}
