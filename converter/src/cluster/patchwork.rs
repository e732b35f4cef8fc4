//! Components that do not fit a leaf.
//!
//! Such a component is halved until its parts fit leaves. From there on up four neighbouring nodes at a time become one, with the
//! vertices that others share held where they are, so that whatever is drawn of the others fits without a crack. Where
//! what is held no longer leaves a cluster room enough, that ends: the nodes left are the children of one, which a cut takes all or none of
//! (clusters with borders held as in Yoon, Salomon, Gayle & Manocha, "Quick-VDR: Interactive View-Dependent Rendering of
//! Massive Models", 2004, without its dependencies between clusters).
//! Limit: a border is twice as long with every level, so one node comes to stand for a few thousand triangles, and between
//! these nodes and the one above all of them there is nothing to draw.

use super::Room;
use super::leaf::{Piece, leaf};
use super::simplify::simplified_within;
use super::tree::{above, joined, parent};
use crate::cluster::ClusterInput;
use marquetry_format::LatticePoint;
use std::collections::HashMap;
use std::ops::Range;

/// A component halved until its parts fit leaves.
pub(super) enum Halves {
    /// It fits.
    Piece(Piece),
    /// Both halves.
    Two(Box<[Halves; 2]>),
}

/// Nodes that become one at a time, at least; up to twice as many where halves differ.
const FAN_OUT: usize = 4;

/// The first and the last leaf, counted in order of the halves, that has a vertex at a place.
type Spans = HashMap<LatticePoint, [u32; 2]>;

/// The node of a component.
pub(super) fn node(halves: Halves, colours: bool, room: Room) -> ClusterInput {
    let mut spans = Spans::new();
    let mut leaves = 0;
    note(&halves, &mut leaves, &mut spans);
    let Roots { mut nodes, .. } = roots(halves, 0..leaves, &spans, (colours, room));
    if nodes.len() > 1 {
        return parent(nodes, room);
    }
    nodes.pop().unwrap_or_default()
}

fn note(halves: &Halves, leaves: &mut u32, spans: &mut Spans) {
    match halves {
        Halves::Piece(piece) => {
            for vertex in &piece.shape.vertices {
                let span = spans.entry(vertex.0).or_insert([*leaves; 2]);
                span[1] = *leaves;
            }
            *leaves += 1;
        }
        Halves::Two(halves) => halves.iter().for_each(|half| note(half, leaves, spans)),
    }
}

/// Nodes that stand for some leaves.
struct Roots {
    nodes: Vec<ClusterInput>,
    /// Whether some of them could not become one.
    is_stuck: bool,
}

fn count(halves: &Halves) -> u32 {
    match halves {
        Halves::Piece(_) => 1,
        Halves::Two(halves) => halves.iter().map(count).sum(),
    }
}

fn roots(
    halves: Halves,
    leaves: Range<u32>,
    spans: &Spans,
    (colours, room): (bool, Room),
) -> Roots {
    let [lower, upper] = match halves {
        Halves::Piece(piece) => {
            return Roots {
                nodes: vec![leaf(&piece.shape, piece.error, colours)],
                is_stuck: false,
            };
        }
        Halves::Two(halves) => *halves,
    };
    let middle = leaves.start + count(&lower);
    let (start, end) = (leaves.start, leaves.end);
    let (mut roots, upper) = rayon::join(
        || roots(lower, start..middle, spans, (colours, room)),
        || roots(upper, middle..end, spans, (colours, room)),
    );
    roots.nodes.extend(upper.nodes);
    roots.is_stuck |= upper.is_stuck;
    if roots.is_stuck || roots.nodes.len() < FAN_OUT {
        return roots;
    }
    let is_held = |place: &LatticePoint| {
        let [first, last] = spans.get(place).copied().unwrap_or([0, u32::MAX]);
        first < start || last >= end
    };
    match simplified_within(&joined(&roots.nodes), is_held, room) {
        Some((coarser, error)) => roots.nodes = vec![above(roots.nodes, &coarser, error)],
        None => roots.is_stuck = true,
    }
    roots
}
