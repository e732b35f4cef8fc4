//! Pictures of a textured mesh made directly from its images, on the CPU: what the colour tiles are held against.
//!
//! Every pixel is the mean, in linear light, of 4 × 4 points; at each the nearest triangle's texture is sampled
//! bilinearly. No light falls on it. Limit: no clipping; triangles that reach behind the eye are left out.

use anyhow::{Context, Result};
use glam::{DMat4, DVec2, DVec3, Vec2, Vec3};
use marquetry_converter::mesh::ImportedMesh;
use marquetry_converter::texture::images::ImageStore;
use marquetry_converter::texture::light::Light;
use marquetry_evaluation::image::Mask;

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
        let Some(material) = mesh.appearance.materials.get(face.material as usize) else {
            continue;
        };
        let texels = images.get(material.image.context("an image")?)?;
        let image_size = Vec2::new(texels.width as f32, texels.height as f32);
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
                let colour = texels.sample(&light, uv * image_size, material.wrap);
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
