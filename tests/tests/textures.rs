//! Textured scans from their images to the picture: colour tiles against direct texturing of the source.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use marquetry_native::Headless;
use marquetry_tests::{Converted, WITH_CHARTS, arguments, convert, data, marquetry, textured};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Near and far the picture looks as the source does.
fn assert_similar(input: &Path, file: &Converted) {
    let headless = Headless::new().unwrap();
    for (view, distance, least) in [(0, 2.5, 0.9), (4, 2.5, 0.9), (0, 1.2, 0.85), (0, 8.0, 0.9)] {
        let ssim = textured::similarity(&headless, input, &file.path, view, distance).unwrap();
        println!("view {view} at {distance}: SSIM {ssim:.4}");
        assert!(ssim >= least, "view {view} at {distance}: SSIM {ssim}");
    }
}

/// The scan at `input`, an OBJ file with an image beside it, without every hundredth triangle.
fn torn(input: &Path, folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(input).unwrap();
    let mut faces = 0;
    let kept = text.lines().filter(|line| {
        faces += usize::from(line.starts_with("f "));
        !line.starts_with("f ") || faces % 100 > 0
    });
    let torn = folder.join("torn.obj");
    std::fs::write(&torn, kept.collect::<Vec<_>>().join("\n")).unwrap();
    for name in ["texturedMesh.mtl", "texture_1001.png"] {
        std::fs::copy(input.with_file_name(name), folder.join(name)).unwrap();
    }
    torn
}

/// As it is, and with a hole for every hundred triangles: clusters with images of their own, at every level.
#[test]
fn a_scan_keeps_its_textures() {
    let Some(input) = data::find("textured_meshroom/texturedMesh.obj") else {
        return;
    };
    assert_keeps_textures(&input);
    let folder = TempDir::new().unwrap();
    assert_keeps_textures(&torn(&input, folder.path()));
}

fn assert_keeps_textures(input: &Path) {
    let file = convert(input, &[]).unwrap();
    assert_eq!(file.report["output"]["charts"], 0);
    let textures = &file.report["textures"];
    let count = |key: &str| textures[key].as_u64().unwrap();
    let clusters = &file.report["output"]["clusters"];
    assert!(
        clusters["triangles"].as_u64().unwrap() > 50_000,
        "{clusters}"
    );
    assert_eq!(count("clusters"), clusters["nodes"].as_u64().unwrap());
    assert!(
        3 * count("cluster_bytes") <= count("image_bytes"),
        "{textures}"
    );
    let verified = marquetry(&arguments!["verify", &file.path]).unwrap();
    verified.succeeded().unwrap();
    assert_similar(input, &file);
}

#[test]
fn charts_of_a_textured_scan_look_as_their_source_near_and_far() {
    let Some(input) = data::find("textured_meshroom/texturedMesh.obj") else {
        return;
    };
    // Coarse enough that charts take few samples for a triangle: at the default all of it becomes clusters.
    let coarse = ["--error-rel", "1.5e-4"];
    let file = convert(&input, &[&coarse, WITH_CHARTS].concat()).unwrap();
    assert!(file.report["output"]["charts"].as_u64().unwrap() > 20);
    let textures = &file.report["textures"];
    let count = |key: &str| textures[key].as_u64().unwrap();
    assert_eq!(textures["warnings"], Value::Array(Vec::new()));
    assert!(count("tiles") > 0);
    assert!(3 * count("bytes") <= count("image_bytes"), "{textures}");
    let verified = marquetry(&arguments!["verify", &file.path]).unwrap();
    verified.succeeded().unwrap();
    assert_similar(&input, &file);
}
