//! Rule R6 for a camera that rests, or moves slowly: how far what a cut draws is on its way to the next coarser surface.
//!
//! By what the view shows of that one's error: at the target error, where it would take its place, all the way; from [`RANGE`] times as
//! much on not at all, or from where something finer takes the place of the finer surface, if that comes earlier. So the picture follows the
//! camera without a jump. [`animate`](super::animate) limits how fast it does, which is seen where the camera is fast, what was missing comes
//! late, or two levels have nearly the same error (continuous levels of detail after Hoppe, "View-Dependent Refinement of Progressive
//! Meshes", 1997, and Lindstrom & Pascucci, "Terrain Simplification Simplified", 2002).
//!
//! What is shown on the way is at most 1 + ([`RANGE`] − 1) / 4 times the target error off, where both surfaces bend alike; it is less where the
//! finer surface's own error is below the target. Limit: vertices of torn scans of which the file tells a wrong place are farther off on their way.

use super::animate::Drawn;
use super::cluster::error_over;
use super::cluster::morph::{GroupMorphs, split_groups};
use super::cut::{Cut, Leaf};
use super::desire::{Forest, Target, root_error};
use super::edge_morph::Morphs;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, ClusterGroup, ClusterId, ClusterNode, Document, NodeId};

/// From how many times the target error on a surface is wholly its own. At a hundredth of the distance a frame that is about as long as
/// changes that are limited in time take; more costs detail where nothing moves.
pub const RANGE: f64 = 1.15;

/// How far to the coarser surface, 0..=1, where that one's error and the surface's own would show these parts of the target error.
fn morph(coarser: f64, own: f64) -> f32 {
    if coarser <= 1.0 {
        return 1.0;
    }
    let end = RANGE.min(coarser / own);
    if coarser < end {
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
        let left = ((end - coarser) / (end - 1.0)) as f32;
        left
    } else {
        0.0
    }
}

/// What `cut` draws when all of it has had time to get where `target` wants it.
///
/// Groups of clusters whose children would be all the way on the coarser surface are drawn themselves, as that is the same: where two of the children's triangles have come to lie
/// on each other, back to back, it is chance which one is seen, and flickers.
pub fn at_rest(document: &Document, forest: &Forest, target: &Target<'_>, mut cut: Cut) -> Drawn {
    Drawn {
        morphs: leaf_morphs(document, forest, target, &cut),
        group_morphs: group_morphs(document, target, &mut cut),
        cut,
    }
}

/// Of groups of clusters that are split and of whose children none is; those at 1 are merged.
fn group_morphs(document: &Document, target: &Target<'_>, cut: &mut Cut) -> GroupMorphs {
    let Some(clusters) = &document.clusters else {
        return GroupMorphs::new();
    };
    let mut morphs = GroupMorphs::new();
    let of_group = |group: &ClusterGroup| {
        let nodes = group.members.iter().filter_map(|&id| clusters.node(id));
        let parts = nodes.map(|node| part_of_cluster(target, error_over(group, node), node));
        parts.fold(0.0, f64::max)
    };
    let mut below = Vec::new();
    for id in split_groups(clusters, cut) {
        let Some(group) = clusters.group(id) else {
            continue;
        };
        let mut children = group.children.clone().map(ClusterId);
        if children.any(|child| cut.is_cluster_split(child)) {
            continue;
        }
        below.clear();
        below.extend(
            group
                .children
                .clone()
                .filter_map(|child| clusters.node(ClusterId(child))?.group),
        );
        below.sort_unstable();
        below.dedup();
        let below = below.iter().filter_map(|&id| clusters.group(id));
        let morph = morph(of_group(group), below.map(of_group).fold(0.0, f64::max));
        if morph >= 1.0 {
            cut.merge_group(group);
        } else if morph > 0.0 {
            morphs.insert(id, morph);
        }
    }
    morphs
}

/// What is seen of an error of a cluster, or of its texels' length, parts of what is wanted.
fn part_of_cluster(target: &Target<'_>, error: f32, node: &ClusterNode) -> f64 {
    let error = target.view.error_px(error, &node.bounds) / target.paged_error_px;
    let texels = target.paged_error_px / target.error_px;
    let texel = node.texel.unwrap_or(0.0);
    error.max(target.view.error_px(texel, &node.bounds) / texels)
}

/// Of leaves beside which nothing is finer.
fn leaf_morphs(document: &Document, forest: &Forest, target: &Target<'_>, cut: &Cut) -> Morphs {
    let surfaces = Surfaces {
        document,
        forest,
        target,
    };
    let mut morphs = Morphs::new();
    for leaf in cut.leaves() {
        let Some(coarser) = surfaces.coarser(leaf) else {
            continue;
        };
        let morph = morph(coarser, surfaces.own(leaf));
        if morph > 0.0 && !cut.is_beside_finer(&document.charts, leaf) {
            morphs.insert(leaf.node, morph);
        }
    }
    morphs
}

/// What is seen of the errors of nodes at their resolutions, parts of what is wanted.
struct Surfaces<'a> {
    document: &'a Document,
    forest: &'a Forest,
    target: &'a Target<'a>,
}

