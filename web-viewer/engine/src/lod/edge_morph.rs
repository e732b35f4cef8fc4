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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::animate::Drawn;
    use crate::lod::balance;
    use crate::lod::cut::neighbour;
    use crate::testing::{Random, cube_charts, random_cut, random_rest, self_glued_charts};

    #[test]
    fn both_leaves_at_a_border_agree() {
        let mut random = Random::new(13);
        for charts in [cube_charts(5), self_glued_charts(5)] {
            let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
            for _ in 0..40 {
                let mut target = random_cut(&mut random, &charts, 2);
                balance::coarsen(&mut target, &charts);
                let target = random_rest(&mut random, &charts, target);
                for _ in 0..3 {
                    drawn.advance(&target, &charts, 0.3);
                }
                for leaf in drawn.cut.leaves() {
                    let modes = side_modes(&drawn.cut, &drawn.morphs, &charts, leaf);
                    for (side, mode) in SIDES.into_iter().zip(modes) {
                        let (node, back) = neighbour(&charts, leaf.node, side).unwrap();
                        match drawn.cut.across(&charts, leaf, side) {
                            Across::Equal(other) => {
                                let theirs = side_modes(&drawn.cut, &drawn.morphs, &charts, other);
                                assert_eq!(theirs[usize::from(back.0)], mode);
                            }
                            Across::Finer => {
                                assert_eq!(mode, SideMode::Morph(0.0));
                                let mut finer = Vec::new();
                                drawn.cut.leaves_below(node, Some(back), &mut finer);
                                for other in finer {
                                    let theirs =
                                        side_modes(&drawn.cut, &drawn.morphs, &charts, other);
                                    assert_eq!(theirs[usize::from(back.0)], SideMode::Snap);
                                }
                            }
                            Across::Coarser(_) => assert_eq!(mode, SideMode::Snap),
                            Across::Open => panic!("these surfaces are closed"),
                        }
                    }
                }
            }
        }
    }
}
