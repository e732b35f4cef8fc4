//! What a view draws and reads, and how far that is from the finest surface on the screen.
//!
//! `screen_error [--error-px PX] [--transition NAME] FILE...` prints a row for each file and distance. Every file is seen from view 14 (right, front and above) at
//! 1280 × 720 with one pixel of error, or PX, until nothing is missing. Points are taken of the surface drawn and of the finest one that the file has, evenly by area; the distance
//! of each that is in the picture from the other surface counts as many pixels as it is long at that point's distance from the eye, were it
//! seen from the side. What is out of the picture is drawn coarser.

use anyhow::{Context, Result};
use glam::DVec3;
use marquetry_engine::camera::{FIELD_OF_VIEW, View, lattice_from_world};
use marquetry_engine::lod::mesh::{Mesh, extract_mesh, extract_mesh_in_motion};
use marquetry_engine::lod::uniform::{Fineness, bytes_before_pages, uniform_cut};
use marquetry_engine::{Camera, Viewer, ViewerOptions, Viewport};
use marquetry_evaluation::distance::{self, Indexed};
use marquetry_format::{Document, Limits};

/// Bounding-sphere radii.
const DISTANCES: [f64; 3] = [1.2, 2.5, 8.0];
const VIEW: usize = 14;
const VIEWPORT: Viewport = Viewport {
    width: 1280,
    height: 720,
};
/// Points of either surface.
const SAMPLES: u64 = 300_000;
/// Frames until a view has to have settled.
const FRAMES: usize = 100_000;

fn main() -> Result<()> {
    println!(
        "| file | radii | triangles, of | bytes read, of the file | error, pixels: RMS | 99.9% | largest |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut options = ViewerOptions::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--error-px" {
            let px = arguments.next().context("--error-px PX")?;
            options.error_px = px.parse().with_context(|| px.clone())?;
        } else if argument == "--transition" {
            let name = arguments.next().context("--transition NAME")?;
            options.transition = name.parse()?;
        } else {
            rows(&argument, &options).with_context(|| argument.clone())?;
        }
    }
    Ok(())
}

fn rows(file: &str, options: &ViewerOptions) -> Result<()> {
    let source = marquetry_native::source::open(file)?;
    let mut document = Document::open(source.as_ref(), Limits::default())?;
    let opening = bytes_before_pages(&document);
    document.load_index(source.as_ref())?;
    let cut = uniform_cut(&document, Fineness::Finest)?;
    let finest = extract_mesh(&document, source.as_ref(), &cut)?;
    let whole = Indexed::new(of(&finest))?;
    let length = source.length()?;
    for distance in DISTANCES {
        let document = Document::open(source.as_ref(), Limits::default())?;
        let camera = Camera::standard(&document.metadata, VIEW, distance)?;
        let mut viewer = Viewer::new(document, options.clone())?;
        viewer.set_camera(camera);
        let mut read = opening;
        for _ in 0..FRAMES {
            for request in viewer.update(0.05, VIEWPORT) {
                let bytes = source.read(request.range.clone())?;
                read += bytes.len() as u64;
                viewer.deliver(request.id, Ok(bytes));
            }
            if viewer.is_settled() {
                break;
            }
        }
        anyhow::ensure!(
            viewer.is_settled(),
            "from {distance} radii it does not settle"
        );
        let drawn = extract_mesh_in_motion(viewer.document(), source.as_ref(), viewer.drawn())?;
        let metadata = &viewer.document().metadata;
        let eye = lattice_from_world(&metadata.lattice, camera.eye);
        let [right, up, back] = View::new(&camera, metadata, VIEWPORT).frame;
        let is_in_picture = |point: DVec3| {
            let offset = point - eye;
            let reach = -offset.dot(back) / (2.0 * px_per_slope());
            offset.dot(right).abs() <= f64::from(VIEWPORT.width) * reach
                && offset.dot(up).abs() <= f64::from(VIEWPORT.height) * reach
        };
        let both = [(&drawn, &whole), (&finest, &Indexed::new(of(&drawn))?)];
        let mut pixels = Vec::new();
        for (mesh, other) in both {
            let mut points = distance::samples(of(mesh), SAMPLES)?;
            points.retain(|&point| is_in_picture(point));
            let nearest = other.nearest(&points);
            pixels.extend(points.iter().zip(nearest).filter_map(|(point, nearest)| {
                Some(nearest?.distance2.sqrt() * px_per_slope() / point.distance(eye))
            }));
        }
        pixels.sort_unstable_by(f64::total_cmp);
        let squares: f64 = pixels.iter().map(|px| px * px).sum();
        let rare = pixels.get(pixels.len() * 999 / 1000);
        println!(
            "| {file} | {distance} | {}, {:.2} | {read}, {:.2} | {:.3} | {:.2} | {:.2} |",
            drawn.triangles.len(),
            drawn.triangles.len() as f64 / finest.triangles.len() as f64,
            read as f64 / length as f64,
            (squares / pixels.len() as f64).sqrt(),
            rare.context("nothing is drawn")?,
            pixels.last().context("nothing is drawn")?,
        );
    }
    Ok(())
}

fn of(mesh: &Mesh) -> distance::Mesh<'_> {
    distance::Mesh {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    }
}

/// Pixels of what is as long as its distance from the eye.
fn px_per_slope() -> f64 {
    f64::from(VIEWPORT.height) / (2.0 * (0.5 * FIELD_OF_VIEW).tan())
}
