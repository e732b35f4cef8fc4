//! Colours, materials and texture coordinates of a made-up sheet, compared with direct texturing of it.

use super::{Case, Found, Outcome, Part, errors, number};
use crate::{BOTH_WAYS, Finished, arguments, marquetry, textured};
use anyhow::{Result, ensure};
use marquetry_native::Headless;
use serde_json::Value;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Cells of a side, and of a block of the cases that need some.
const CELLS: u32 = 48;
const BLOCK: u32 = 6;
const SIDE: u32 = CELLS + 1;
/// Texels of a side of an image.
const TEXELS: u32 = 128;

/// What the sheet wears.
#[derive(Debug, Clone, Copy)]
enum Dress {
    /// One image.
    Plain,
    /// Another image, another place on it, and another turn for every block.
    Seams,
    /// Every second column of blocks has the image in a mirror.
    Mirrored,
    /// Every second block has no texture coordinates.
    Missing,
    /// The image is not there.
    NoImage,
    /// No image; every block has a material of its own colour.
    Colours,
    /// The same in PLY, as a property of faces, which are triangles.
    InPly,
    /// The same in OFF, behind the corners of faces.
    InOff,
}

impl Dress {
    const ALL: [(Self, &'static str, f64); 8] = [
        (Self::Plain, "one image", 0.9),
        (Self::Seams, "material seams", 0.85),
        (Self::Mirrored, "mirrored texture coordinates", 0.85),
        (Self::Missing, "missing texture coordinates", 0.85),
        (Self::NoImage, "missing image", 0.0),
        (Self::Colours, "colours of faces by materials", 0.85),
        (Self::InPly, "colours of faces in PLY", 0.85),
        (Self::InOff, "colours of faces in OFF", 0.85),
    ];
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (dress, name, least) in Dress::ALL {
        for (way, suffix) in BOTH_WAYS.into_iter().zip(["", ", charts"]) {
            // What is in the file does not matter to charts.
            let is_quick = match dress {
                Dress::Seams | Dress::Missing | Dress::Colours => true,
                Dress::InPly | Dress::InOff => way.is_empty(),
                _ => false,
            };
            cases.push(Case {
                part: Part::Attributes,
                set: is_quick.then_some("attributes"),
                name: format!("{name}{suffix}"),
                required: if least > 0.0 {
                    format!("converts, SSIM of {least} to its source")
                } else {
                    "converts, with a warning".to_owned()
                },
                run: Box::new(move |_| dressed(dress, least, way).map(Outcome::Met)),
            });
        }
    }
    cases
}

fn dressed(dress: Dress, least: f64, way: &[&str]) -> Result<Found> {
    let folder = tempfile::tempdir()?;
    let input = write(folder.path(), dress)?;
    let output = folder.path().join("out.marq");
    let mut run = arguments!["convert", &input, "-o", &output];
    run.extend(arguments!["--error-rel", "5e-4", "--json", "-"]);
    run.extend(way.iter().map(OsString::from));
    let report = marquetry(&run)?.json()?;
    let verified =
        marquetry(&arguments!["verify", &output, "--json", "-"]).and_then(Finished::json)?;
    ensure!(verified["ok"] == Value::Bool(true), "{verified}");
    let [rms, largest, bound] = errors(&report)?;
    ensure!(number(&report, "/lost/triangles")? == 0.0, "{report}");
    let warnings = report["textures"]["warnings"]
        .as_array()
        .map_or(0, Vec::len);
    let warns = matches!(dress, Dress::Missing | Dress::NoImage);
    ensure!((warnings > 0) == warns, "{}", report["textures"]);
    let images = number(&report, "/textures/clusters")? + number(&report, "/textures/tiles")?;
    let has_images = !matches!(dress, Dress::NoImage);
    ensure!((images > 0.0) == has_images, "{}", report["textures"]);
    let mut words = format!(
        "{} charts, {} clusters",
        report["output"]["charts"], report["output"]["clusters"]["nodes"]
    );
    if least > 0.0 {
        let headless = Headless::new()?;
        for (view, distance) in [(0, 2.5), (0, 1.2)] {
            let found = textured::similarity(&headless, &input, &output, view, distance)?;
            write!(words, ", SSIM {found:.3} from {distance}")?;
            ensure!(found >= least, "{words}, wanted {least}");
        }
    }
    Ok(Found {
        words,
        rms_rel: Some(rms),
        largest_rel: Some([largest, bound]),
    })
}

/// Writes the sheet, its materials and its images. Returns the sheet.
fn write(folder: &Path, dress: Dress) -> Result<PathBuf> {
    let (name, text) = match dress {
        Dress::InPly => ("sheet.ply", ply()?),
        Dress::InOff => ("sheet.off", off()?),
        _ => ("sheet.obj", obj(folder, dress)?),
    };
    let path = folder.join(name);
    std::fs::write(&path, text)?;
    Ok(path)
}

/// Positions, a line each.
fn vertices(keyword: &str) -> Result<String> {
    let mut text = String::new();
    for k in 0..SIDE * SIDE {
        let [x, y] = [k % SIDE, k / SIDE].map(|c| f64::from(c) / f64::from(CELLS));
        let z = 0.05 * (7.0 * x).sin() * (5.0 * y).cos();
        writeln!(text, "{keyword}{x} {y} {z}")?;
    }
    Ok(text)
}

fn cells() -> impl Iterator<Item = [u32; 2]> {
    (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| [i, j]))
}

