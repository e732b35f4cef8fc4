//! `marquetry chart` as a user runs it: what it writes, that its figures are `measure`'s, and what it refuses.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_tests::{BOTH_WAYS, Converted, Finished, arguments, convert, marquetry, meshes, ply};
use serde_json::Value;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const SAMPLES: &str = "20000";

/// A dented torus and the file made of it with the options `way`.
fn torus(folder: &Path, way: &[&str]) -> (PathBuf, Converted) {
    let input = folder.join("torus.ply");
    ply::write(&input, &meshes::torus(120, 60)).unwrap();
    let file = convert(&input, &[&["--error-rel", "1e-4"], way].concat()).unwrap();
    (input, file)
}

fn chart(file: &Path, input: &Path, output: &Path, more: &[&str]) -> Finished {
    let mut line = arguments![
        "chart",
        file,
        "--against",
        input,
        "-o",
        output,
        "--samples",
        SAMPLES
    ];
    line.extend(more.iter().map(OsString::from));
    marquetry(&line).unwrap()
}

fn names(folder: &Path) -> BTreeSet<String> {
    folder
        .read_dir()
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn is_close(a: &Value, b: &Value) -> bool {
    (number(a) - number(b)).abs() <= 1e-12 * number(a).abs()
}

/// Every cut of the chart, measured by `measure` with the same samples, and once more by its bytes.
fn assert_figures_are_those_of_measure(report: &Value, file: &Path, input: &Path) {
    let points = report["geometry"].as_array().unwrap();
    let ours = points.iter().filter(|point| point["method"] == "marquetry");
    let mut by_bytes = BTreeSet::new();
    let mut count = 0;
    for point in ours {
        let mut line = arguments![
            "measure",
            file,
            "--against",
            input,
            "--samples",
            SAMPLES,
            "--json",
            "-"
        ];
        let bytes = point["bytes"].as_u64().unwrap();
        if let Some(asked) = point["asked_triangles"].as_u64() {
            line.extend(arguments!["--triangles", asked.to_string()]);
        }
        let measured = marquetry(&line).unwrap().json().unwrap();
        for key in ["triangles", "bytes"] {
            assert_eq!(point[key], measured[key], "{key}");
        }
        for key in ["rms_rel", "hausdorff_rel", "bound_rel"] {
            assert!(
                is_close(&point[key], &measured[key]),
                "{key}: {point} {measured}"
            );
        }
        let [low, high] = [0, 1].map(|end| number(&point["rms_interval_rel"][end]));
        let rms = number(&point["rms_rel"]);
        assert!(low <= rms && rms <= high);
        // Points come finest first, and of those that take as many bytes `--bytes` takes the finest.
        if by_bytes.insert(bytes) {
            let line = arguments![
                "measure",
                file,
                "--against",
                input,
                "--samples",
                SAMPLES,
                "--json",
                "-",
                "--bytes",
                bytes.to_string()
            ];
            let measured = marquetry(&line).unwrap().json().unwrap();
            assert!(measured["bytes"].as_u64().unwrap() <= bytes);
            assert!(
                number(&measured["rms_rel"]) <= rms * (1.0 + 1e-9),
                "{bytes} bytes"
            );
        }
        count += 1;
    }
    assert!(count >= 3, "{count} cuts");
}

/// No point that is marked is beaten by any, and no point that is not is unbeaten.
fn assert_front_is_one(report: &Value) {
    let points = report["geometry"].as_array().unwrap();
    let pair = |p: &Value| (number(&p["triangles"]), number(&p["rms_rel"]));
    for p in points {
        let (cost, error) = pair(p);
        let beaten = points.iter().map(pair).any(|(other_cost, other_error)| {
            other_cost <= cost && other_error <= error && (other_cost < cost || other_error < error)
        });
        assert_eq!(p["on_front"]["triangles"], Value::Bool(!beaten), "{p}");
    }
}

#[test]
fn a_chart_is_whole_and_says_what_measure_says() {
    for way in BOTH_WAYS {
        assert_chart_is_whole(way);
    }
}

fn assert_chart_is_whole(way: &[&str]) {
    let folder = TempDir::new().unwrap();
    let (input, file) = torus(folder.path(), way);
    let others = folder.path().join("others.csv");
    std::fs::write(
        &others,
        "tool,triangles,rms_rel,bytes\n\"<b>other\",500,5e-3,9000\n\"<b>other\",2000,9e-4,\n",
    )
    .unwrap();
    let output = folder.path().join("chart");
    let more = [
        "--views",
        "2",
        "--distances",
        "2.5,8",
        "--error-px",
        "1,6",
        "--size",
        "120x90",
        "--levels",
        "4",
        "--error-rels",
        "4e-3,2e-3",
        "--external",
        others.to_str().unwrap(),
        "--json",
        "-",
    ];
    let finished = chart(&file.path, &input, &output, &more);
    let report = finished.json().unwrap();
    let files = names(&output);
    for name in [
        "chart.html",
        "chart.json",
        "chart.csv",
        "rms-triangles.svg",
        "ssim-2.5.svg",
    ] {
        assert!(files.contains(name), "{files:?}");
    }
    let stored: Value =
        serde_json::from_slice(&std::fs::read(output.join("chart.json")).unwrap()).unwrap();
    assert_eq!(stored, report);
    assert!(
        names(folder.path())
            .iter()
            .all(|name| !name.ends_with(".partial"))
    );

    assert_figures_are_those_of_measure(&report, &file.path, &input);
    assert_front_is_one(&report);
    assert_eq!(report["conversions"].as_array().unwrap().len(), 2);

    let pictures = report["pictures"].as_array().unwrap();
    for point in pictures {
        let (ssim, flip) = (
            number(&point["ssim"]["mean"]),
            number(&point["flip"]["mean"]),
        );
        assert!(
            (0.0..=1.0).contains(&flip) && (-1.0..=1.0).contains(&ssim),
            "{point}"
        );
        if point["method"] == "original" {
            // The reference is the same with less noise.
            assert!(ssim > 0.95 && ssim < 1.0 && flip < 0.05, "{point}");
        }
    }
    let finest = |px: &str| {
        let mut own = pictures
            .iter()
            .filter(|p| p["setting"] == px && number(&p["distance"]) < 3.0);
        number(&own.next().unwrap()["ssim"]["mean"])
    };
    // The picture asked for at one pixel is nearly the input's; at six it is less like it.
    assert!(finest("1 px") > 0.9 && finest("1 px") > finest("6 px"));

    let html = std::fs::read_to_string(output.join("chart.html")).unwrap();
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    for reference in [
        "http:", "https:", "src=", "href=", "url(", "@import", "<script",
    ] {
        assert!(!outside.contains(reference), "{reference}");
    }
    assert!(html.contains("&lt;b&gt;other") && !html.contains("<b>other"));
    assert!(html.contains("prefers-color-scheme:dark") && html.contains("<table>"));
    assert!(!html.contains("NaN"));
    let csv = std::fs::read_to_string(output.join("chart.csv")).unwrap();
    let rows =
        ["geometry", "pictures", "conversions"].map(|kind| report[kind].as_array().unwrap().len());
    assert_eq!(csv.lines().count(), 1 + rows.iter().sum::<usize>());
}

#[test]
fn another_model_is_refused_with_the_numbers_and_nothing_is_written() {
    let folder = TempDir::new().unwrap();
    let (_, file) = torus(folder.path(), &[]);
    let other = folder.path().join("sphere.ply");
    ply::write(&other, &meshes::sphere(20, 10)).unwrap();
    let before = names(folder.path());
    let finished = chart(
        &file.path,
        &other,
        &folder.path().join("chart"),
        &["--no-pictures"],
    );
    assert_eq!(finished.code, Some(1));
    for part in ["not the same model", "sphere.ply", "-1.000000", "1.4"] {
        assert!(
            finished.stderr.contains(part),
            "{part}: {}",
            finished.stderr
        );
    }
    assert!(!finished.panicked());
    assert_eq!(names(folder.path()), before);
}

#[test]
fn wrong_rows_of_other_tools_are_named_before_any_work() {
    let folder = TempDir::new().unwrap();
    let rows = folder.path().join("others.csv");
    std::fs::write(&rows, "tool,triangles,rms_rel\nx,10,1e-3\nx,ten,1e-3\n").unwrap();
    let missing = folder.path().join("missing.marq");
    let more = ["--external", rows.to_str().unwrap()];
    let finished = chart(&missing, &missing, &folder.path().join("chart"), &more);
    assert_eq!(finished.code, Some(1));
    for part in ["others.csv", "line 3", "triangles is `ten`"] {
        assert!(
            finished.stderr.contains(part),
            "{part}: {}",
            finished.stderr
        );
    }
    assert_eq!(names(folder.path()).len(), 1);
}

#[test]
fn few_samples_and_few_views_are_said() {
    let folder = TempDir::new().unwrap();
    let (input, file) = torus(folder.path(), &[]);
    let output = folder.path().join("chart");
    let line = arguments![
        "chart",
        &file.path,
        "--against",
        &input,
        "-o",
        &output,
        "--samples",
        "50",
        "--no-pictures",
        "--no-convert",
        "--levels",
        "2",
        "--json",
        "-"
    ];
    let report = marquetry(&line).unwrap().json().unwrap();
    let notes = report["notes"].to_string();
    assert!(notes.contains("50 samples are few"), "{notes}");
    assert!(report["adapter"].is_null() && report["pictures"].as_array().unwrap().is_empty());
    let html = std::fs::read_to_string(output.join("chart.html")).unwrap();
    assert!(html.contains("50 samples are few"));
}

#[test]
fn geomorph_pops_less_than_changes_at_once_and_rows_cost_what_their_models_do() {
    let folder = TempDir::new().unwrap();
    let (input, file) = torus(folder.path(), &[]);
    let output = folder.path().join("chart");
    let more = [
        "--transitions",
        "--views",
        "1",
        "--distances",
        "8",
        "--error-px",
        "4",
        "--size",
        "320x240",
        "--levels",
        "1",
        "--no-convert",
        "--json",
        "-",
    ];
    let report = chart(&file.path, &input, &output, &more).json().unwrap();
    let popping = |transition: &str, view: usize| {
        let points = report["transitions"].as_array().unwrap();
        let mut own = points.iter().filter(|p| p["transition"] == transition);
        let point = own.nth(view).unwrap();
        assert!(point["changes"].as_u64().unwrap() >= 2, "{point}");
        number(&point["temporal"]["p99"])
    };
    for view in 0..2 {
        let [none, geomorph] = ["none", "geomorph"].map(|name| popping(name, view));
        println!("view {view}: {none:.4} at once, {geomorph:.4} by geomorph");
        assert!(geomorph < 0.5 * none, "{geomorph} {none}");
    }
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4 * 6);
    for pair in rows
        .windows(2)
        .filter(|p| p[0]["transition"] == p[1]["transition"])
    {
        let [few, many] = [&pair[0], &pair[1]];
        let models = number(&many["instances"]) - number(&few["instances"]);
        let drawn = number(&many["triangles"]) - number(&few["triangles"]);
        // Those farthest away are at their coarsest, which is one node of at most 256 triangles.
        assert!(
            models > 0.0 && drawn > 0.0 && drawn <= 256.0 * models,
            "{few} {many}"
        );
    }
    assert_eq!(report["recommendations"].as_array().unwrap().len(), 6);
    let csv = std::fs::read_to_string(output.join("chart.csv")).unwrap();
    let of = |kind: &str| csv.lines().filter(|line| line.starts_with(kind)).count();
    assert_eq!((of("row,"), of("transition,")), (24, 8));
    let html = std::fs::read_to_string(output.join("chart.html")).unwrap();
    assert!(html.contains("many models in a row") && !html.contains("NaN"));
}
