//! Vertex colours of a textured mesh: the mean of the texture over the triangles around each vertex.
//!
//! They are what the samples of the geometry carry, so the surface has its colours before any tile is there. A triangle's
//! mean is taken over at most `MOST_SAMPLES` places, spread evenly; it is weighted by the triangle's area.

use super::appearance::{Appearance, Material, TexturedFace};
use super::images::{ImageError, ImageStore, Texels};
use super::light::Light;
use crate::mesh::ImportedMesh;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Samples of a triangle at most.
const MOST_SAMPLES: u32 = 16;

/// The colour of every vertex of `mesh`, whose triangles have the [`face_means`] `means`: these times the vertex colour there
/// was. Vertices of untextured triangles keep theirs.
pub fn vertex_colours(mesh: &ImportedMesh, means: &[Option<Vec3>], light: &Light) -> Vec<[u8; 3]> {
    let mut sums = vec![(Vec3::ZERO, 0.0f32); mesh.positions.len()];
    for (triangle, mean) in mesh.triangles.iter().zip(means) {
        let Some(mean) = mean else { continue };
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        #[expect(clippy::cast_possible_truncation, reason = "a weight")]
        let area = (b - a).cross(c - a).length() as f32;
        let area = if area.is_finite() {
            area.max(f32::MIN_POSITIVE)
        } else {
            f32::MIN_POSITIVE
        };
        for &v in triangle {
            let (sum, weight) = &mut sums[v as usize];
            *sum += *mean * area;
            *weight += area;
        }
    }
    let own = |v: usize| mesh.colours.get(v).copied().unwrap_or([255; 3]);
    sums.iter()
        .enumerate()
        .map(|(v, (sum, weight))| {
            if *weight > 0.0 {
                light.srgb(*sum / *weight * light.linear(own(v)))
            } else {
                own(v)
            }
        })
        .collect()
}

/// The mean colour of every textured face, texture times factor without vertex colours. Each image is decoded once.
///
/// # Errors
/// When an image is damaged.
pub fn face_means(
    appearance: &Appearance,
    images: &ImageStore<'_>,
    light: &Light,
) -> Result<Vec<Option<Vec3>>, ImageError> {
    let mut by_image: Vec<Vec<u32>> = vec![Vec::new(); appearance.images.len()];
    for (face, number) in appearance.faces.iter().zip(0u32..) {
        if let Some(faces) = appearance
            .image_of(face)
            .and_then(|image| by_image.get_mut(image as usize))
        {
            faces.push(number);
        }
    }
    let parts: Vec<Vec<(u32, Vec3)>> = by_image
        .par_iter()
        .zip(0u32..u32::try_from(appearance.images.len()).unwrap_or(u32::MAX))
        .map(|(faces, image)| {
            if faces.is_empty() {
                return Ok(Vec::new());
            }
            let texels = images.get(image)?;
            let means = faces.iter().map(|&number| {
                let face = &appearance.faces[number as usize];
                let material = &appearance.materials[face.material as usize];
                (number, face_mean(face, material, &texels, light))
            });
            Ok(means.collect())
        })
        .collect::<Result<_, ImageError>>()?;
    let mut means = vec![None; appearance.faces.len()];
    for (mean, face) in means.iter_mut().zip(&appearance.faces) {
        // Replaced below where there is an image.
        *mean = appearance
            .materials
            .get(face.material as usize)
            .map(|m| m.factor);
    }
    for (number, mean) in parts.into_iter().flatten() {
        means[number as usize] = Some(mean);
    }
    Ok(means)
}

fn face_mean(face: &TexturedFace, material: &Material, texels: &Texels, light: &Light) -> Vec3 {
    let size = Vec2::new(texels.width as f32, texels.height as f32);
    let [a, b, c] = face.uv.map(|uv| uv * size);
    let area = 0.5 * (b - a).perp_dot(c - a).abs();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped; NaN becomes 0"
    )]
    let count = (area.ceil().clamp(1.0, MOST_SAMPLES as f32) as u32).max(1);
    let mut sum = Vec3::ZERO;
    for k in 0..count {
        // Points of the R₂ sequence, folded into the triangle.
        let k = k as f32 + 0.5;
        let (mut s, mut t) = ((0.754_877_7 * k).fract(), (0.569_840_3 * k).fract());
        if count == 1 {
            (s, t) = (1.0 / 3.0, 1.0 / 3.0);
        } else if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        sum += texels.sample(light, a + (b - a) * s + (c - a) * t, material.wrap);
    }
    sum / count as f32 * material.factor
}
