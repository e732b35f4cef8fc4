//! Along camera paths (`tests/paths`), with pages that come late, out of order, damaged or not at all and a cache that holds a part
//! of them, every frame is whole.
//!
//! A pixel that the drawn cut covers, as the CPU sees it, but for a rim of one, is drawn over two backgrounds: where it differs it is a hole.
//! The surface may have any colours. With `MARQUETRY_ALL_VIEWS=1` every frame is looked at, and not every fourth, charts and the largest
//! textured scan as well.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_engine::{Background, ViewerOptions, Viewport};
use marquetry_native::{Headless, path};
use marquetry_tests::network::{Network, Rule};
use marquetry_tests::raster::AROUND_FOUR_SAMPLES;
use marquetry_tests::stage::{MAGENTA, Stage, wants_all_views};
use marquetry_tests::{WITH_CHARTS, convert, data};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const PATHS: [&str; 5] = [
    "approach",
    "orbit",
    "fly-through",
    "teleport",
    "oscillation",
];
/// What no surface here is, and what differs from it in all channels.
const BACKGROUNDS: [Background; 2] = [Background(MAGENTA), Background([0, 255, 0])];
/// Answers take up to ten frames, one in five is a failure or damaged.
const RULE: Rule = Rule {
    delay: 0..10,
    corrupt: 0.1,
    failing: 0.1,
    silent: 0.0,
};

fn file_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("paths")
        .join(name)
        .with_extension("json")
}

/// Frames and what was seen on the way.
#[derive(Debug, Default)]
struct Seen {
    frames: usize,
    in_motion: usize,
    faults: usize,
    overtaken: usize,
    evictions: u64,
}

/// Flies all paths over a file, with a cache of so many times its length; `together` is that of `raster::Picture`.
fn fly(marq: &Path, cache: f64, together: usize) -> Seen {
    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let viewport = Viewport::new(320, 240);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some bytes"
    )]
    let cache_bytes = (cache * bytes.len() as f64) as u64;
    let options = |background| ViewerOptions {
        cache_bytes,
        background,
        ..ViewerOptions::default()
    };
    let headless = Headless::new().unwrap();
    let mut stage = Stage::open(&headless, bytes, options(BACKGROUNDS[0]), viewport).unwrap();
    let metadata = stage.viewer().document().metadata.clone();
    let mut network = Network::new(RULE, 11);
    let mut seen = Seen::default();
    for name in PATHS {
        let path = path::read(&file_of(name), &metadata).unwrap();
        assert!(path.fps.is_some() && path.cameras.len() == 40, "{name}");
        let mut covered = 0;
        for (frame, camera) in path.cameras.into_iter().enumerate() {
            stage.viewer().set_camera(camera);
            network.step(&mut stage).unwrap();
            if frame % 4 > 0 && !wants_all_views() {
                continue;
            }
            let drawn = stage.viewer().drawn();
            seen.in_motion +=
                usize::from(!drawn.group_morphs.is_empty() || !drawn.morphs.is_empty());
            let inside = stage
                .inside_from_within(&AROUND_FOUR_SAMPLES, together)
                .unwrap();
            covered += inside.count();
            let pictures = BACKGROUNDS.map(|background| {
                stage.viewer().set_options(options(background)).unwrap();
                stage.draw().unwrap()
            });
            let [one, other] = pictures.each_ref().map(|rgba| rgba.as_chunks::<4>().0);
            let pixels = one.iter().zip(other).zip(inside.as_slice()).enumerate();
            let mut holes = pixels.filter(|(_, ((a, b), inside))| **inside && a != b);
            if let Some((pixel, _)) = holes.next() {
                panic!(
                    "{}: {name}, frame {frame}: {} holes, the first at {}, {}; {:?}",
                    marq.display(),
                    1 + holes.count(),
                    pixel % 320,
                    pixel / 320,
                    stage.viewer().stats()
                );
            }
            seen.frames += 1;
        }
        assert!(covered > 10_000, "{name}: {covered} pixels were looked at");
    }
    seen.evictions = stage.viewer().stats().cache.evictions;
    (seen.faults, seen.overtaken) = (network.faults, network.overtaken);
    eprintln!("{}: {seen:?}", marq.display());
    seen
}

/// Flies over a scan, converted so, with all that its file takes and with a cache that does not hold it.
fn assert_whole(scan: &str, way: &[&str], caches: [f64; 2], together: usize) {
    let Some(input) = data::find(scan) else {
        return;
    };
    let marq = convert(&input, way).unwrap().path;
    let [large, small] = caches.map(|cache| fly(&marq, cache, together));
    assert!(large.faults + small.faults > 0 && large.overtaken + small.overtaken > 0);
    assert_eq!(large.evictions, 0, "{large:?}");
    assert!(small.evictions > 0, "{small:?}");
    assert!(large.in_motion > 0 || small.in_motion > 0);
}

#[test]
fn dragon_is_whole_along_paths() {
    assert_whole("dragon_vrip.ply", &[], [1000.0, 8.0], 1);
    if wants_all_views() {
        assert_whole("dragon_vrip.ply", WITH_CHARTS, [1000.0, 2.0], 1);
    }
}

/// Its sheets end where others go on, with other vertices: there the last bit of an edge decides.
#[test]
fn torn_scan_is_whole_along_paths() {
    assert_whole("komaba_scan_1m.ply", &[], [1000.0, 2.0], 4);
}

#[test]
fn textured_scans_are_whole_along_paths() {
    assert_whole("textured_meshroom/texturedMesh.obj", &[], [1000.0, 4.0], 1);
    if wants_all_views() {
        assert_whole("komaba_textured_600k.glb", &[], [1000.0, 2.0], 4);
    }
}