/// Vertices of a cell, counted from 0.
fn corners([i, j]: [u32; 2]) -> [u32; 4] {
    let a = j * SIDE + i;
    [a, a + 1, a + SIDE + 1, a + SIDE]
}

/// The material of a cell whose block has its own.
fn material([i, j]: [u32; 2]) -> u32 {
    (i / BLOCK + 2 * (j / BLOCK)) % 4
}

/// Colour of all of a material.
fn plain(material: u32) -> [u8; 3] {
    colour(material, 40, 200)
}

fn ply() -> Result<String> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\n\
         property list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        SIDE * SIDE,
        2 * CELLS * CELLS
    );
    text += &vertices("")?;
    for cell in cells() {
        let ([a, b, c, d], [r, g, blue]) = (corners(cell), plain(material(cell)));
        writeln!(
            text,
            "3 {a} {b} {c} {r} {g} {blue}\n3 {a} {c} {d} {r} {g} {blue}"
        )?;
    }
    Ok(text)
}

fn off() -> Result<String> {
    let mut text = format!("OFF\n{} {} 0\n", SIDE * SIDE, CELLS * CELLS);
    text += &vertices("")?;
    for cell in cells() {
        let ([a, b, c, d], [red, green, blue]) = (corners(cell), plain(material(cell)));
        writeln!(text, "4 {a} {b} {c} {d} {red} {green} {blue}")?;
    }
    Ok(text)
}

fn obj(folder: &Path, dress: Dress) -> Result<String> {
    let mut library = String::new();
    for material in 0..4 {
        let name = format!("image{material}.png");
        writeln!(library, "newmtl m{material}")?;
        if matches!(dress, Dress::Colours) {
            let [r, g, b] = plain(material);
            writeln!(library, "Kd {} {} {}", part(r), part(g), part(b))?;
            continue;
        }
        writeln!(library, "Kd 1 1 1\nmap_Kd {name}")?;
        if !matches!(dress, Dress::NoImage) {
            let image =
                image::RgbImage::from_fn(TEXELS, TEXELS, |x, y| image::Rgb(colour(material, x, y)));
            image.save(folder.join(name))?;
        }
    }
    std::fs::write(folder.join("sheet.mtl"), library)?;
    let mut text = "mtllib sheet.mtl\n".to_owned();
    text += &vertices("v ")?;
    let mut coordinates = 0;
    let mut used = None;
    for [i, j] in cells() {
        let wanted = match dress {
            Dress::Seams | Dress::Colours => material([i, j]),
            _ => 0,
        };
        if used.replace(wanted) != Some(wanted) {
            writeln!(text, "usemtl m{wanted}")?;
        }
        let corners = corners([i, j]).map(|v| v + 1);
        let is_bare = matches!(dress, Dress::Missing) && (i / BLOCK + j / BLOCK) % 2 == 1;
        if is_bare || matches!(dress, Dress::Colours) {
            writeln!(
                text,
                "f {} {} {} {}",
                corners[0], corners[1], corners[2], corners[3]
            )?;
            continue;
        }
        for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
            let [u, v] = place(dress, [i, j], [i + di, j + dj]);
            writeln!(text, "vt {u} {v}")?;
        }
        text += "f";
        for (corner, n) in corners.into_iter().zip(1..) {
            write!(text, " {corner}/{}", coordinates + n)?;
        }
        text += "\n";
        coordinates += 4;
    }
    Ok(text)
}

/// Where on the image the corner `at` of a cell is.
fn place(dress: Dress, cell: [u32; 2], at: [u32; 2]) -> [f64; 2] {
    let whole = at.map(|c| f64::from(c) / f64::from(CELLS));
    let within = [0, 1].map(|k| f64::from(at[k] - cell[k] / BLOCK * BLOCK) / f64::from(BLOCK));
    let [block_i, block_j] = cell.map(|c| c / BLOCK);
    match dress {
        Dress::Seams if (block_i + block_j) % 2 == 1 => [1.0 - within[1], within[0]],
        Dress::Seams => within,
        Dress::Mirrored if block_i % 2 == 1 => [1.0 - within[0], whole[1]],
        Dress::Mirrored => [within[0], whole[1]],
        _ => whole,
    }
}

fn part(byte: u8) -> f64 {
    f64::from(byte) / 255.0
}

/// Soft waves, others for every material.
fn colour(material: u32, x: u32, y: u32) -> [u8; 3] {
    let phase = 1.3 * f64::from(material);
    let wave = |fx: f64, fy: f64, shift: f64| {
        let angle = 0.05 * (fx * f64::from(x) + fy * f64::from(y)) + phase + shift;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within 0..256"
        )]
        let byte = (128.0 + 100.0 * angle.sin()) as u8;
        byte
    };
    [
        wave(1.0, 0.4, 0.0),
        wave(-0.5, 1.0, 2.0),
        wave(0.8, 0.9, 4.0),
    ]
}
