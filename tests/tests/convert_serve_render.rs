//! The whole way, on the real binary: convert, info, verify, measure, export, serve, render.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_evaluation::{Mesh, measure};
use marquetry_tests::server::Server;
use marquetry_tests::{
    BOTH_WAYS, Converted, WITH_CHARTS, arguments, convert, data, http, marquetry, meshes, ply,
};
use serde_json::Value;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// Runs with `--json -` and parses.
fn json(mut arguments: Vec<OsString>) -> Value {
    arguments.extend(arguments!["--json", "-"]);
    marquetry(&arguments).unwrap().json().unwrap()
}

fn number(report: &Value, pointer: &str) -> f64 {
    report
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no number {pointer} in {report}"))
}

/// Asserts that every key is there.
fn assert_keys(report: &Value, pointers: &[&str]) {
    let missing: Vec<_> = pointers
        .iter()
        .filter(|pointer| report.pointer(pointer).is_none())
        .collect();
    assert!(missing.is_empty(), "missing {missing:?} in {report}");
}

/// A torus by formula, converted both ways; the folder holds the formula's.
fn torus() -> (TempDir, PathBuf, [Converted; 2]) {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(400, 200)).unwrap();
    let converted = BOTH_WAYS.map(|way| convert(&input, way).unwrap());
    (folder, input, converted)
}

/// A torus or a scan has many pages, borders and clusters: checks that looked at nothing would pass for free.
const MANY_CHECKS: f64 = 100.0;

fn assert_verifies(marq: &Path, least_checks: f64) {
    let report = json(arguments!["verify", marq]);
    assert_eq!(report["ok"], Value::Bool(true), "{report}");
    let checks = report["checks"].as_array().unwrap();
    assert!(!checks.is_empty());
    for check in checks {
        assert_keys(check, &["/name", "/ok", "/count", "/failures"]);
        assert_eq!(check["ok"], Value::Bool(true), "{check}");
    }
    assert!(
        checks
            .iter()
            .map(|check| number(check, "/count"))
            .sum::<f64>()
            > least_checks,
        "{report}"
    );
}

/// What issue the converter's promises have on a scan.
struct Promise {
    file: &'static str,
    triangles: u64,
    rms_rel: f64,
    hausdorff_rel: f64,
    bytes_per_triangle: f64,
    /// Of charts: how many regions at most, and the smallest chart over the median.
    regions: f64,
    smallest_chart: f64,
    samples: u64,
}

/// Converts both ways and asserts that what is promised is kept.
fn assert_kept(promise: &Promise) {
    let Some(input) = data::find(promise.file) else {
        return;
    };
    for way in BOTH_WAYS {
        let converted = convert(&input, way).unwrap();
        let charts = converted.report["output"]["charts"].as_u64().unwrap();
        assert_eq!(charts > 0, way == WITH_CHARTS, "{charts} charts");
        assert_kept_by(promise, &input, &converted);
    }
}

/// As measured by `marquetry measure`.
fn assert_kept_by(promise: &Promise, input: &Path, converted: &Converted) {
    assert_eq!(converted.report["input"]["triangles"], promise.triangles);
    assert_verifies(&converted.path, MANY_CHECKS);

    let samples = promise.samples.to_string();
    let measured = json(arguments![
        "measure",
        &converted.path,
        "--against",
        input,
        "--samples",
        &samples
    ]);
    eprintln!("{}: {measured}\n{}", promise.file, converted.report);
    let bound = number(&converted.report, "/error/max_rel");
    assert!(number(&measured, "/rms_rel") <= promise.rms_rel);
    assert!(number(&measured, "/hausdorff_rel") <= promise.hausdorff_rel);
    for way in ["forward", "backward"] {
        let max = number(&measured, &format!("/{way}/max_rel"));
        assert!(
            max <= bound,
            "{way}: measured {max}, but the bound is {bound}"
        );
    }
    if number(&converted.report, "/output/charts") > 0.0 {
        let layout = |name: &str| number(&converted.report, &format!("/layout/{name}"));
        assert!(layout("regions") <= promise.regions);
        let [min, median] = ["min", "median"].map(|of| layout(&format!("chart_area/{of}")));
        assert!(min >= promise.smallest_chart * median, "{min} of {median}");
    }
    let bytes = converted.bytes().unwrap();
    assert_eq!(converted.report["output"]["bytes"], bytes);
    assert!(
        bytes as f64 <= promise.bytes_per_triangle * promise.triangles as f64,
        "{bytes} bytes"
    );
}

