//! Pictures of a textured mesh made directly from its images, on the CPU: what the colour tiles are held against.
//!
//! Every pixel is the mean, in linear light, of 4 × 4 points; at each the nearest triangle's texture is sampled
//! bilinearly. No light falls on it. Limit: no clipping; triangles that reach behind the eye are left out.

use crate::raster::AROUND_FOUR_SAMPLES;
use crate::stage::Stage;
use anyhow::{Context, Result, ensure};
use glam::{DMat4, DVec2, DVec3, Vec2, Vec3};
use marquetry_converter::import;
use marquetry_converter::mesh::ImportedMesh;
use marquetry_converter::texture::images::ImageStore;
use marquetry_converter::texture::light::Light;
use marquetry_engine::{Shade, Transition, ViewerOptions, Viewport};
use marquetry_evaluation::image::{Image, Mask, ssim};
use marquetry_native::Headless;
use std::path::Path;
use std::sync::Arc;

/// Points of a pixel along each axis.
const POINTS: usize = 4;

/// A picture and where the mesh covers all of a pixel.
#[derive(Debug)]
pub struct Direct {
    /// RGBA, sRGB, row by row from the top.
    pub rgba: Vec<u8>,
    /// Covered pixels.
    pub mask: Mask,
}

/// Size of the pictures that [`similarity`] compares.
const SIZE: (u32, u32) = (640, 480);

/// SSIM between the settled picture of the file `marq` and direct texturing of its source, over the pixels that both cover but for their
/// rim, from a standard view and so many radii.
///
/// # Errors
/// When a file cannot be read or drawn, or hardly anything is seen.
pub fn similarity(
    headless: &Headless,
    input: &Path,
    marq: &Path,
    view: usize,
    distance: f64,
) -> Result<f64> {
    let bytes: Arc<[u8]> = std::fs::read(marq)?.into();
    let options = ViewerOptions {
        shade: Shade::Unlit,
        transition: Transition::None,
        ..ViewerOptions::default()
    };
    let viewport = Viewport::new(SIZE.0, SIZE.1);
    let mut stage = Stage::open(headless, bytes, options, viewport)?;
    stage.look_from(view, distance)?;
    stage.settle()?;
    let shown = stage.draw()?;
    let inside = stage.inside(&AROUND_FOUR_SAMPLES)?;
    let lattice = stage.viewer().document().metadata.lattice;
    let lattice_from_world = DMat4::from_scale(DVec3::splat(1.0 / lattice.step))
        * DMat4::from_translation(-DVec3::from_array(lattice.origin));
    let clip = stage.picture(&[]).clip_from_position * lattice_from_world;
    let (mesh, _) = import::import(input)?;
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let direct = draw(&mesh, clip, width, height)?;
    let mask = inside.intersection(&direct.mask.eroded())?;
    ensure!(mask.count() > 2_000, "{} pixels", mask.count());
    let shown = Image::new(width, height, &shown)?;
    let direct = Image::new(width, height, &direct.rgba)?;
    ssim(shown, direct, &mask)?.context("no pixel to compare")
}

/// Draws `mesh`, whose positions `clip_from_position` takes to clip coordinates.
///
/// # Errors
/// When an image is damaged.
pub fn draw(
    mesh: &ImportedMesh,
    clip_from_position: DMat4,
    width: usize,
    height: usize,
) -> Result<Direct> {
    let light = Light::new();
    let images = ImageStore::new(&mesh.appearance.images, u64::MAX);
    let (columns, rows) = (width * POINTS, height * POINTS);
    let size = DVec2::new(columns as f64, rows as f64);
    let mut nearest = vec![(f64::INFINITY, Vec3::ZERO); columns * rows];
    for (triangle, face) in mesh.triangles.iter().zip(&mesh.appearance.faces) {
        let material = mesh.appearance.materials.get(face.material as usize);
        // What has no material is drawn white.
        let material = material.copied().unwrap_or_default();
        let texels = material.image.map(|image| images.get(image)).transpose()?;
        let clip = triangle.map(|v| clip_from_position * mesh.positions[v as usize].extend(1.0));
        if clip.iter().any(|c| c.w <= 0.0) {
            continue;
        }
        let screen = clip.map(|c| (DVec2::new(c.x, -c.y) / c.w + 1.0) * 0.5 * size);
        for_each_point(screen, columns, rows, |at, weights| {
            let inverse = DVec3::from_array([0, 1, 2].map(|k| weights[k] / clip[k].w));
            let distance = 1.0 / inverse.element_sum();
            if distance < nearest[at].0 {
                let weights = (inverse * distance).as_vec3();
                let uv = face.uv[0] * weights.x + face.uv[1] * weights.y + face.uv[2] * weights.z;
                let colour = texels.as_ref().map_or(Vec3::ONE, |texels| {
                    let size = Vec2::new(texels.width as f32, texels.height as f32);
                    texels.sample(&light, uv * size, material.wrap)
                });
                nearest[at] = (distance, colour * material.factor);
            }
        });
    }
    let mut mask = Mask::empty(width, height);
    let mut rgba = Vec::with_capacity(4 * width * height);
    for pixel in 0..width * height {
        let (x, y) = (pixel % width, pixel / width);
        let points = (0..POINTS * POINTS)
            .map(|k| nearest[(y * POINTS + k / POINTS) * columns + x * POINTS + k % POINTS]);
        if points.clone().all(|(distance, _)| distance.is_finite()) {
            mask.insert(x, y);
        }
        let sum: Vec3 = points.map(|(_, colour)| colour).sum();
        let [r, g, b] = light.srgb(sum / (POINTS * POINTS) as f32);
        rgba.extend([r, g, b, 255]);
    }
    Ok(Direct { rgba, mask })
}

/// Visits the points in a triangle with their index and weights of the corners.
fn for_each_point(
    [a, b, c]: [DVec2; 3],
    columns: usize,
    rows: usize,
    mut visit: impl FnMut(usize, [f64; 3]),
) {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return;
    }
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts of floats saturate"
    )]
    let range = |low: f64, high: f64, count: usize| {
        (low.floor() as usize).min(count)..(high.max(0.0) as usize + 1).min(count)
    };
    for y in range(low.y, high.y, rows) {
        for x in range(low.x, high.x, columns) {
            let point = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let weights = [(b, c), (c, a), (a, b)].map(|(p, q)| (q - p).perp_dot(point - p) / area);
            if weights.iter().all(|&w| w >= 0.0) {
                visit(y * columns + x, weights);
            }
        }
    }
}
