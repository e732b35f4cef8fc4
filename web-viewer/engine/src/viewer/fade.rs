//! Transitions in which two pictures take each other's place: the old cut and the new one, for a while both.
//!
//! Leaves that both cuts draw alike, sides included, are drawn once and fully. A cut that changes again meanwhile waits
//! until the change that is shown has ended.

use super::Viewer;
use crate::camera::View;
use crate::colour::layer::ColourLayer;
use crate::gpu_types::{ClusterList, DrawList, Instance};
use crate::lod::animate::Drawn;
use crate::lod::cluster;
use crate::options::Transition;
use marquetry_format::ClusterId;
use std::collections::{BTreeSet, HashSet};

/// A change under way.
#[derive(Debug, Clone)]
pub(super) struct Fade {
    /// What is going.
    pub(super) leaving: Drawn,
    /// How much of it has gone, 0..1.
    pub(super) part: f32,
}

/// What is drawn besides [`Viewer::draw_list`] while one picture gives way to another.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Fading {
    /// Only in the old picture.
    pub(crate) leaving: DrawList,
    /// Only in the new picture.
    pub(crate) arriving: DrawList,
    /// The clusters of the old picture alone.
    pub(crate) leaving_clusters: ClusterList,
    /// The clusters of the new picture alone.
    pub(crate) arriving_clusters: ClusterList,
    /// How far the change is, 0..1.
    pub(crate) part: f32,
}

impl Viewer {
    /// Whether the present transition shows two pictures.
    pub(super) fn fades(&self) -> bool {
        matches!(
            self.options.transition,
            Transition::Alpha | Transition::Dither
        )
    }

    /// Goes on by `part` of a change (above 0), and begins the next one where that has ended.
    pub(super) fn fade(&mut self, part: f32) {
        if let Some(fade) = &mut self.fade {
            fade.part += part;
            if fade.part >= 1.0 {
                self.fade = None;
            }
        } else {
            let arriving = self.target.clone();
            self.fade = Some(Fade {
                leaving: std::mem::replace(&mut self.drawn, arriving),
                part: 0.0,
            });
        }
    }

    /// Collects what both pictures show, and what only one of them does.
    pub(super) fn collect_both(&mut self, view: &View) {
        let mut colour = self.colour.take();
        if let Some(layer) = &mut colour {
            layer.clear_map();
        }
        let all = self.list_of(view, &self.drawn, &mut colour);
        let leaving = self
            .fade
            .as_ref()
            .map(|fade| self.list_of(view, &fade.leaving, &mut colour));
        self.colour = colour;
        let (Some(leaving), Some(fade)) = (leaving, &self.fade) else {
            self.fading = None;
            self.draw_list = all;
            return;
        };
        let keys = |list: &DrawList| list.instances.iter().map(key).collect::<HashSet<_>>();
        let (old, new) = (keys(&leaving), keys(&all));
        self.fading = Some(Fading {
            leaving: leaving.filtered(|instance| !new.contains(&key(instance))),
            arriving: all.filtered(|instance| !old.contains(&key(instance))),
            part: fade.part,
            ..Fading::default()
        });
        self.draw_list = all.filtered(|instance| old.contains(&key(instance)));
    }

    /// Has [`Viewer::drawn_clusters`] be those of what is drawn now.
    pub(super) fn find_drawn_clusters(&mut self) {
        let cut = &self.drawn.cut;
        if (self.drawn_clusters.as_ref()).is_none_or(|(known, _)| known != cut) {
            let ids = cluster::drawn(&self.document, cut);
            self.drawn_clusters = Some((cut.clone(), ids));
        }
    }

    /// The clusters that are drawn, in the picture or not.
    pub(super) fn drawn_clusters(&self) -> impl Iterator<Item = ClusterId> + '_ {
        let known = self.drawn_clusters.iter();
        known.flat_map(|(_, ids)| ids.iter().copied())
    }

    /// Collects the clusters that both pictures show, and those that only one of them does.
    pub(super) fn collect_clusters(&mut self, view: &View) {
        let document = &self.document;
        let new = self.drawn_clusters();
        let list = |drawn: &Drawn, ids: &mut dyn Iterator<Item = ClusterId>| {
            ClusterList::new(ids.filter_map(|id| self.cluster(view, drawn, id)))
        };
        let Some(fade) = &self.fade else {
            let all = list(&self.drawn, &mut { new });
            self.cluster_list = all;
            return;
        };
        let old: BTreeSet<ClusterId> = cluster::drawn(document, &fade.leaving.cut)
            .into_iter()
            .collect();
        let (both, arriving): (Vec<_>, Vec<_>) = new.partition(|id| old.contains(id));
        let both = BTreeSet::from_iter(both);
        let leaving = list(&fade.leaving, &mut old.difference(&both).copied());
        let arriving = list(&self.drawn, &mut arriving.into_iter());
        self.cluster_list = list(&self.drawn, &mut both.into_iter());
        if let Some(fading) = &mut self.fading {
            fading.leaving_clusters = leaving;
            fading.arriving_clusters = arriving;
        }
    }

    /// The leaves of `drawn` in the picture, with their places in the map of `colour`.
    fn list_of(&self, view: &View, drawn: &Drawn, colour: &mut Option<ColourLayer>) -> DrawList {
        let (now, fade_seconds) = (self.clock, self.fade_seconds());
        DrawList::new(&drawn.cut, |leaf| {
            let mut instance = self.instance(view, drawn, leaf)?;
            if let Some(layer) = colour {
                instance.tiles = layer.add_to_map(leaf.node, now, fade_seconds);
            }
            Some(instance)
        })
    }
}

