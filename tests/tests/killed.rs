//! A conversion killed at any moment leaves nothing under the output's name, and nothing at all after the next run.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_tests::{arguments, binary, marquetry, meshes, ply};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const KILLS: usize = 20;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Moments spread over `0..1`, in an order that looks random.
fn moments() -> impl Iterator<Item = f64> {
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    (0..).map(move |k: u32| (f64::from(k) * golden).fract())
}

#[test]
fn killed_conversions_leave_nothing_behind() {
    let inputs = TempDir::new().unwrap();
    let input = inputs.path().join("torus.ply");
    ply::write(&input, &meshes::torus(160, 80)).unwrap();
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.marq");
    let convert = arguments!["convert", &input, "-o", &output];

    let start = Instant::now();
    marquetry(&convert).unwrap().succeeded().unwrap();
    let mut whole = start.elapsed();
    let expected = std::fs::read(&output).unwrap();
    std::fs::remove_file(&output).unwrap();
    assert!(names(folder.path()).is_empty());

    let mut killed = 0;
    for moment in moments().take(10 * KILLS) {
        if killed == KILLS {
            break;
        }
        let mut child = Command::new(binary::path().unwrap())
            .args(&convert)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(whole.as_secs_f64() * moment));
        child.kill().unwrap();
        let finished = child.wait().unwrap();
        if finished.code().is_none() {
            killed += 1;
        } else {
            // The machine is faster now than it was at first.
            whole = whole * 4 / 5;
        }
        let left = names(folder.path());
        if output.exists() {
            // The renaming had been reached: then all of it is there.
            assert_eq!(std::fs::read(&output).unwrap(), expected);
            std::fs::remove_file(&output).unwrap();
        }
        // What the last run but one left is gone.
        assert!(left.len() <= 2, "{left:?}");
    }
    assert_eq!(killed, KILLS, "too few were killed in time");

    marquetry(&convert).unwrap().succeeded().unwrap();
    assert_eq!(names(folder.path()), ["out.marq"]);
    assert_eq!(std::fs::read(&output).unwrap(), expected);

    // An older file survives, too.
    for moment in moments().take(4) {
        let mut child = Command::new(binary::path().unwrap())
            .args(&convert)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(whole.as_secs_f64() * moment));
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(std::fs::read(&output).unwrap(), expected);
    }
}

#[test]
fn a_full_disk_is_named_and_leaves_nothing() {
    let inputs = TempDir::new().unwrap();
    let input = inputs.path().join("torus.ply");
    ply::write(&input, &meshes::torus(160, 80)).unwrap();
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.marq");
    // A limit on the size of files fails writes as a full disk does; the signal that comes with it is ignored.
    let script = "trap '' XFSZ; ulimit -f 16; exec \"$0\" convert \"$1\" -o \"$2\"";
    let finished = Command::new("sh")
        .arg("-c")
        .arg(script)
        .arg(binary::path().unwrap())
        .args([&input, &output])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&finished.stderr).into_owned();
    assert_eq!(finished.status.code(), Some(1), "{said}");
    assert!(said.contains("out.marq: cannot be written"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_work() {
    let inputs = TempDir::new().unwrap();
    let input = inputs.path().join("torus.ply");
    ply::write(&input, &meshes::torus(160, 80)).unwrap();
    let folder = TempDir::new().unwrap();
    for output in [
        folder.path().join("absent/out.marq"),
        folder.path().to_owned(),
    ] {
        let finished = marquetry(&arguments![
            "--progress",
            "always",
            "convert",
            &input,
            "-o",
            &output
        ])
        .unwrap();
        assert_eq!(finished.code, Some(1));
        assert!(
            finished.stderr.contains("cannot be written"),
            "{}",
            finished.stderr
        );
        assert!(!finished.stderr.contains("import"), "{}", finished.stderr);
    }
    assert!(names(folder.path()).is_empty());
}

#[test]
fn the_memory_ceiling_holds() {
    let inputs = TempDir::new().unwrap();
    let input = inputs.path().join("torus.ply");
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.marq");
    // What the file announces is too much; it is refused before it is read.
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 300000\nproperty list uchar int vertex_indices\nend_header\n";
    std::fs::write(&input, format!("{text}{}", "3 0 1 2\n".repeat(300_000))).unwrap();
    let run = |memory: &str| {
        marquetry(&arguments![
            "convert", &input, "-o", &output, "--memory", memory
        ])
        .unwrap()
    };
    let finished = run("64M");
    assert_eq!(finished.code, Some(1));
    for word in ["torus.ply", "300000 triangles", "64 MiB", "--memory"] {
        assert!(finished.stderr.contains(word), "{}", finished.stderr);
    }
    // What turns out only on the way: many samples for few triangles, with charts.
    ply::write(&input, &meshes::torus(300, 150)).unwrap();
    let arguments = arguments![
        "convert",
        &input,
        "-o",
        &output,
        "--memory",
        "64M",
        "--error-rel",
        "5e-6",
        "--charts",
        "always"
    ];
    let finished = marquetry(&arguments).unwrap();
    assert_eq!(finished.code, Some(1));
    assert!(
        finished.stderr.contains("64 MiB of memory allowed"),
        "{}",
        finished.stderr
    );
    assert!(names(folder.path()).is_empty());
}
