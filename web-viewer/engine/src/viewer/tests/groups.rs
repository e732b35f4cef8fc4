//! Sessions with clusters whose groups have several members.

use super::*;
use crate::testing::Wall;

/// Frames over a bad network from many sides, then from near by; after every one the wall is whole and in memory.
fn session(wall: &Wall, network: &mut Network, cache_bytes: u64) -> Viewer {
    let mut viewer = network.viewer(ViewerOptions {
        cache_bytes,
        ..ViewerOptions::default()
    });
    network.open.clear();
    let frame = |network: &mut Network, viewer: &mut Viewer| {
        network.frame(viewer, 0.016);
        check(viewer);
        wall.assert_whole(&viewer.drawn().cut);
    };
    for round in 0..6 {
        let camera = random_camera(&mut network.random, &viewer.document.metadata);
        viewer.set_camera(camera);
        for _ in 0..15 * (round % 2) {
            frame(network, &mut viewer);
        }
    }
    viewer.set_camera(Camera::standard(&viewer.document.metadata, 0, 0.7).unwrap());
    network.settle(&mut viewer);
    frame(network, &mut viewer);
    viewer
}

#[test]
fn groups_stream_within_a_budget_and_without_a_crack() {
    let wall = Wall::new(150, None).unwrap();
    let mut network = Network::of(wall.file.clone(), 51);
    network.faulty_one_in = 6;
    let mut finest = 0;
    for cache_bytes in [0, 150_000, 600_000, 1 << 30] {
        let viewer = session(&wall, &mut network, cache_bytes);
        let nodes = cluster::drawn(&viewer.document, &viewer.drawn().cut).len();
        assert!(nodes >= finest, "{nodes} after {finest}");
        finest = nodes;
        if cache_bytes == 1 << 30 {
            // Everything that is wanted is there.
            assert_eq!(viewer.drawn().cut, viewer.wanted.cut);
        }
    }
    assert!(finest > 20, "the test has seen {finest} clusters");
}

#[test]
fn children_that_lie_on_their_group_give_way_to_it() {
    let wall = Wall::new(150, None).unwrap();
    let mut network = Network::of(wall.file.clone(), 53);
    let mut viewer = network.viewer(ViewerOptions::default());
    let (mut held_back, mut moving) = (0, 0);
    for frame in 0_i32..1600 {
        // Away and back.
        let distance = 2.0 * 1.005f64.powi(800 - (800 - frame).abs());
        let camera = Camera::standard(&viewer.document.metadata, 0, distance).unwrap();
        viewer.set_camera(camera);
        if frame == 0 {
            network.settle(&mut viewer);
        }
        network.frame(&mut viewer, 0.016);
        check(&viewer);
        wall.assert_whole(&viewer.drawn().cut);
        let drawn = viewer.drawn();
        assert!(drawn.group_morphs.values().all(|morph| *morph < 1.0));
        moving += usize::from(!drawn.group_morphs.is_empty());
        held_back += usize::from(drawn.cut != viewer.wanted.cut);
    }
    assert!(moving > 50 && held_back > 20, "{moving}, {held_back}");
}

#[test]
fn textures_of_groups_are_shown_and_picks_meet_what_is_drawn() {
    let frame = include_bytes!("../../../../../format/tests/data/texture_16x24.vp8");
    let wall = Wall::new(60, Some(frame)).unwrap();
    let mut network = Network::of(wall.file.clone(), 52);
    let mut viewer = session(&wall, &mut network, 1 << 30);
    let mut shown = BTreeMap::new();
    follow(&mut viewer, &mut shown);
    assert!(viewer.seen_textures.len() > 10);
    for (key, _) in &viewer.seen_textures {
        let slot = viewer.table.cluster_slot(*key).unwrap();
        assert!(shown.contains_key(&slot));
    }
    let mut met = 0;
    for direction in 0..8 {
        let camera = Camera::standard(&viewer.document.metadata, direction, 1.4).unwrap();
        viewer.set_camera(camera);
        network.settle(&mut viewer);
        met += middles_met(&viewer);
    }
    assert!(met > 50, "only {met} were met");
}

/// Of how many drawn clusters the middle of the first triangle is met where it is in the picture; elsewhere something is before it.
fn middles_met(viewer: &Viewer) -> usize {
    let document = &viewer.document;
    let lattice = &document.metadata.lattice;
    let mut met = 0;
    for id in cluster::drawn(document, &viewer.drawn().cut) {
        let mesh = viewer.table.cluster_mesh(document.page_of_cluster(id));
        let mesh = mesh.unwrap();
        let corners = mesh.triangles[0].map(|corner| {
            let point = mesh.positions[usize::from(corner)];
            DVec3::from_array(point.map(f64::from))
        });
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let world = DVec3::from_array(lattice.origin) + lattice.step * middle;
        let Some([x, y, _]) = viewer.project(world) else {
            continue;
        };
        if x < 0.0 || y < 0.0 || x > f64::from(VIEWPORT.width) || y > f64::from(VIEWPORT.height) {
            continue;
        }
        let pick = viewer.pick([x, y]).unwrap();
        let (eye, near) = (viewer.camera.eye, 1e-6);
        assert!((pick.world - eye).length() <= (world - eye).length() + near);
        met += usize::from((pick.world - world).length() < near && pick.node.is_none());
    }
    met
}
