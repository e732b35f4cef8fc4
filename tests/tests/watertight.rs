//! A closed surface drawn over magenta shows none of it, whatever is in the cache.
//!
//! 26 views in 10 random cache states, at rest and on the way from one cut to another, each state from one of 3 distances in turn; with
//! `MARQUETRY_ALL_VIEWS=1` every state from all of them, which takes three times as long. The criterion is exact: every pixel that the drawn cut covers, as the CPU sees it, but for a rim of one pixel. A coarse surface may lie
//! within the finest one, so against the exported mesh only the finest state is compared.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_engine::camera::STANDARD_VIEWS;
use marquetry_engine::{Background, ViewerOptions, Viewport};
use marquetry_evaluation::image::Image;
use marquetry_native::Headless;
use marquetry_tests::raster::{AROUND_FOUR_SAMPLES, coverage};
use marquetry_tests::stage::{MAGENTA, Stage, bits, holes, wants_all_views};
use marquetry_tests::{BOTH_WAYS, WITH_CHARTS, arguments, convert, data, marquetry, meshes, ply};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// Bounding-sphere radii: close up, as a user sees it first, and far.
const DISTANCES: [f64; 3] = [1.25, 2.5, 7.0];
/// Part of the pages that may be fetched, by cache state: from the base alone to everything.
const SHARES: [f64; 10] = [0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.85, 0.92, 0.97, 1.0];

fn viewport() -> Viewport {
    Viewport::new(320, 240)
}

fn options(error_px: f64) -> ViewerOptions {
    ViewerOptions {
        error_px,
        background: Background(MAGENTA),
        ..ViewerOptions::default()
    }
}

/// Whether a view from a distance is looked at in a state of the cache: all where that is asked for, or a third of them, others in each state.
fn is_looked_at(state: usize, view: usize, distance: usize) -> bool {
    wants_all_views() || (state + view + distance).is_multiple_of(DISTANCES.len())
}

/// Draws pictures of a file, with an error of so many pixels, and asserts that none has a hole.
fn assert_no_holes(name: &str, marq: &Path, error_px: f64) {
    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let headless = Headless::new().unwrap();
    let (mut pictures, mut wanted) = (0, 0);
    let mut in_motion = 0;
    let mut finer_than_base = 0;
    let mut has_charts = false;
    for (state, share) in SHARES.into_iter().enumerate() {
        let mut stage =
            Stage::open(&headless, Arc::clone(&bytes), options(error_px), viewport()).unwrap();
        stage.let_through(share, state as u64);
        has_charts = !stage.viewer().document().charts.is_empty();
        // In an order of its own, so that each view is reached from others in each state.
        let mut views: Vec<(usize, f64)> = (0..STANDARD_VIEWS)
            .flat_map(|view| (0..DISTANCES.len()).map(move |distance| (view, distance)))
            .filter(|&(view, distance)| is_looked_at(state, view, distance))
            .map(|(view, distance)| (view, DISTANCES[distance]))
            .collect();
        wanted += views.len();
        let place = |&(view, distance): &(usize, f64)| {
            bits(state as u64, (view as u64) << 32 | distance.to_bits() >> 32)
        };
        views.sort_by_key(place);
        for (view, distance) in views {
            stage.look_from(view, distance).unwrap();
            // Most pictures are taken a few steps after the jump, while pages arrive and vertices move: settling takes many.
            let steps = place(&(view, distance)) % 5;
            if steps < 4 {
                for _ in 0..=steps {
                    stage.step().unwrap();
                }
            } else {
                stage.settle().unwrap();
            }
            let rgba = stage.draw().unwrap();
            let image = Image::new(320, 240, &rgba).unwrap();
            let inside = stage.inside(&AROUND_FOUR_SAMPLES).unwrap();
            assert!(
                inside.count() > 100,
                "{name}: nothing to see in view {view} from {distance}"
            );
            let found = holes(image, &inside);
            assert!(
                found.is_empty(),
                "{name}: {} holes with {share} of the pages in view {view} from {distance} after {steps} steps, \
                 first {:?}; {:?}",
                found.len(),
                found[0],
                stage.viewer().stats()
            );
            pictures += 1;
            let drawn = stage.viewer().drawn();
            let is_moving = !drawn.morphs.is_empty() || !drawn.group_morphs.is_empty();
            in_motion += usize::from(is_moving);
            finer_than_base += usize::from(stage.viewer().stats().pages.fetched > 0);
        }
    }
    eprintln!(
        "{name}: {pictures} pictures, {in_motion} in motion, {finer_than_base} beyond the base"
    );
    assert_eq!(pictures, wanted);
    assert!(pictures >= STANDARD_VIEWS * SHARES.len());
    // A file of clusters has a few small pages, which are there sooner.
    let fewest = if has_charts {
        pictures / 20
    } else {
        pictures / 40
    };
    assert!(
        in_motion > fewest,
        "the test has not seen surfaces in motion"
    );
    assert!(
        finer_than_base > pictures / 2,
        "the test has not seen pages"
    );
}