#[test]
fn dragon_keeps_what_is_promised() {
    assert_kept(&Promise {
        file: "dragon_vrip.ply",
        triangles: 871_414,
        rms_rel: 1e-4,
        hausdorff_rel: 3e-3,
        bytes_per_triangle: 8.0,
        regions: 120.0,
        smallest_chart: 1.0 / 50.0,
        samples: 1_000_000,
    });
}

/// For the smaller scans only the RMS distance is promised.
fn smaller(file: &'static str, triangles: u64) -> Promise {
    Promise {
        file,
        triangles,
        rms_rel: 3e-4,
        hausdorff_rel: f64::INFINITY,
        bytes_per_triangle: f64::INFINITY,
        regions: f64::INFINITY,
        smallest_chart: 0.0,
        samples: 300_000,
    }
}

#[test]
fn bunny_with_five_holes_keeps_what_is_promised() {
    assert_kept(&smaller("bun_zipper.ply", 69_451));
}

#[test]
fn armadillo_keeps_what_is_promised() {
    assert_kept(&smaller("armadillo_86k.obj.gz", 86_482));
}

#[test]
fn igea_of_triangle_strips_keeps_what_is_promised() {
    assert_kept(&smaller("difficult/igea_tristrips.ply.gz", 268_686));
}

#[test]
fn reports_have_the_keys_of_the_contract() {
    let (_folder, input, both) = torus();
    for converted in both {
        assert_reports_have_their_keys(&input, &converted);
    }
}

fn assert_reports_have_their_keys(input: &Path, converted: &Converted) {
    assert_keys(
        &converted.report,
        &[
            "/input/path",
            "/input/bytes",
            "/input/triangles",
            "/input/vertices",
            "/input/components",
            "/input/boundary_loops",
            "/input/non_manifold_edges",
            "/output/path",
            "/output/bytes",
            "/output/pages",
            "/output/charts",
            "/output/levels",
            "/output/samples",
            "/stages/0/name",
            "/stages/0/seconds",
            "/seconds",
            "/cpu_seconds",
            "/peak_rss_bytes",
            "/threads",
            "/error/target_rel",
            "/error/max_rel",
            "/error/rms_rel",
            "/lost/triangles",
            "/lost/reason",
        ],
    );
    assert_eq!(converted.report["input"]["components"], 1);
    assert_eq!(converted.report["input"]["boundary_loops"], 0);

    let info = json(arguments!["info", &converted.path]);
    assert_keys(
        &info,
        &[
            "/format/major",
            "/format/minor",
            "/kind",
            "/bounds/min",
            "/bounds/max",
            "/charts",
            "/levels",
            "/pages",
            "/bytes/total",
            "/bytes/header",
            "/bytes/index",
            "/bytes/geometry",
            "/bytes/normals",
            "/bytes/colour",
            "/first_read_bytes",
            "/first_image_bytes",
            "/level/0/triangles",
            "/level/0/bytes",
            "/level/0/error_rel",
        ],
    );
    assert_eq!(info["kind"], "scan");
    assert_eq!(info["bytes"]["total"], converted.bytes().unwrap());
    assert!(number(&info, "/first_read_bytes") <= f64::from(64 << 10));
    assert!(number(&info, "/first_image_bytes") <= f64::from(256 << 10));
    let errors: Vec<f64> = info["level"]
        .as_array()
        .unwrap()
        .iter()
        .map(|level| number(level, "/error_rel"))
        .collect();
    assert!(
        errors.is_sorted_by(|coarse, fine| coarse >= fine),
        "errors grow on the way down: {errors:?}"
    );
    assert!(errors.len() > 3, "{info}");
    assert_eq!(info["levels"], errors.len());
    assert_eq!(info["levels"], converted.report["output"]["levels"]);

    let measured = json(arguments![
        "measure",
        &converted.path,
        "--against",
        input,
        "--samples",
        "20000"
    ]);
    assert_keys(
        &measured,
        &[
            "/hausdorff_rel",
            "/rms_rel",
            "/forward/max_rel",
            "/forward/rms_rel",
            "/backward/max_rel",
            "/backward/rms_rel",
            "/normal_deviation_deg/mean",
            "/normal_deviation_deg/p95",
            "/triangles",
            "/bytes",
            "/samples",
        ],
    );
}

