//! Rules R2–R4: how each side of a drawn node meets its neighbour.
//!
//! Both leaves at a border decide from the same facts (both resolutions, both morphs), so they put the border's samples
//! in the same places. Relies on rule R1 and on the states that [`super::animate`] allows: beside a finer leaf a morph is 0.
//! Corners need no rule: they are even at every resolution above 0, and even samples do not move.

use super::cut::{Across, Cut, Leaf, SIDES};
use marquetry_format::{Chart, NodeId};
use std::collections::BTreeMap;

/// Where the odd samples of a side go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SideMode {
    /// This far towards their targets, 0..=1.
    Morph(f32),
    /// Onto their even neighbour towards the lower corner, exactly: the neighbour is coarser and has no such sample.
    Snap,
}

/// How far leaves are on their way to the next coarser resolution: 0 = own surface, 1 = the parent's. Absent = 0.
pub type Morphs = BTreeMap<NodeId, f32>;

/// The morph of `leaf`.
pub fn morph_of(morphs: &Morphs, leaf: Leaf) -> f32 {
    morphs.get(&leaf.node).copied().unwrap_or(0.0)
}

/// The modes of the four sides of `leaf`.
pub fn side_modes(cut: &Cut, morphs: &Morphs, charts: &[Chart], leaf: Leaf) -> [SideMode; 4] {
    let own = morph_of(morphs, leaf);
    SIDES.map(|side| match cut.across(charts, leaf, side) {
        Across::Open => SideMode::Morph(own),
        Across::Coarser(_) => SideMode::Snap,
        Across::Equal(other) => SideMode::Morph(own.max(morph_of(morphs, other))),
        Across::Finer => SideMode::Morph(0.0),
    })
}
