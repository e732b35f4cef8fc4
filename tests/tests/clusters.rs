//! Clusters, from the mesh to the picture: of small components beside a scan and alone, and of a scan.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use glam::DVec3;
use marquetry_engine::{Background, ViewerOptions, Viewport};
use marquetry_evaluation::image::Image;
use marquetry_native::Headless;
use marquetry_tests::meshes::{Model, sphere};
use marquetry_tests::raster::AROUND_FOUR_SAMPLES;
use marquetry_tests::stage::{MAGENTA, Stage, holes, unit};
use marquetry_tests::{BOTH_WAYS, WITH_CHARTS, arguments, convert, data, marquetry, ply};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// Cubes of different sizes around the unit sphere.
fn cubes(count: u64) -> Model {
    let mut model = Model::default();
    for n in 0..count {
        let random = |k: u64| unit(5, 4 * n + k);
        let direction = DVec3::new(random(0), random(1), random(2)) - DVec3::splat(0.5);
        let place = (1.2 + random(3)) * direction.normalize_or(DVec3::X);
        let size = 0.01 + 0.02 * random(3);
        let first = u32::try_from(model.positions.len()).unwrap();
        for k in 0..8u32 {
            let bit = |b: u32| f64::from(k >> b & 1);
            model
                .positions
                .push(place + size * DVec3::new(bit(0), bit(1), bit(2)));
        }
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            model
                .triangles
                .extend([[a, b, c], [a, c, d]].map(|t| t.map(|v| first + v)));
        }
    }
    model
}

fn report(command: &str, marq: &Path, rest: &[&std::ffi::OsStr]) -> Value {
    let mut all = arguments![command, marq, "--json", "-"];
    all.extend(rest.iter().map(|argument| (*argument).to_owned()));
    marquetry(&all).unwrap().json().unwrap()
}

/// Pictures from some sides, near and far, as far as each gets in a few steps: none has a hole.
fn assert_no_holes(marq: &Path, least_nodes: u64) {
    let viewport = Viewport::new(320, 240);
    let options = ViewerOptions {
        background: Background(MAGENTA),
        ..ViewerOptions::default()
    };
    let bytes: Arc<[u8]> = std::fs::read(marq).unwrap().into();
    let headless = Headless::new().unwrap();
    let mut stage = Stage::open(&headless, bytes, options, viewport).unwrap();
    let mut most_nodes = 0;
    for (view, distance) in [(0, 2.5), (7, 1.25), (19, 1.5), (3, 30.0), (11, 1.3)] {
        stage.look_from(view, distance).unwrap();
        for steps in 0..3 {
            if steps == 2 {
                stage.settle().unwrap();
            } else {
                stage.step().unwrap();
            }
            let rgba = stage.draw().unwrap();
            let image = Image::new(320, 240, &rgba).unwrap();
            let inside = stage.inside(&AROUND_FOUR_SAMPLES).unwrap();
            let found = holes(image, &inside);
            assert!(
                found.is_empty(),
                "{} holes in view {view} from {distance}, first {:?}; {:?}",
                found.len(),
                found[0],
                stage.viewer().stats()
            );
        }
        most_nodes = most_nodes.max(stage.viewer().stats().nodes);
    }
    assert!(most_nodes >= least_nodes, "only {most_nodes} nodes drawn");
}

#[test]
fn cubes_alone_need_no_chart() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("cubes.ply");
    ply::write(&input, &cubes(800)).unwrap();
    let converted = convert(&input, WITH_CHARTS).unwrap();
    let output = &converted.report["output"];
    assert_eq!(output["charts"], 0);
    assert_eq!(output["clusters"]["components"], 800);
    assert_eq!(output["clusters"]["triangles"], 9600);
    let info = report("info", &converted.path, &[]);
    assert_eq!(info["clusters"]["triangles"], 9600);
    let levels = info["level"].as_array().unwrap();
    assert_eq!(levels.last().unwrap()["triangles"], 9600);
    assert_eq!(report("verify", &converted.path, &[])["ok"], true);

    let exported = folder.path().join("out.ply");
    marquetry(&arguments!["export", &converted.path, "-o", &exported])
        .unwrap()
        .succeeded()
        .unwrap();
    assert_eq!(ply::read(&exported).unwrap().triangles.len(), 9600);
    assert_no_holes(&converted.path, 40);
}

#[test]
fn a_scan_without_charts_is_closed_and_takes_less() {
    let input = data::find("armadillo_86k.obj.gz").unwrap();
    let with_charts = convert(&input, WITH_CHARTS).unwrap().report["output"].clone();
    let converted = convert(&input, &[]).unwrap();
    let output = &converted.report["output"];
    assert_eq!(output["charts"], 0);
    let bytes = output["bytes"].as_u64().unwrap();
    assert!(
        10 * bytes < 9 * with_charts["bytes"].as_u64().unwrap(),
        "{bytes}"
    );
    assert_eq!(report("verify", &converted.path, &[])["ok"], true);

    let count = 8600.to_string();
    let against = arguments!["--against", &input, "--samples", "50000"];
    let against: Vec<&std::ffi::OsStr> = against.iter().map(AsRef::as_ref).collect();
    let measured = report("measure", &converted.path, &against);
    assert!(measured["rms_rel"].as_f64().unwrap() <= 1e-4);
    let tenth = ["--triangles", &count].map(std::ffi::OsStr::new);
    let measured = report("measure", &converted.path, &[&against[..], &tenth].concat());
    assert!(measured["triangles"].as_u64().unwrap() <= 8600);
    assert!(measured["rms_rel"].as_f64().unwrap() <= 1.2e-3);
    let bound = measured["bound_rel"].as_f64().unwrap();
    assert!(measured["hausdorff_rel"].as_f64().unwrap() <= bound);
    assert_no_holes(&converted.path, 40);
}

#[test]
fn cubes_beside_a_scan_are_measured_with_it() {
    let folder = TempDir::new().unwrap();
    let mut model = sphere(96, 48);
    let first = u32::try_from(model.positions.len()).unwrap();
    let more = cubes(150);
    model.positions.extend(more.positions);
    model
        .triangles
        .extend(more.triangles.iter().map(|t| t.map(|v| v + first)));
    let input = folder.path().join("planet.ply");
    ply::write(&input, &model).unwrap();
    for way in BOTH_WAYS {
        assert_planet_is_measured(&input, way);
    }
}

fn assert_planet_is_measured(input: &Path, way: &[&str]) {
    let converted = convert(input, way).unwrap();
    let output = &converted.report["output"];
    let has_charts = way == WITH_CHARTS;
    assert_eq!(output["charts"].as_u64().unwrap() > 0, has_charts);
    let components = 150 + u64::from(!has_charts);
    assert_eq!(output["clusters"]["components"], components);
    assert_eq!(report("verify", &converted.path, &[])["ok"], true);

    let against = [std::ffi::OsStr::new("--against"), input.as_os_str()];
    let bound = converted.report["error"]["max_rel"].as_f64().unwrap();
    let measured = report("measure", &converted.path, &against);
    assert!(measured["hausdorff_rel"].as_f64().unwrap() <= bound);
    assert!(measured["rms_rel"].as_f64().unwrap() <= 1e-4);
    let coarse = [
        against[0],
        against[1],
        std::ffi::OsStr::new("--triangles"),
        std::ffi::OsStr::new("3000"),
    ];
    let measured = report("measure", &converted.path, &coarse);
    assert!(measured["triangles"].as_u64().unwrap() <= 3000);
    // The sphere alone, simplified, is fewer clusters than charts.
    assert_no_holes(&converted.path, if has_charts { 40 } else { 20 });
}
