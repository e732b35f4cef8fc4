//! Leaves that are finer than the target error asks for are left out.
//!
//! What a group's nodes are replaced by goes where that adds little to the squared error for the triangles that it saves, from the
//! leaves upwards, until what may be added is spent: every triangle that stays is worth about the same. Squares of distances of one level
//! to the next are taken to add up. Groups, and what they stand for, stay as they are, so cuts are as tight as ever.

use super::graph::{Graph, Group};

/// What may be added to the error of the leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Integral of the squared distance over the surface, lattice units to the fourth power.
    pub squares: f64,
    /// Bound of the distance of a leaf, lattice units.
    pub distance: f64,
}

/// Halvings of the interval of prices.
const STEPS: u32 = 40;

/// By node whether `budget` makes it dispensable.
pub(super) fn trimmed(graph: &Graph, budget: Budget) -> Vec<bool> {
    let prices = || graph.groups().iter().map(|group| price(graph, group));
    let finite = prices().filter(|price| price.is_finite());
    let (mut low, mut high) = (0.0, finite.fold(0.0, f64::max));
    let at = |most: f64| chosen(graph, most, budget.distance);
    if at(high).squares > budget.squares {
        for _ in 0..STEPS {
            let middle = f64::midpoint(low, high);
            if at(middle).squares <= budget.squares {
                low = middle;
            } else {
                high = middle;
            }
        }
        high = low;
    }
    at(high).is_gone
}

/// Squared error that goes with each triangle saved.
fn price(graph: &Graph, group: &Group) -> f64 {
    group.squares / graph.triangles(&group.children) as f64
}

/// Nodes that are left out.
struct Chosen {
    is_gone: Vec<bool>,
    squares: f64,
}

/// What replaces groups goes up to a price, where nothing replaces it in turn.
fn chosen(graph: &Graph, most: f64, distance: f64) -> Chosen {
    let mut chosen = Chosen {
        is_gone: vec![false; graph.len()],
        squares: 0.0,
    };
    // A leaf is one whose children are gone, or that has none: groups below come first.
    let mut has_children: Vec<bool> = (0..graph.len())
        .map(|id| !graph.children(id).is_empty())
        .collect();
    for group in graph.groups() {
        let of_leaves = group.children.iter().all(|&id| !has_children[id as usize]);
        // That of all members.
        let error = group.members.first().map(|&id| graph.node(id).error);
        let is_far = error.is_none_or(|error| f64::from(error) > distance);
        if !of_leaves || price(graph, group) > most || is_far {
            continue;
        }
        chosen.squares += group.squares;
        for &id in &group.children {
            chosen.is_gone[id as usize] = true;
        }
        for &id in &group.members {
            has_children[id as usize] = false;
        }
    }
    chosen
}
