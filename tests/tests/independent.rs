//! Measured distances are those that another implementation finds: `point-cloud-utils` of `PyPI`, which `cargo xtask setup-tests`
//! installs. Without it these tests fail; they are not left out.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_evaluation::distance::{Distances, measure};
use marquetry_tests::meshes::{self, Model};
use marquetry_tests::{BOTH_WAYS, arguments, convert, marquetry, ply};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SAMPLES: u64 = 400_000;
/// Largest difference, as a part of what the other found.
const TOLERANCE: f64 = 0.02;

fn python() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let python = test
        .ancestors()
        .nth(3)
        .unwrap()
        .join("tools/python/bin/python");
    assert!(
        python.is_file(),
        "{} is not there; cargo xtask setup-tests installs it",
        python.display()
    );
    python
}

fn as_json(model: &Model) -> Value {
    let positions: Vec<[f64; 3]> = model.positions.iter().map(glam::DVec3::to_array).collect();
    json!({ "positions": positions, "triangles": model.triangles })
}

/// What the other implementation says.
fn elsewhere(first: &Model, second: &Model) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("independent/distances.py");
    let mut child = Command::new(python())
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let task = json!({ "first": as_json(first), "second": as_json(second), "samples": SAMPLES });
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(task.to_string().as_bytes()).unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    serde_json::from_slice(&output.stdout).unwrap()
}

fn assert_agree(name: &str, first: &Model, second: &Model) {
    let ours: Distances = measure(first.mesh(), second.mesh(), SAMPLES).unwrap();
    let theirs = elsewhere(first, second);
    let agree = |what: &str, ours: f64, theirs: &Value| {
        let theirs = theirs.as_f64().unwrap();
        println!("{name}: {what} {ours:.6e}, elsewhere {theirs:.6e}");
        assert!(
            (ours - theirs).abs() <= TOLERANCE * theirs,
            "{name}: {what} is {ours}, elsewhere {theirs}"
        );
    };
    for (way, ours) in [("forward", ours.forward), ("backward", ours.backward)] {
        agree(&format!("{way} rms"), ours.rms, &theirs[way]["rms"]);
        agree(&format!("{way} max"), ours.max, &theirs[way]["max"]);
    }
    let [forward, backward] =
        ["forward", "backward"].map(|way| theirs[way]["angle"].as_f64().unwrap());
    let angle = json!(0.5 * (forward + backward));
    agree("angle", ours.normal_deviation_deg.mean, &angle);
}

#[test]
fn spheres_of_different_fineness() {
    assert_agree(
        "spheres",
        &meshes::sphere(24, 12),
        &meshes::sphere(200, 100),
    );
}

#[test]
fn a_plane_with_a_hole_and_one_without() {
    let (with, mut coarse) = (meshes::plane_with_hole(90), meshes::plane_with_hole(9));
    for position in &mut coarse.positions {
        position.z += 0.01 * position.x;
    }
    assert_agree("planes", &with, &coarse);
}

/// A cut as users get it, against what it was made of.
#[test]
fn a_converted_torus_and_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let source = meshes::torus(160, 80);
    let input = folder.path().join("torus.ply");
    ply::write(&input, &source).unwrap();
    for way in BOTH_WAYS {
        let file = convert(&input, &[&["--error-rel", "2e-3"], way].concat()).unwrap();
        let cut = folder.path().join("cut.ply");
        marquetry(&arguments![
            "export",
            &file.path,
            "-o",
            &cut,
            "--triangles",
            "3000"
        ])
        .unwrap()
        .succeeded()
        .unwrap();
        assert_agree("torus", &ply::read(&cut).unwrap(), &source);
    }
}
