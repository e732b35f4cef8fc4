//! Whole viewing sessions against a made-up network: late, out of order, corrupt, never.

mod groups;

use super::*;
use crate::Transition;
use crate::colour::map::NO_TILES;
use crate::lod::balance;
use crate::lod::cluster;
use crate::lod::cut::{Across, SIDES};
use crate::lod::desire::Target;
use crate::lod::residency::needed_pages;
use crate::residency::textures::Part;
use crate::testing::{Random, Shape, clustered, clustered_with, random_finest};
use glam::DVec3;
use marquetry_format::{ByteSource, Limits, NodeId};
use std::collections::BTreeMap;

pub(super) const VIEWPORT: Viewport = Viewport {
    width: 800,
    height: 600,
};

/// A file, and requests that have not been answered yet.
pub(super) struct Network {
    pub(super) file: Vec<u8>,
    pub(super) open: Vec<Request>,
    random: Random,
    /// One in this many answers is an error, cut short, or has a flipped bit; 0 for none.
    faulty_one_in: u32,
}

impl Network {
    pub(super) fn new(shape: Shape, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let finest = random_finest(&mut random, &shape.charts(5), 3, 5);
        Self {
            random,
            ..Self::of(shape.write(&finest).unwrap(), seed)
        }
    }

    pub(super) fn of(file: Vec<u8>, seed: u64) -> Self {
        Self {
            file,
            open: Vec::new(),
            random: Random::new(seed),
            faulty_one_in: 0,
        }
    }

    /// With colour tiles down to level 5, here and there.
    pub(super) fn textured(shape: Shape, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let finest = random_finest(&mut random, &shape.charts(5), 2, 5);
        let mut choose = Random::new(seed + 1);
        let mut has_child = |node: NodeId| node.level <= 5 && choose.below(8) > 1;
        Self {
            file: shape.write_textured(&finest, &mut has_child).unwrap(),
            open: Vec::new(),
            random,
            faulty_one_in: 0,
        }
    }

    pub(super) fn viewer(&self, options: ViewerOptions) -> Viewer {
        Viewer::new(
            Document::open(&self.file, Limits::default()).unwrap(),
            options,
        )
        .unwrap()
    }

    /// One frame: some requests are answered, in any order.
    pub(super) fn frame(&mut self, viewer: &mut Viewer, seconds: f64) {
        self.open.extend(viewer.update(seconds, VIEWPORT));
        for _ in 0..self.random.below(4) {
            if self.open.is_empty() {
                break;
            }
            let index = self.random.below(u32::try_from(self.open.len()).unwrap()) as usize;
            let request = self.open.swap_remove(index);
            let mut answer = Ok(self.file.read(request.range).unwrap());
            if self.faulty_one_in > 0 && self.random.below(self.faulty_one_in) == 0 {
                answer = self.spoil(answer);
            }
            viewer.deliver(request.id, answer);
        }
    }