/// Edges without a partner that runs the other way: none on a closed, consistently oriented surface.
fn open_edges(triangles: &[[u32; 3]]) -> usize {
    let mut edges: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .collect();
    edges.sort_unstable();
    edges
        .iter()
        .filter(|&&(a, b)| edges.binary_search(&(b, a)).is_err())
        .count()
}

#[test]
fn exported_cuts_are_watertight_and_as_far_off_as_measured() {
    let (folder, input, both) = torus();
    for converted in both {
        assert_cuts_are_watertight(folder.path(), &input, &converted);
    }
}

fn assert_cuts_are_watertight(folder: &Path, input: &Path, converted: &Converted) {
    let source = ply::read(input).unwrap();
    let diagonal = source.mesh().diagonal();
    let mut last = f64::INFINITY;
    for triangles in [Some(600), Some(4_000), None] {
        let out = folder.join("cut.ply");
        let mut export = arguments!["export", &converted.path, "-o", &out];
        let mut measurement = arguments![
            "measure",
            &converted.path,
            "--against",
            input,
            "--samples",
            "50000"
        ];
        if let Some(triangles) = triangles {
            export.extend(arguments!["--triangles", triangles.to_string()]);
            measurement.extend(arguments!["--triangles", triangles.to_string()]);
        }
        marquetry(&export).unwrap().succeeded().unwrap();
        let cut = ply::read(&out).unwrap();
        assert!(
            triangles.is_none_or(|most| cut.triangles.len() <= most),
            "{} triangles",
            cut.triangles.len()
        );
        assert_eq!(open_edges(&cut.triangles), 0, "{triangles:?}");

        let found = measure(cut.mesh(), source.mesh(), 50_000).unwrap();
        let rms_rel = found.rms() / diagonal;
        assert!(
            rms_rel < last,
            "more triangles, but not nearer: {rms_rel} after {last}"
        );
        last = rms_rel;
        let stated = number(&json(measurement), "/rms_rel");
        // The samples lie elsewhere where the export orders its triangles differently.
        assert!(
            (stated - rms_rel).abs() <= 0.05 * rms_rel,
            "measure says {stated}, the export is off by {rms_rel}"
        );
    }
    // The default target.
    assert!(last <= 1e-4, "{last}");
}

#[test]
fn every_export_format_imports_again() {
    let (folder, input, both) = torus();
    let finest = ply::read(&input).unwrap();
    for (converted, extension) in both
        .iter()
        .flat_map(|converted| ["ply", "obj", "glb"].map(|extension| (converted, extension)))
    {
        let out = folder.path().join("cut").with_extension(extension);
        marquetry(&arguments![
            "export",
            &converted.path,
            "-o",
            &out,
            "--triangles",
            "20000"
        ])
        .unwrap()
        .succeeded()
        .unwrap();
        let (imported, _) = marquetry_converter::import::import(&out).unwrap();
        let mesh = Mesh {
            positions: &imported.positions,
            triangles: &imported.triangles,
        };
        let found = measure(mesh, finest.mesh(), 10_000).unwrap();
        assert!(
            found.rms() / finest.mesh().diagonal() < 1e-3,
            "{extension}: {found:?}"
        );
    }
}

#[test]
fn surface_with_a_hole_keeps_both_borders() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("plane.ply");
    let plane = meshes::plane_with_hole(90);
    ply::write(&input, &plane).unwrap();
    for way in BOTH_WAYS {
        assert_borders_are_kept(folder.path(), &plane, &convert(&input, way).unwrap());
    }
}