/// Bytes of an instance.
type Key = [u8; size_of::<Instance>()];

/// What an instance draws, bit for bit; where the map has its colours does not matter.
fn key(instance: &Instance) -> Key {
    bytemuck::cast(Instance {
        tiles: [0; 2],
        ..*instance
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::Network;
    use super::{ClusterList, Drawn, Key, Viewer, cluster, key};
    use crate::testing::{Shape, Wall};
    use crate::{Camera, Transition, ViewerOptions};
    use std::collections::BTreeSet;

    fn keys(lists: [&crate::gpu_types::DrawList; 2]) -> BTreeSet<Key> {
        let all: Vec<_> = lists
            .into_iter()
            .flat_map(|list| list.instances.iter().map(key))
            .collect();
        let set: BTreeSet<_> = all.iter().copied().collect();
        assert_eq!(set.len(), all.len(), "nothing is drawn twice");
        set
    }

    fn at_once(viewer: &Viewer, drawn: &Drawn) -> BTreeSet<Key> {
        let view = viewer.view.unwrap();
        let list =
            crate::gpu_types::DrawList::new(&drawn.cut, |leaf| viewer.instance(&view, drawn, leaf));
        keys([&list, &crate::gpu_types::DrawList::default()])
    }

    #[test]
    fn each_picture_is_whole_all_along() {
        for transition in [Transition::Alpha, Transition::Dither] {
            let mut network = Network::new(Shape::Cube, 51);
            let mut viewer = network.viewer(ViewerOptions {
                transition,
                ..ViewerOptions::default()
            });
            let metadata = viewer.document.metadata.clone();
            let (mut fades, mut steady) = (0, 0);
            for frame in 0..300 {
                if frame % 60 == 0 {
                    viewer.set_camera(Camera::standard(&metadata, frame / 20, 1.4).unwrap());
                }
                network.frame(&mut viewer, 0.03);
                let Some(fading) = &viewer.fading else {
                    assert!(viewer.fade.is_none());
                    continue;
                };
                fades += 1;
                steady += viewer.draw_list.instances.len();
                assert!((0.0..1.0).contains(&fading.part));
                let fade = viewer.fade.as_ref().unwrap();
                assert_eq!(
                    keys([&viewer.draw_list, &fading.leaving]),
                    at_once(&viewer, &fade.leaving)
                );
                assert_eq!(
                    keys([&viewer.draw_list, &fading.arriving]),
                    at_once(&viewer, &viewer.drawn)
                );
            }
            assert!(fades > 20 && steady > 0, "{fades} {steady}");
            network.settle(&mut viewer);
            assert!(viewer.fading.is_none());
        }
    }

    #[test]
    fn clusters_of_both_pictures_are_whole_all_along() {
        let wall = Wall::new(120, None).unwrap();
        for transition in [Transition::Alpha, Transition::Dither] {
            let mut network = Network::of(wall.file.clone(), 53);
            let mut viewer = network.viewer(ViewerOptions {
                transition,
                ..ViewerOptions::default()
            });
            let metadata = viewer.document.metadata.clone();
            let (mut leaving, mut arriving, mut steady) = (0, 0, 0);
            for frame in 0..300u16 {
                if frame % 60 == 0 {
                    let away = 1.2 + 6.0 * f64::from(frame / 60 % 2);
                    viewer.set_camera(Camera::standard(&metadata, 0, away).unwrap());
                }
                network.frame(&mut viewer, 0.03);
                let Some(fading) = &viewer.fading else {
                    continue;
                };
                let view = viewer.view.unwrap();
                let slots = |list: &ClusterList| -> BTreeSet<u32> {
                    assert!(list.morphs.is_empty());
                    list.runs.iter().cloned().flatten().collect()
                };
                let of = |drawn: &Drawn| -> BTreeSet<u32> {
                    let all = cluster::drawn(&viewer.document, &drawn.cut).into_iter();
                    all.filter_map(|id| viewer.cluster(&view, drawn, id))
                        .map(|cluster| cluster.slot)
                        .collect()
                };
                let (both, old) = (slots(&viewer.cluster_list), slots(&fading.leaving_clusters));
                let new = slots(&fading.arriving_clusters);
                assert!(both.is_disjoint(&old) && both.is_disjoint(&new) && old.is_disjoint(&new));
                let fade = viewer.fade.as_ref().unwrap();
                assert_eq!(&both | &old, of(&fade.leaving));
                assert_eq!(&both | &new, of(&viewer.drawn));
                leaving += old.len();
                arriving += new.len();
                steady += both.len();
            }
            assert!(
                leaving > 20 && arriving > 20 && steady > 0,
                "{leaving} {arriving} {steady}"
            );
            network.settle(&mut viewer);
            assert!(viewer.fading.is_none());
        }
    }

    #[test]
    fn settled_cut_is_that_of_no_transition() {
        let mut network = Network::new(Shape::Torus, 52);
        let mut cuts = Vec::new();
        for transition in [Transition::None, Transition::Alpha, Transition::Dither] {
            let mut viewer = network.viewer(ViewerOptions {
                transition,
                ..ViewerOptions::default()
            });
            network.open.clear();
            network.settle(&mut viewer);
            cuts.push((viewer.drawn.cut.clone(), viewer.draw_list.clone()));
        }
        assert!(
            cuts.iter()
                .all(|(cut, list)| *cut == cuts[0].0 && list.ends == cuts[0].1.ends)
        );
    }
}
