//! With a cache of a tenth of the file the viewer settles, stays within its budget, and never shows a hole.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_engine::{Background, ViewerOptions, Viewport};
use marquetry_evaluation::image::Image;
use marquetry_native::Headless;
use marquetry_tests::raster::AROUND_FOUR_SAMPLES;
use marquetry_tests::stage::{MAGENTA, Stage, holes};
use marquetry_tests::{arguments, convert, data, marquetry, meshes, ply};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

fn assert_a_tenth_is_enough(marq: &Path) {
    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let budget = bytes.len() as u64 / 10;
    let viewport = Viewport::new(640, 480);
    let options = ViewerOptions {
        cache_bytes: budget,
        background: Background(MAGENTA),
        ..ViewerOptions::default()
    };
    let headless = Headless::new().unwrap();
    let mut stage = Stage::open(&headless, bytes, options, viewport).unwrap();
    let mut beyond_base = 0;
    // All around, then closer and closer: every view asks for other pages than the one before.
    let views = (0..26)
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
    assert!(
        beyond_base > 0,
        "a budget of {budget} bytes held no page at all"
    );
    assert!(
        stage.viewer().stats().cache.evictions > 0,
        "the budget was never felt"
    );
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

fn torus(folder: &Path) -> PathBuf {
    let input = folder.join("torus.ply");
    ply::write(&input, &meshes::torus(1200, 600)).unwrap();
    convert(&input, &["--error-rel", "1e-5", "--allow-worse"])
        .unwrap()
        .path
}

#[test]
fn torus_settles_in_a_tenth() {
    let folder = TempDir::new().unwrap();
    let marq = torus(folder.path());
    assert_a_tenth_is_enough(&marq);
    assert_render_keeps_the_budget(&marq);
}

#[test]
fn dragon_settles_in_a_tenth() {
    let Some(input) = data::find("dragon_vrip.ply") else {
        return;
    };
    let marq = convert(&input, &[]).unwrap().path;
    assert_a_tenth_is_enough(&marq);
    assert_render_keeps_the_budget(&marq);
}