fn assert_borders_are_kept(folder: &Path, plane: &meshes::Model, converted: &Converted) {
    assert_eq!(converted.report["input"]["boundary_loops"], 2);
    // What is flat becomes a few clusters.
    let has_charts = converted.report["output"]["charts"] != 0;
    let least_checks = if has_charts { MANY_CHECKS } else { 30.0 };
    assert_verifies(&converted.path, least_checks);
    let out = folder.join("out.ply");
    marquetry(&arguments!["export", &converted.path, "-o", &out])
        .unwrap()
        .succeeded()
        .unwrap();
    let exported = ply::read(&out).unwrap();
    let found = measure(exported.mesh(), plane.mesh(), 50_000).unwrap();
    let bound = number(&converted.report, "/error/max_rel") * plane.mesh().diagonal();
    assert!(
        found.hausdorff() <= bound,
        "the bound is {bound}: {found:?}"
    );
    // Would be a sixth of the side if the hole were covered.
    assert!(found.hausdorff() < 0.02, "{found:?}");
    assert!(open_edges(&exported.triangles) > 0);
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let formula = folder.path().join("torus.ply");
    ply::write(&formula, &meshes::torus(400, 200)).unwrap();
    for (input, way) in [
        Some(formula),
        data::find("bun_zipper.ply"),
        data::find("armadillo_86k.obj.gz"),
    ]
    .into_iter()
    .flatten()
    .flat_map(|input| BOTH_WAYS.map(|way| (input.clone(), way)))
    {
        let [one, two] = ["1", "2"].map(|threads| {
            let out = folder.path().join(format!("{threads}.marq"));
            let mut run = arguments!["convert", &input, "-o", &out, "--threads", threads];
            run.extend(way.iter().map(OsString::from));
            marquetry(&run).unwrap().succeeded().unwrap();
            std::fs::read(out).unwrap()
        });
        let first = one.iter().zip(&two).position(|(a, b)| a != b);
        assert!(
            one == two,
            "{}, {way:?}: lengths {} and {}, byte {first:?} differs",
            input.display(),
            one.len(),
            two.len()
        );
    }
}

#[test]
fn killed_conversion_leaves_no_output() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(600, 300)).unwrap();
    let out = folder.path().join("out.marq");
    for milliseconds in [5, 50, 200, 400] {
        let mut child =
            marquetry_tests::binary::spawn(&arguments!["convert", &input, "-o", &out]).unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        child.kill().unwrap();
        child.wait().unwrap();
        if out.exists() {
            // It was quicker than we were.
            assert_verifies(&out, MANY_CHECKS);
            std::fs::remove_file(&out).unwrap();
        }
    }
}

#[test]
fn server_hands_out_the_file_in_ranges_and_pages() {
    // Fine enough to have pages beyond the base.
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("fine.ply");
    ply::write(&input, &meshes::torus(1200, 600)).unwrap();
    for way in BOTH_WAYS {
        let fine = ["--error-rel", "1e-5", "--allow-worse"];
        assert_is_handed_out(&convert(&input, &[&fine, way].concat()).unwrap());
    }
}

fn assert_is_handed_out(converted: &Converted) {
    let bytes = std::fs::read(&converted.path).unwrap();
    let server = Server::start(&[&converted.path]).unwrap();
    let name = converted.path.file_stem().unwrap().to_str().unwrap();

    let health = http::get(&server.authority, "/health", &[]).unwrap();
    assert_eq!(health.status, 200);
    let catalogue = http::get(&server.authority, "/api/catalogue", &[]).unwrap();
    assert_eq!(catalogue.status, 200);
    let text = String::from_utf8(catalogue.body).unwrap();
    serde_json::from_str::<Value>(&text).unwrap();
    assert!(text.contains(name), "{text}");
    let page = http::get(&server.authority, "/", &[]).unwrap();
    assert_eq!(page.status, 200);
    assert!(
        page.header("content-type")
            .unwrap()
            .starts_with("text/html")
    );

    let path = format!("/files/{name}.marq");
    let whole = http::get(&server.authority, &path, &[]).unwrap();
    assert_eq!(whole.status, 200);
    assert!(whole.body == bytes);
    assert!(
        whole.header("etag").unwrap().starts_with('"'),
        "the ETag is weak"
    );
    let part = http::get(&server.authority, &path, &[("Range", "bytes=100-299")]).unwrap();
    assert_eq!(part.status, 206);
    assert_eq!(
        part.header("content-range"),
        Some(format!("bytes 100-299/{}", bytes.len()).as_str())
    );
    assert!(part.body == bytes[100..300]);
    let beyond = format!("bytes={}-", bytes.len());
    assert_eq!(
        http::get(&server.authority, &path, &[("Range", &beyond)])
            .unwrap()
            .status,
        416
    );
    assert_eq!(
        http::get(&server.authority, "/files/other.marq", &[])
            .unwrap()
            .status,
        404
    );

    let info = json(arguments!["info", &converted.path]);
    let content = info["content_id"].as_str().unwrap();
    let pages = number(&info, "/pages");
    // A page may be empty, where the base holds the whole chart; together they are not.
    let last = (pages - 1.0).min(255.0);
    let some = http::get(
        &server.authority,
        &format!("/pages/{name}/{content}/0-{last}"),
        &[],
    )
    .unwrap();
    assert_eq!(some.status, 200);
    assert!(some.header("cache-control").unwrap().contains("immutable"));
    assert!(!some.body.is_empty());
    assert!(
        bytes
            .windows(some.body.len())
            .any(|window| window == some.body),
        "the pages are no part of the file"
    );
    let none = http::get(
        &server.authority,
        &format!("/pages/{name}/{content}/{pages}"),
        &[],
    )
    .unwrap();
    assert_eq!(none.status, 404);
}