impl Surfaces<'_> {
    /// Of what `leaf` and those that merge with it give way to; `None` where that is nothing.
    fn coarser(&self, leaf: Leaf) -> Option<f64> {
        match leaf.node.parent() {
            None => self.root(leaf.node.chart, leaf.resolution.checked_sub(1)?),
            Some((root, _)) if root.level == 0 => self.root(root.chart, PAGE_RESOLUTION),
            Some((parent, _)) => self.node(parent),
        }
    }

    /// Of `leaf`; 0 where there is nothing finer.
    fn own(&self, leaf: Leaf) -> f64 {
        let error = if leaf.node.level == 0 {
            self.root(leaf.node.chart, leaf.resolution)
        } else {
            self.node(leaf.node)
        };
        error.unwrap_or(0.0)
    }

    fn root(&self, id: ChartId, resolution: u8) -> Option<f64> {
        let chart = self.document.charts.get(usize::try_from(id.0).ok()?)?;
        let error = root_error(self.document, id, resolution)?;
        let is_paged = resolution >= self.document.base_resolution.min(chart.resolution);
        self.part(error, NodeId::root(id), is_paged)
    }

    fn node(&self, node: NodeId) -> Option<f64> {
        let page = self.document.page_of_node(node)?;
        let error = *self.document.page(page)?.errors.first()?;
        self.part(error, node, true)
    }

    fn part(&self, error: f32, node: NodeId, is_paged: bool) -> Option<f64> {
        let bounds = self.forest.bounds(self.document, node)?;
        let target = self.target;
        Some(target.view.error_px(error, &bounds) / target.limit_px(is_paged))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::View;
    use crate::lod::balance;
    use crate::lod::edge_morph::morph_of;
    use crate::testing::{Random, Shape, Wall, random_finest};
    use crate::{Camera, Viewport};

    #[test]
    #[expect(clippy::float_cmp, reason = "exact by construction")]
    fn a_surface_is_its_own_from_a_range_above_the_target_or_where_something_finer_comes() {
        assert_eq!([0.0, 0.5, 1.0].map(|error| morph(error, 0.1)), [1.0; 3]);
        assert_eq!(
            [RANGE, 2.0, f64::INFINITY].map(|error| morph(error, 0.5)),
            [0.0; 3]
        );
        assert!((morph(0.5 * (1.0 + RANGE), 0.0) - 0.5).abs() < 1e-6);
        // The finer surface's own error is at the target where this one's is 1.1 times as much.
        assert!((morph(1.05, 1.05 / 1.1) - 0.5).abs() < 1e-6);
        assert_eq!(morph(1.11, 1.11 / 1.1), 0.0);
        assert_eq!(
            [morph(1.01, 1.01), morph(f64::INFINITY, f64::INFINITY)],
            [0.0; 2]
        );
        // Whatever the two errors are, no step of the camera moves it far.
        for own in [0.0, 0.3, 0.6, 0.8] {
            for k in 0..400 {
                let [near, far] = [k, k + 1].map(|k| {
                    let scale = 0.9 + 0.001 * f64::from(k);
                    morph(scale, own * scale)
                });
                assert!((0.0..=0.008).contains(&(near - far)), "{own} {k}");
            }
        }
    }

    fn seen_from(document: &Document, distance: f64, error_px: f64) -> Drawn {
        let camera = Camera::standard(&document.metadata, 0, distance).unwrap();
        let view = View::new(&camera, &document.metadata, Viewport::new(800, 600));
        let target = Target {
            view: &view,
            error_px,
            paged_error_px: error_px,
            previous: None,
        };
        let forest = Forest::new(document);
        let cut = forest.want(document, &target).cut;
        at_rest(document, &forest, &target, cut)
    }

    #[test]
    fn groups_that_come_with_the_camera_come_where_they_were_before() {
        let wall = Wall::new(120, None).unwrap();
        let document = &wall.document;
        let clusters = document.clusters.as_ref().unwrap();
        let (mut distance, mut last): (f64, Option<Drawn>) = (60.0, None);
        let (mut changes, mut moves) = (0, 0);
        while distance > 0.3 {
            let drawn = seen_from(document, distance, 1.0);
            moves += usize::from(!drawn.group_morphs.is_empty());
            if let Some(last) = &last {
                changes += usize::from(last.cut != drawn.cut);
                for (&id, &morph) in &drawn.group_morphs {
                    let group = clusters.group(id).unwrap();
                    let was = if last.cut.is_group_split(group) {
                        last.group_morphs.get(&id).copied().unwrap_or(0.0)
                    } else {
                        1.0
                    };
                    assert!((was - morph).abs() < 0.05, "{distance}: {was} {morph}");
                }
            }
            last = Some(drawn);
            distance *= 0.999;
        }
        assert!(changes > 3 && moves > 500, "{changes} {moves}");
    }

    #[test]
    fn leaves_beside_finer_ones_do_not_move() {
        let mut random = Random::new(61);
        let mut moves = 0;
        for shape in [Shape::Cube, Shape::Torus] {
            let charts = shape.charts(5);
            let finest = random_finest(&mut random, &charts, 3, 4);
            let (document, _) = shape.open(&finest).unwrap();
            for k in 0..60 {
                let drawn = seen_from(&document, 0.7 * 1.05_f64.powi(k), 1.0 + random.unit());
                assert!(balance::is_balanced(&drawn.cut, &charts));
                moves += drawn.morphs.len();
                for leaf in drawn.cut.leaves() {
                    let beside = drawn.cut.is_beside_finer(&charts, leaf);
                    assert!(!beside || morph_of(&drawn.morphs, leaf) == 0.0);
                }
            }
        }
        assert!(moves > 50, "{moves}");
    }
}
