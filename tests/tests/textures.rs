//! Textured scans from their images to the picture: colour tiles against direct texturing of the source.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use marquetry_engine::{ViewerOptions, Viewport};
use marquetry_native::Headless;
use marquetry_tests::stage::Stage;
use marquetry_tests::{Converted, WITH_CHARTS, arguments, convert, data, marquetry, textured};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// Views and distances, and how similar the picture is to the source there at least.
const NEAR_AND_FAR: [(usize, f64, f64); 4] =
    [(0, 2.5, 0.9), (4, 2.5, 0.9), (0, 1.2, 0.85), (0, 8.0, 0.9)];

/// The picture looks as the source does from these views and distances.
fn assert_similar(input: &Path, file: &Converted, from: &[(usize, f64, f64)]) {
    let headless = Headless::new().unwrap();
    for &(view, distance, least) in from {
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
    // All but those at the rim, whose triangles have no texels.
    let nodes = clusters["nodes"].as_u64().unwrap();
    assert!(count("clusters") <= nodes && 20 * count("clusters") >= 19 * nodes);
    assert!(
        3 * count("cluster_bytes") <= count("image_bytes"),
        "{textures}"
    );
    let verified = marquetry(&arguments!["verify", &file.path]).unwrap();
    verified.succeeded().unwrap();
    assert_similar(input, &file, &NEAR_AND_FAR);
}

/// A finely textured square, and beside it a wall of large triangles with a fraction of a texel each: how scans end.
fn walled(folder: &Path) -> PathBuf {
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 24
    };
    let mut image = image::RgbImage::new(256, 256);
    for (_, _, texel) in image.enumerate_pixels_mut() {
        *texel = image::Rgb([noise(), noise() / 2, 128].map(|c| u8::try_from(c).unwrap()));
    }
    image.save(folder.join("wall.png")).unwrap();
    std::fs::write(folder.join("wall.mtl"), "newmtl m\nmap_Kd wall.png\n").unwrap();
    let (mut text, mut count) = ("mtllib wall.mtl\nusemtl m\n".to_owned(), 0);
    let mut triangle = |corners: [[f64; 2]; 3], texels: [[f64; 2]; 3]| {
        use std::fmt::Write as _;
        for ([x, y], [u, v]) in corners.into_iter().zip(texels) {
            writeln!(text, "v {x} {y} 0\nvt {} {}", u / 256.0, 1.0 - v / 256.0).unwrap();
        }
        let [a, b, c] = [count + 1, count + 2, count + 3];
        writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}").unwrap();
        count += 3;
    };
    for (cells, side, x, wall) in [(32, 1.0, 0.0, false), (10, 2.0, 1.0, true)] {
        for k in 0..cells * cells {
            let [i, j] = [k % cells, k / cells].map(f64::from);
            let corner = |[a, b]: [f64; 2]| {
                let step = if wall { side } else { side / 32.0 };
                [x + (i + a) * step, (j + b) * step]
            };
            for (number, half) in [
                [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
                [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            ]
            .into_iter()
            .enumerate()
            {
                let texels = half.map(|[a, b]| {
                    if wall {
                        // A texel for every triangle: around its centre.
                        [
                            140.5 + 2.0 * (2.0 * i + number as f64) + 0.1 * a,
                            0.5 + 2.0 * j + 0.1 * b,
                        ]
                    } else {
                        [4.0 * (i + a), 8.0 * (j + b)]
                    }
                });
                triangle(half.map(corner), texels);
            }
        }
    }
    let path = folder.join("wall.obj");
    std::fs::write(&path, text).unwrap();
    path
}

/// A wavy square of large triangles, with an image of far shorter texels.
fn wavy(folder: &Path) -> PathBuf {
    use std::fmt::Write as _;
    const CELLS: usize = 150;
    let image = image::RgbImage::from_fn(2048, 2048, |i, j| {
        let wave = |at: u32, length: f64| (f64::from(at) / length).sin();
        let tone = 128.0 + 50.0 * wave(i, 23.0) * wave(j, 31.0) + 40.0 * wave(i + 2 * j, 70.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "38 to 218"
        )]
        let tone = tone as u8;
        image::Rgb([tone, 255 - tone, tone / 2])
    });
    image.save(folder.join("wavy.png")).unwrap();
    std::fs::write(folder.join("wavy.mtl"), "newmtl m\nmap_Kd wavy.png\n").unwrap();
    let mut text = "mtllib wavy.mtl\nusemtl m\n".to_owned();
    for k in 0..(CELLS + 1).pow(2) {
        let [x, y] = [k % (CELLS + 1), k / (CELLS + 1)].map(|c| c as f64 / CELLS as f64);
        let z = 0.02 * (45.0 * x).sin() * (45.0 * y).cos();
        writeln!(text, "v {x} {y} {z}\nvt {x} {y}").unwrap();
    }
    for k in 0..CELLS.pow(2) {
        let a = k / CELLS * (CELLS + 1) + k % CELLS + 1;
        let [b, c, d] = [a + 1, a + CELLS + 2, a + CELLS + 1];
        writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}\nf {a}/{a} {c}/{c} {d}/{d}").unwrap();
    }
    let path = folder.join("wavy.obj");
    std::fs::write(&path, text).unwrap();
    path
}

/// Groups of clusters whose children are the same triangles, with finer images: those that a view splits, and all.
fn split_for_images(headless: &Headless, bytes: &Arc<[u8]>, distance: f64) -> (usize, usize) {
    let (options, viewport) = (ViewerOptions::default(), Viewport::new(480, 360));
    let mut stage = Stage::open(headless, Arc::clone(bytes), options, viewport).unwrap();
    stage.look_from(0, distance).unwrap();
    stage.settle().unwrap();
    let viewer = stage.viewer();
    let clusters = viewer.document().clusters.as_ref().unwrap();
    let groups = clusters.groups.iter().filter(|group| !group.is_nearer);
    let cut = &viewer.drawn().cut;
    let split = groups.clone().filter(|group| cut.is_group_split(group));
    (split.count(), groups.count())
}

/// The same triangles are there with longer texels, so that who looks from afar does not read all images.
#[test]
fn images_finer_than_pixels_are_not_read() {
    let folder = TempDir::new().unwrap();
    let input = wavy(folder.path());
    let file = convert(&input, &["--charts", "never"]).unwrap();
    marquetry(&arguments!["verify", &file.path])
        .unwrap()
        .succeeded()
        .unwrap();
    let from = [0.4, 1.2, 2.5, 8.0].map(|distance| (0, distance, 0.985));
    assert_similar(&input, &file, &from);
    let headless = Headless::new().unwrap();
    let bytes: Arc<[u8]> = std::fs::read(&file.path).unwrap().into();
    let [(far, all), (near, _)] =
        [2.5, 0.25].map(|distance| split_for_images(&headless, &bytes, distance));
    println!("of {all} groups with finer images {far} are split from afar, {near} from near by");
    assert!(all > 20 && far == 0 && near > 0 && near < all / 2);
}

/// Colours of triangles without texels end where the triangles do, and what lies beside them stays sharp.
#[test]
fn large_triangles_of_one_colour_have_sharp_borders() {
    let folder = TempDir::new().unwrap();
    let input = walled(folder.path());
    let file = convert(&input, &["--charts", "never"]).unwrap();
    marquetry(&arguments!["verify", &file.path])
        .unwrap()
        .succeeded()
        .unwrap();
    let from = [(0, 1.2, 0.985), (0, 2.5, 0.985), (0, 6.0, 0.95)];
    assert_similar(&input, &file, &from);
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
    assert_similar(&input, &file, &NEAR_AND_FAR);
}