#[test]
fn commands_take_a_url_where_they_take_a_file() {
    let (folder, _, [converted, _]) = torus();
    let server = Server::start(&[&converted.path]).unwrap();
    let name = converted.path.file_name().unwrap().to_str().unwrap();
    let url = server.url(&format!("/files/{name}"));
    assert_eq!(
        json(arguments!["info", &url])["content_id"],
        json(arguments!["info", &converted.path])["content_id"]
    );
    assert_eq!(json(arguments!["verify", &url])["ok"], Value::Bool(true));
    let mut exports = Vec::new();
    for (source, name) in [
        (OsString::from(&url), "url.ply"),
        (OsString::from(&converted.path), "file.ply"),
    ] {
        let out = folder.path().join(name);
        marquetry(&arguments![
            "export",
            source,
            "-o",
            &out,
            "--triangles",
            "5000"
        ])
        .unwrap()
        .succeeded()
        .unwrap();
        exports.push(std::fs::read(out).unwrap());
    }
    assert!(exports[0] == exports[1]);
}

#[test]
fn picture_from_a_url_equals_picture_from_the_file() {
    let (folder, _, both) = torus();
    for converted in both {
        assert_pictures_are_equal(folder.path(), &converted);
    }
}

fn assert_pictures_are_equal(folder: &Path, converted: &Converted) {
    let server = Server::start(&[&converted.path]).unwrap();
    let name = converted.path.file_name().unwrap().to_str().unwrap();
    let url = server.url(&format!("/files/{name}"));
    let mut pictures = Vec::new();
    for (source, name) in [
        (OsString::from(&url), "url.png"),
        (OsString::from(&converted.path), "file.png"),
    ] {
        let out = folder.join(name);
        let report = json(arguments![
            "render",
            source,
            "-o",
            &out,
            "--size",
            "320x240",
            "--background",
            "ff00ff"
        ]);
        assert_keys(
            &report,
            &[
                "/frame_ms",
                "/cpu_ms",
                "/gpu_ms",
                "/triangles",
                "/nodes",
                "/draw_calls",
                "/pages/requested",
                "/pages/fetched",
                "/pages/bytes",
                "/pages/missing",
                "/cache/capacity_bytes",
                "/cache/used_bytes",
                "/cache/evictions",
                "/adapter",
            ],
        );
        assert_eq!(report["pages"]["missing"], 0);
        assert!(number(&report, "/triangles") > 1000.0);
        pictures.push(image::open(out).unwrap().to_rgba8());
    }
    let (a, b) = (&pictures[0], &pictures[1]);
    assert_eq!(a.dimensions(), (320, 240));
    assert!(a == b);
    let magenta = a
        .pixels()
        .filter(|pixel| pixel.0[..3] == [255, 0, 255])
        .count();
    // A torus seen along its axis: a ring, with the background around it and within.
    assert!(
        (15_000..65_000).contains(&magenta),
        "{magenta} background pixels"
    );
    assert_ne!(a.get_pixel(160 + 56, 120).0[..3], [255, 0, 255], "the ring");
    assert_eq!(a.get_pixel(160, 120).0[..3], [255, 0, 255], "the hole");
}