/// Draws everything there is, and asserts that the exported mesh is covered.
fn assert_finest_covers_export(name: &str, marq: &Path) {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("finest.ply");
    marquetry(&arguments!["export", marq, "-o", &out])
        .unwrap()
        .succeeded()
        .unwrap();
    let exported = ply::read(&out).unwrap();

    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let headless = Headless::new().unwrap();
    let mut stage = Stage::open(&headless, bytes, options(0.01), viewport()).unwrap();
    let lattice = stage.viewer().document().metadata.lattice;
    let positions: Vec<_> = exported
        .positions
        .iter()
        .map(|&world| marquetry_engine::camera::lattice_from_world(&lattice, world))
        .collect();
    for (view, distance) in (0..STANDARD_VIEWS).zip(DISTANCES.into_iter().cycle()) {
        stage.look_from(view, distance).unwrap();
        stage.settle().unwrap();
        let rgba = stage.draw().unwrap();
        let image = Image::new(320, 240, &rgba).unwrap();
        let inside = coverage(
            &positions,
            &exported.triangles,
            &stage.picture(&AROUND_FOUR_SAMPLES),
        )
        .unwrap()
        .eroded();
        let found = holes(image, &inside);
        assert!(
            found.is_empty(),
            "{name}: {} holes in view {view} from {distance}, first {:?}",
            found.len(),
            found[0]
        );
    }
}

/// Fine enough that most of it lies beyond the base.
fn torus(folder: &Path) -> PathBuf {
    let input = folder.join("torus.ply");
    ply::write(&input, &meshes::torus(1200, 600)).unwrap();
    let fine = ["--error-rel", "1e-5", "--allow-worse"];
    convert(&input, &[&fine, WITH_CHARTS].concat())
        .unwrap()
        .path
}

#[test]
fn torus_has_no_holes() {
    let folder = TempDir::new().unwrap();
    let marq = torus(folder.path());
    // Its base alone shows it to about a pixel.
    assert_no_holes("torus", &marq, 0.5);
    assert_finest_covers_export("torus", &marq);
}

#[test]
fn dragon_has_no_holes() {
    let Some(input) = data::find("dragon_vrip.ply") else {
        return;
    };
    let marq = convert(&input, WITH_CHARTS).unwrap().path;
    assert_no_holes("dragon", &marq, 1.0);
    assert_finest_covers_export("dragon", &marq);
}

#[test]
fn armadillo_has_no_holes() {
    let Some(input) = data::find("armadillo_86k.obj.gz") else {
        return;
    };
    for way in BOTH_WAYS {
        let marq = convert(&input, way).unwrap().path;
        assert_no_holes("armadillo", &marq, 1.0);
        assert_finest_covers_export("armadillo", &marq);
    }
}