    fn spoil(&mut self, answer: Result<Vec<u8>, String>) -> Result<Vec<u8>, String> {
        let mut bytes = answer?;
        match self.random.below(3) {
            0 => return Err("connection reset".to_owned()),
            1 => bytes.truncate(bytes.len() / 2),
            _ => {
                let bit = self.random.below(u32::try_from(8 * bytes.len()).unwrap()) as usize;
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
        Ok(bytes)
    }

    pub(super) fn settle(&mut self, viewer: &mut Viewer) {
        for _ in 0..5000 {
            self.frame(viewer, 0.05);
            check(viewer);
            if viewer.is_settled() {
                return;
            }
        }
        panic!("does not settle: {:?}", viewer.stats());
    }
}

/// What holds in every frame, whatever is in memory.
#[expect(clippy::float_cmp, reason = "exact by construction")]
pub(super) fn check(viewer: &Viewer) {
    let stats = viewer.stats();
    assert!(stats.cache.used_bytes <= stats.cache.capacity_bytes);
    let drawn = viewer.drawn();
    let charts = &viewer.document.charts;
    assert!(balance::is_balanced(&drawn.cut, charts));
    let view = viewer.view.unwrap();
    let mut seen = 0;
    for leaf in drawn.cut.leaves() {
        let bounds = viewer.forest.bounds(&viewer.document, leaf.node).unwrap();
        seen += u64::from(view.sees(&bounds));
        if SIDES
            .iter()
            .any(|side| drawn.cut.across(charts, leaf, *side) == Across::Finer)
        {
            assert_eq!(morph_of(&drawn.morphs, leaf), 0.0);
        }
    }
    for id in cluster::drawn(&viewer.document, &drawn.cut) {
        let tree = viewer.document.clusters.as_ref().unwrap();
        let bounds = if drawn.cluster_morph(tree, id) > 0.0 {
            morph::bounds(tree, id).unwrap()
        } else {
            tree.node(id).unwrap().bounds
        };
        seen += u64::from(view.sees(&bounds));
    }
    // What moves is drawn itself, and not in part by what is finer.
    for id in drawn.group_morphs.keys() {
        let tree = viewer.document.clusters.as_ref().unwrap();
        let mut children = tree.group(*id).unwrap().children.clone();
        assert!(!children.any(|child| drawn.cut.is_cluster_split(ClusterId(child))));
    }
    // Every leaf and every cluster that may be seen is in memory: no hole. While a picture fades the old one's are drawn, too.
    match &viewer.fade {
        None => assert_eq!(stats.nodes, seen),
        Some(fade) => {
            assert!(stats.nodes >= seen);
            for needed in needed_pages(&fade.leaving.cut, &viewer.document) {
                assert!(viewer.table.contains(needed.page));
            }
            for needed in cluster::needed(&viewer.document, &fade.leaving.cut) {
                assert!(viewer.table.contains(needed.page));
            }
        }
    }
    for needed in cluster::needed(&viewer.document, &drawn.cut) {
        assert!(viewer.table.contains(needed.page));
    }
    for needed in needed_pages(&drawn.cut, &viewer.document) {
        assert!(viewer.table.contains(needed.page));
    }
}

fn random_camera(random: &mut Random, metadata: &marquetry_format::Metadata) -> Camera {
    let point = |random: &mut Random, size: f64| {
        DVec3::from_array([0; 3].map(|_| size * (2.0 * random.unit() - 1.0)))
    };
    let eye = point(random, 3.0);
    let target = point(random, 0.5);
    Camera {
        eye,
        target,
        ..Camera::standard(metadata, 0, 1.0).unwrap()
    }
}

#[test]
fn settles_from_every_side_without_a_hole_and_within_budget() {
    for (shape, seed) in [(Shape::Cube, 1), (Shape::Torus, 2), (Shape::Strip, 3)] {
        let mut network = Network::new(shape, seed);
        for cache_bytes in [0, 50_000, 400_000, 1 << 30] {
            let mut viewer = network.viewer(ViewerOptions {
                cache_bytes,
                ..ViewerOptions::default()
            });
            network.open.clear();
            for index in [0, 4, 9, 25] {
                viewer.set_camera(Camera::standard(&viewer.document.metadata, index, 1.6).unwrap());
                network.settle(&mut viewer);
            }
            assert!(viewer.is_ready() && !viewer.needs_update());
            assert_eq!(viewer.stats().pages.missing, 0);
        }
    }
}

#[test]
fn settled_cut_depends_on_the_view_alone() {
    let mut network = Network::new(Shape::Cube, 4);
    for cache_bytes in [150_000, 1 << 30] {
        let options = ViewerOptions {
            cache_bytes,
            ..ViewerOptions::default()
        };
        let mut wanderer = network.viewer(options.clone());
        for _ in 0..6 {
            let camera = random_camera(&mut network.random, &wanderer.document.metadata);
            wanderer.set_camera(camera);
            network.open.clear();
            network.settle(&mut wanderer);
            let mut fresh = network.viewer(options.clone());
            fresh.set_camera(camera);
            let open = std::mem::take(&mut network.open);
            network.settle(&mut fresh);
            network.open = open;
            assert_eq!(fresh.drawn().cut, wanderer.drawn().cut);
        }
    }
}

#[test]
fn teleports_and_spins_never_show_a_hole() {
    let mut network = Network::new(Shape::Cube, 5);
    network.faulty_one_in = 5;
    let mut viewer = network.viewer(ViewerOptions {
        cache_bytes: 300_000,
        ..ViewerOptions::default()
    });
    for frame in 0..400 {
        if frame % 7 == 0 {
            let camera = random_camera(&mut network.random, &viewer.document.metadata);
            viewer.set_camera(camera);
        }
        network.frame(&mut viewer, 0.016);
        check(&viewer);
    }
    network.settle(&mut viewer);
    assert!(viewer.stats().failures > 0 && viewer.stats().cache.evictions > 0);
}

#[test]
fn clusters_stream_within_the_same_budget() {
    let mut network = Network::of(clustered(600).unwrap().1, 13);
    network.faulty_one_in = 6;
    let mut finest = 0;
    for cache_bytes in [0, 100_000, 400_000, 1 << 30] {
        let mut viewer = network.viewer(ViewerOptions {
            cache_bytes,
            ..ViewerOptions::default()
        });
        network.open.clear();
        for round in 0..6 {
            let camera = random_camera(&mut network.random, &viewer.document.metadata);
            viewer.set_camera(camera);
            for _ in 0..20 * (round % 2) {
                network.frame(&mut viewer, 0.016);
                check(&viewer);
            }
        }
        viewer.set_camera(Camera::standard(&viewer.document.metadata, 0, 0.7).unwrap());
        network.settle(&mut viewer);
        check(&viewer);
        let nodes = cluster::drawn(&viewer.document, &viewer.drawn().cut).len();
        assert!(nodes >= finest, "{nodes} after {finest}");
        finest = nodes;
    }
    assert!(finest > 20, "the test has seen {finest} clusters");
}

/// However large the cache: devices have so many slots and no more.
#[test]
fn more_clusters_than_slots_are_shown_coarser() {
    let (document, bytes) = clustered(150_000).unwrap();
    let mut viewer = Viewer::new(
        document,
        ViewerOptions {
            error_px: 1e-2,
            cache_bytes: 4 << 30,
            ..ViewerOptions::default()
        },
    )
    .unwrap();
    for _ in 0..400 {
        for request in viewer.update(0.1, VIEWPORT) {
            let answer = bytes.read(request.range).unwrap();
            viewer.deliver(request.id, Ok(answer));
        }
        if viewer.is_settled() {
            break;
        }
    }
    let stats = viewer.stats();
    assert!(viewer.is_settled(), "{stats:?}");
    assert!(stats.error_px > 1e-2 && stats.pages.missing == 0);
    // The level above the leaves, which are too many, and a chart.
    assert_eq!(stats.nodes, 3750 + 1, "{stats:?}");
}

/// What the renderer would know of textures: which slots show one.
fn follow(viewer: &mut Viewer, shown: &mut BTreeMap<u32, Part>) {
    for change in viewer.take_texture_changes() {
        match change {
            TextureChange::Shown { slot, part, .. } => {
                shown.insert(slot, part);
            }
            TextureChange::Gone { slot } => {
                shown.remove(&slot);
            }
        }
    }
}

#[test]
fn textures_of_clusters_are_there_where_there_is_room_for_them() {
    let frame = include_bytes!("../../../../format/tests/data/texture_16x24.vp8");
    let mut network = Network::of(clustered_with(600, Some(frame)).unwrap().1, 15);
    network.faulty_one_in = 6;
    for cache_bytes in [0, 2 << 20, 8 << 20, 1 << 30] {
        let mut viewer = network.viewer(ViewerOptions {
            cache_bytes,
            ..ViewerOptions::default()
        });
        network.open.clear();
        let mut shown = BTreeMap::new();
        for round in 0..8 {
            let camera = random_camera(&mut network.random, &viewer.document.metadata);
            viewer.set_camera(camera);
            for _ in 0..20 * (round % 2) {
                network.frame(&mut viewer, 0.016);
                // A slot that gets another mesh has no texture until it is said to have one.
                for upload in viewer.take_cluster_uploads() {
                    shown.remove(&upload.slot);
                }
                follow(&mut viewer, &mut shown);
                check(&viewer);
            }
        }
        viewer.set_camera(Camera::standard(&viewer.document.metadata, 0, 0.7).unwrap());
        network.settle(&mut viewer);
        for upload in viewer.take_cluster_uploads() {
            shown.remove(&upload.slot);
        }
        follow(&mut viewer, &mut shown);
        assert!(viewer.table.texture_bytes() <= cache_bytes / 2);
        // No two clusters share a part.
        let corners: BTreeSet<[u32; 3]> = shown.values().map(|part| part.corner()).collect();
        assert_eq!(corners.len(), shown.len());
        let seen = viewer.seen_textures.len();
        let drawn = viewer.seen_textures.iter().filter(|(key, _)| {
            let slot = viewer.table.cluster_slot(*key);
            slot.is_some_and(|slot| shown.contains_key(&slot))
        });
        if cache_bytes == 1 << 30 {
            assert!(seen > 20, "the test has seen {seen} textures");
            assert_eq!(drawn.count(), seen);
        } else if cache_bytes > 0 {
            assert!(drawn.count() > 0);
        }
    }
}

#[test]
fn clusters_are_split_for_texels_as_well_as_for_error() {
    let frame = include_bytes!("../../../../format/tests/data/texture_16x24.vp8");
    let drawn = |frame: Option<&[u8]>| {
        let mut network = Network::of(clustered_with(600, frame).unwrap().1, 16);
        let mut viewer = network.viewer(ViewerOptions::default());
        viewer.set_camera(Camera::standard(&viewer.document.metadata, 0, 40.0).unwrap());
        network.settle(&mut viewer);
        cluster::drawn(&viewer.document, &viewer.drawn().cut).len()
    };
    // Errors grow by four from level to level as texels do, but are longer: they decide.
    assert_eq!(drawn(None), drawn(Some(frame)));
    let document = clustered_with(600, Some(frame)).unwrap().0;
    let tree = document.clusters.as_ref().unwrap();
    let forest = Forest::new(&document);
    let camera = Camera::standard(&document.metadata, 0, 2.5).unwrap();
    let view = View::new(&camera, &document.metadata, VIEWPORT);
    let target = Target {
        view: &view,
        // So large an error is allowed that only texels ask for more.
        error_px: 1e6,
        paged_error_px: 1e6,
        previous: None,
    };
    let cut = forest.want(&document, &target).cut;
    assert!(cluster::drawn(&document, &cut).len() > 1);
    for id in cluster::drawn(&document, &cut) {
        let node = tree.node(id).unwrap();
        let texel_px = view.error_px(node.texel.unwrap(), &node.bounds);
        assert!(texel_px <= 1.0 || node.children.is_empty() || !view.sees(&node.bounds));
    }
}

#[test]
fn far_clusters_are_drawn_as_one() {
    let mut network = Network::of(clustered(600).unwrap().1, 14);
    let mut viewer = network.viewer(ViewerOptions::default());
    viewer.set_camera(Camera::standard(&viewer.document.metadata, 0, 4000.0).unwrap());
    network.settle(&mut viewer);
    assert_eq!(
        cluster::drawn(&viewer.document, &viewer.drawn().cut).len(),
        1
    );
    assert_eq!(viewer.stats().pages.fetched, 0);
}

#[test]
fn faults_are_reported_and_overcome() {
    let mut network = Network::new(Shape::Torus, 6);
    network.faulty_one_in = 2;
    let mut viewer = network.viewer(ViewerOptions::default());
    network.settle(&mut viewer);
    let words = viewer.take_failures();
    assert!(!words.is_empty() && viewer.take_failures().is_empty());
    let mut clean = network.viewer(ViewerOptions::default());
    network.faulty_one_in = 0;
    network.open.clear();
    network.settle(&mut clean);
    assert_eq!(viewer.drawn().cut, clean.drawn().cut);
}

#[test]
fn pages_that_never_come_leave_the_coarser_picture() {
    let mut network = Network::new(Shape::Cube, 7);
    let mut viewer = network.viewer(ViewerOptions::default());
    viewer.set_page_filter(Some(Box::new(|page| page.0 % 3 != 1)));
    network.settle(&mut viewer);
    assert!(viewer.stats().pages.missing > 0);
    let resident = |needed: &&Needed| viewer.table.contains(needed.page);
    assert!(
        viewer
            .needed
            .iter()
            .filter(resident)
            .all(|needed| needed.page.0 % 3 != 1)
    );
    let coarse = viewer.stats().triangles;
    viewer.set_page_filter(None);
    network.settle(&mut viewer);
    assert_eq!(viewer.stats().pages.missing, 0);
    assert!(viewer.stats().triangles > coarse);
}

#[test]
fn camera_inside_the_model_is_drawn_to_the_finest() {
    let mut network = Network::new(Shape::Cube, 8);
    let mut viewer = network.viewer(ViewerOptions::default());
    let surface = DVec3::new(0.0, 0.0, 0.8);
    viewer.set_camera(Camera {
        eye: surface,
        target: DVec3::ZERO,
        up: DVec3::Y,
    });
    network.settle(&mut viewer);
    check(&viewer);
    assert!(viewer.stats().triangles > 0);
}

#[test]
fn no_transition_changes_at_once() {
    let mut network = Network::new(Shape::Cube, 9);
    let mut viewer = network.viewer(ViewerOptions {
        transition: Transition::None,
        ..ViewerOptions::default()
    });
    for _ in 0..200 {
        network.frame(&mut viewer, 0.016);
        assert!(viewer.drawn().morphs.is_empty() && *viewer.drawn() == viewer.target);
    }
}

#[test]
#[expect(clippy::float_cmp, reason = "exact by construction")]
fn nothing_is_done_while_nothing_changes() {
    let mut network = Network::new(Shape::Cube, 10);
    let mut viewer = network.viewer(ViewerOptions::default());
    network.settle(&mut viewer);
    viewer.mark_drawn();
    for _ in 0..10 {
        assert!(viewer.update(0.5, VIEWPORT).is_empty());
        assert!(!viewer.needs_redraw() && !viewer.needs_update() && viewer.is_settled());
    }
    assert_eq!(viewer.progress(), 1.0);
}

#[test]
fn cameras_and_times_that_are_not_finite_are_ignored() {
    let mut network = Network::new(Shape::Cube, 11);
    let mut viewer = network.viewer(ViewerOptions::default());
    let before = viewer.camera();
    viewer.set_camera(Camera {
        eye: DVec3::splat(f64::NAN),
        ..before
    });
    viewer.set_camera(Camera {
        eye: before.target,
        ..before
    });
    assert_eq!(viewer.camera(), before);
    network.open.extend(viewer.update(f64::NAN, VIEWPORT));
    network
        .open
        .extend(viewer.update(-1.0, Viewport::new(0, 0)));
    network.settle(&mut viewer);
}

#[test]
fn options_outside_their_range_are_refused() {
    let network = Network::new(Shape::Strip, 12);
    let mut viewer = network.viewer(ViewerOptions::default());
    for bad in [
        ViewerOptions {
            error_px: 0.0,
            ..ViewerOptions::default()
        },
        ViewerOptions {
            error_px: f64::NAN,
            ..ViewerOptions::default()
        },
        ViewerOptions {
            morph_seconds: -1.0,
            ..ViewerOptions::default()
        },
        ViewerOptions {
            pages_per_update: 0,
            ..ViewerOptions::default()
        },
    ] {
        assert!(viewer.set_options(bad).is_err());
    }
    assert_eq!(viewer.options(), &ViewerOptions::default());
}

#[test]
fn colour_tiles_arrive_over_a_bad_network_within_their_budget() {
    for seed in 0..3 {
        let mut network = Network::textured(Shape::Cube, seed);
        network.faulty_one_in = 4;
        let mut viewer = network.viewer(ViewerOptions {
            cache_bytes: 24 << 20,
            ..ViewerOptions::default()
        });
        network.settle(&mut viewer);
        let stats = viewer.stats();
        assert!(
            stats.tiles.fetched > 6 && stats.tiles.missing == 0,
            "{stats:?}"
        );
        assert!(stats.tiles.failures > 0, "{stats:?}");
        assert!(stats.tiles.used_bytes <= viewer.options().cache_bytes / 2);
        let layer = viewer.colour.as_ref().unwrap();
        assert!(
            viewer
                .draw_list
                .instances
                .iter()
                .all(|i| i.tiles[1] != NO_TILES)
        );
        // Nothing fades any more: every entry has a tile, sharp and whole.
        for entry in &layer.map().entries {
            assert!(entry[5] <= 0.0 && entry[6] >= 1.0, "{entry:?}");
        }
    }
}

#[test]
fn few_bytes_mean_coarser_tiles_and_still_settle() {
    let mut network = Network::textured(Shape::Cube, 9);
    let mut fetched = Vec::new();
    for cache_bytes in [1 << 14, 1 << 18, 1 << 26] {
        let mut viewer = network.viewer(ViewerOptions {
            cache_bytes,
            ..ViewerOptions::default()
        });
        network.settle(&mut viewer);
        fetched.push(viewer.stats().tiles.fetched);
        network.open.clear();
    }
    assert!(
        fetched[0] < fetched[1] && fetched[1] < fetched[2],
        "{fetched:?}"
    );
}

#[test]
fn the_whole_model_is_seen_in_a_window_of_any_shape() {
    use crate::controls::Key;
    let network = Network::new(Shape::Cube, 5);
    let mut viewer = network.viewer(ViewerOptions::default());
    let distance = |viewer: &Viewer| {
        let camera = viewer.camera();
        (camera.eye - camera.target).length()
    };
    let shapes =
        [[800, 600], [360, 720], [600, 600], [1600, 200]].map(|[w, h]| Viewport::new(w, h));
    let near = distance(&viewer);
    let key = |key| InputEvent::KeyDown {
        key,
        modifiers: crate::Modifiers::default(),
    };
    for (viewport, expected) in shapes.into_iter().zip([1.0, 2.0, 1.0, 1.0]) {
        viewer.update(0.0, viewport);
        assert!((distance(&viewer) / near - expected).abs() < 1e-12);
    }
    // A camera that was chosen stays, until the view of the whole model is asked for.
    viewer.handle(key(Key::ArrowLeft));
    viewer.update(0.0, shapes[1]);
    assert!((distance(&viewer) / near - 1.0).abs() < 1e-12);
    viewer.handle(key(Key::Digit(2)));
    assert!((distance(&viewer) / near - 2.0).abs() < 1e-12);
    viewer.update(0.0, shapes[0]);
    assert!((distance(&viewer) / near - 1.0).abs() < 1e-12);
    assert!(viewer.frame_model(26).is_err());
}

#[test]
fn a_double_click_brings_the_point_to_the_middle() {
    let mut network = Network::new(Shape::Cube, 21);
    for morph_seconds in [0.0, 0.25] {
        let mut viewer = network.viewer(ViewerOptions {
            morph_seconds,
            ..ViewerOptions::default()
        });
        network.open.clear();
        network.settle(&mut viewer);
        let place = [470.0, 250.0];
        let pick = viewer.pick(place).unwrap();
        let before = viewer.camera();
        assert!(viewer.handle(InputEvent::DoubleClick { position: place }));
        assert!(viewer.needs_update());
        network.frame(&mut viewer, 0.1);
        let arrived = (viewer.camera().target - pick.world).length() < 1e-9;
        assert_eq!(arrived, morph_seconds == 0.0);
        network.settle(&mut viewer);
        assert!((viewer.camera().target - pick.world).length() < 1e-9);
        let reach = |camera: Camera| (camera.eye - pick.world).length();
        assert!((reach(viewer.camera()) - reach(before)).abs() < 1e-9);
        // The background is no place to go, and input ends a journey.
        assert!(!viewer.handle(InputEvent::DoubleClick { position: [0.0; 2] }));
        assert!(viewer.handle(InputEvent::DoubleClick {
            position: [400.0, 250.0]
        }));
        network.frame(&mut viewer, 0.05);
        viewer.handle(InputEvent::Wheel {
            notches: 0.0,
            position: place,
        });
        let stopped = viewer.camera();
        network.settle(&mut viewer);
        assert!(viewer.camera() == stopped);
    }
}

#[test]
fn a_frozen_cut_stays_wherever_one_looks_from() {
    let mut network = Network::new(Shape::Cube, 22);
    let mut viewer = network.viewer(ViewerOptions::default());
    network.settle(&mut viewer);
    let key = InputEvent::KeyDown {
        key: crate::Key::Letter('z'),
        modifiers: crate::Modifiers::default(),
    };
    assert!(viewer.handle(key) && viewer.options().freeze);
    let frozen = viewer.drawn().cut.clone();
    let metadata = viewer.document.metadata.clone();
    viewer.set_camera(Camera::standard(&metadata, 2, 0.9).unwrap());
    network.settle(&mut viewer);
    assert!(!viewer.needs_update() && viewer.drawn().cut == frozen);
    assert!(viewer.handle(key) && viewer.needs_update());
    network.settle(&mut viewer);
    assert_ne!(viewer.drawn().cut, frozen);
}

#[test]
fn a_wheel_keeps_the_point_below_it() {
    let mut network = Network::new(Shape::Cube, 23);
    let mut viewer = network.viewer(ViewerOptions::default());
    network.settle(&mut viewer);
    let position = [470.0, 250.0];
    let world = viewer.pick(position).unwrap().world;
    for notches in [-3.0, -1.0, 2.0] {
        viewer.handle(InputEvent::Wheel { notches, position });
        let [x, y, _] = viewer.project(world).unwrap();
        assert!((x - position[0]).hypot(y - position[1]) < 1e-4);
    }
}
