//! With a cache of a tenth of the file the viewer settles, stays within its budget, and never shows a hole.
//!
//! A tenth of a file of clusters, whose bytes are few beside what they take decoded, may have room for none of them. So these are
//! looked at with a cache of four times the file, too, which takes a part of what is in it.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_engine::{Background, ViewerOptions, Viewport};
use marquetry_evaluation::image::Image;
use marquetry_native::Headless;
use marquetry_tests::raster::AROUND_FOUR_SAMPLES;
use marquetry_tests::stage::{MAGENTA, Stage, holes, wants_all_views};
use marquetry_tests::{BOTH_WAYS, arguments, convert, data, marquetry, meshes, ply};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// What was seen of a cache.
struct Seen {
    /// Whether it held anything.
    is_used: bool,
    /// Whether it was too small for all that was wanted: something had to go, or a larger error was shown.
    was_felt: bool,
}

/// Looks from all sides with a cache of so many tenths of the file.
fn seen_with(marq: &Path, tenths: u64) -> Seen {
    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let budget = tenths * bytes.len() as u64 / 10;
    let viewport = Viewport::new(640, 480);
    let options = ViewerOptions {
        cache_bytes: budget,
        background: Background(MAGENTA),
        ..ViewerOptions::default()
    };
    let headless = Headless::new().unwrap();
    let mut stage = Stage::open(&headless, bytes, options, viewport).unwrap();
    let (mut beyond_base, mut error_px) = (0, 0.0f64);
    // All around, then closer and closer: every view asks for other pages than the one before.
    let views = (0..26)
        .step_by(if wants_all_views() { 1 } else { 2 })
        .map(|view| (view, 2.5))
        .chain([1.6, 1.3, 1.15].map(|distance| (1, distance)));
    for (view, distance) in views {
        stage.look_from(view, distance).unwrap();
        for moment in ["on the way", "settled"] {
            if moment == "settled" {
                stage.settle().unwrap();
            } else {
                // Every step checks the budget.
                for _ in 0..4 {
                    stage.step().unwrap();
                }
            }
            let rgba = stage.draw().unwrap();
            let image = Image::new(640, 480, &rgba).unwrap();
            let found = holes(image, &stage.inside(&AROUND_FOUR_SAMPLES).unwrap());
            assert!(
                found.is_empty(),
                "{} holes {moment} in view {view} from {distance}",
                found.len()
            );
        }
        let settled = stage.viewer().stats();
        beyond_base += usize::from(settled.cache.used_bytes > 0);
        error_px = error_px.max(settled.error_px);
        // A view that is settled stays so: nothing is fetched over and over.
        for _ in 0..40 {
            assert_eq!(
                stage.step().unwrap(),
                0,
                "fetches go on in view {view} from {distance}"
            );
        }
        assert_eq!(
            stage.viewer().stats().cache.evictions,
            settled.cache.evictions
        );
    }
    Seen {
        is_used: beyond_base > 0,
        was_felt: error_px > 1.0 || stage.viewer().stats().cache.evictions > 0,
    }
}

/// Of the files that both ways make.
fn assert_a_tenth_is_enough([clusters, charts]: [&Path; 2]) {
    seen_with(clusters, 1);
    for (marq, tenths) in [(charts, 1), (clusters, 40)] {
        let seen = seen_with(marq, tenths);
        assert!(seen.is_used, "{tenths} tenths held no page at all");
        assert!(seen.was_felt, "a budget of {tenths} tenths was never felt");
    }
    assert_render_keeps_the_budget(charts);
    assert_render_keeps_the_budget(clusters);
}

/// Renders with the binary, at a tenth of the file.
fn assert_render_keeps_the_budget(marq: &Path) {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out.png");
    let budget = std::fs::metadata(marq).unwrap().len() / 10;
    let run = arguments![
        "render",
        marq,
        "-o",
        &out,
        "--size",
        "640x480",
        "--cache",
        budget.to_string(),
        "--json",
        "-"
    ];
    let report = marquetry(&run).unwrap().json().unwrap();
    assert_eq!(report["cache"]["capacity_bytes"], budget);
    assert!(
        report["cache"]["used_bytes"].as_u64().unwrap() <= budget,
        "{report}"
    );
    assert!(out.exists());
}

fn torus(folder: &Path, way: &[&str]) -> PathBuf {
    let input = folder.join("torus.ply");
    ply::write(&input, &meshes::torus(1200, 600)).unwrap();
    let fine = ["--error-rel", "1e-5", "--allow-worse"];
    convert(&input, &[&fine, way].concat()).unwrap().path
}

#[test]
fn torus_settles_in_a_tenth() {
    let folder = TempDir::new().unwrap();
    let both = BOTH_WAYS.map(|way| torus(folder.path(), way));
    assert_a_tenth_is_enough(both.each_ref().map(PathBuf::as_path));
}

#[test]
fn dragon_settles_in_a_tenth() {
    let Some(input) = data::find("dragon_vrip.ply") else {
        return;
    };
    let both = BOTH_WAYS.map(|way| convert(&input, way).unwrap().path);
    assert_a_tenth_is_enough(both.each_ref().map(PathBuf::as_path));
}
