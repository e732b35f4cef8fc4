//! Which pixels a mesh covers, worked out on the CPU in `f64`.
//!
//! A pixel is covered when its centre lies in the projection of any triangle, edges included, whichever way the triangle
//! faces. Shared edges are evaluated in one order, so two triangles never both miss a centre between them.
//! Limit: no clipping; a triangle that reaches behind the eye is an error.

use anyhow::{Result, bail};
use glam::{DMat4, DVec2, DVec3};
use marquetry_evaluation::image::Mask;

/// The pixels that `triangles` cover in a picture of `width` × `height` pixels.
///
/// # Errors
/// When a corner does not lie before the eye.
pub fn coverage(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    clip_from_world: DMat4,
    width: usize,
    height: usize,
) -> Result<Mask> {
    let size = DVec2::new(width as f64, height as f64);
    let pixels: Vec<Option<DVec2>> = positions
        .iter()
        .map(|&position| {
            let clip = clip_from_world * position.extend(1.0);
            let ndc = DVec2::new(clip.x, -clip.y) / clip.w;
            (clip.w > 0.0 && ndc.is_finite()).then(|| (ndc + 1.0) * 0.5 * size)
        })
        .collect();
    let mut mask = Mask::empty(width, height);
    for triangle in triangles {
        let mut corners = [DVec2::ZERO; 3];
        for (corner, &vertex) in corners.iter_mut().zip(triangle) {
            let Some(pixel) = pixels[vertex as usize] else {
                bail!("vertex {vertex} lies behind the eye");
            };
            *corner = pixel;
        }
        cover(&mut mask, corners);
    }
    Ok(mask)
}

fn cover(mask: &mut Mask, [a, b, c]: [DVec2; 3]) {
    let area = edge(a, b, c);
    if area == 0.0 {
        return;
    }
    let sign = area.signum();
    let columns = pixel_range(a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x), mask.width());
    let rows = pixel_range(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), mask.height());
    for y in rows {
        for x in columns.clone() {
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            if [(a, b), (b, c), (c, a)]
                .iter()
                .all(|&(p, q)| sign * edge(p, q, centre) >= 0.0)
            {
                mask.insert(x, y);
            }
        }
    }
}

/// Pixels whose centres may lie in `min..=max`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts of floats saturate"
)]
fn pixel_range(min: f64, max: f64, len: usize) -> std::ops::Range<usize> {
    let start = (min - 0.5).ceil() as usize;
    let end = ((max + 0.5).floor() as usize).min(len);
    start.min(end)..end
}

/// Twice the area of `p`, `q`, `r`; exactly opposite for `q`, `p`, `r`.
fn edge(p: DVec2, q: DVec2, r: DVec2) -> f64 {
    if (p.x, p.y) <= (q.x, q.y) {
        (q - p).perp_dot(r - p)
    } else {
        -(p - q).perp_dot(r - q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;

    #[test]
    fn square_covers_the_pixels_within_it() {
        let positions = [
            DVec3::new(-0.5, -0.5, 0.0),
            DVec3::new(0.5, -0.5, 0.0),
            DVec3::new(0.5, 0.5, 0.0),
            DVec3::new(-0.5, 0.5, 0.0),
        ];
        for triangles in [[[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]] {
            let mask = coverage(&positions, &triangles, DMat4::IDENTITY, 8, 8).unwrap();
            assert_eq!(mask.count(), 16);
            assert!(mask.contains(2, 2) && mask.contains(5, 5) && !mask.contains(6, 5));
        }
    }

    #[test]
    fn closed_model_has_no_pinholes() {
        let sphere = meshes::sphere(200, 100);
        let clip_from_world = DMat4::from_scale(DVec3::splat(0.9));
        let mask = coverage(
            &sphere.positions,
            &sphere.triangles,
            clip_from_world,
            400,
            400,
        )
        .unwrap();
        for y in 0..400_usize {
            for x in 0..400_usize {
                let (u, v) = (x as f64 + 0.5 - 200.0, y as f64 + 0.5 - 200.0);
                let radius = u.hypot(v) / 180.0;
                assert!(mask.contains(x, y) || radius > 0.998, "({x}, {y})");
                assert!(!mask.contains(x, y) || radius < 1.0 + 1e-9, "({x}, {y})");
            }
        }
    }

    #[test]
    fn corner_behind_the_eye_is_an_error() {
        // An eye at the origin that looks along −z: w is −z.
        let mut clip_from_world = DMat4::IDENTITY;
        clip_from_world.z_axis.w = -1.0;
        clip_from_world.w_axis.w = 0.0;
        let positions = [DVec3::Z, DVec3::X - DVec3::Z, DVec3::Y - DVec3::Z];
        assert!(coverage(&positions, &[[0, 1, 2]], clip_from_world, 4, 4).is_err());
    }

    #[test]
    fn triangle_beside_the_picture_covers_nothing() {
        let positions = [
            DVec3::new(2.0, 2.0, 0.0),
            DVec3::new(3.0, 2.0, 0.0),
            DVec3::new(2.0, 3.0, 0.0),
        ];
        assert!(
            coverage(&positions, &[[0, 1, 2]], DMat4::IDENTITY, 4, 4)
                .unwrap()
                .is_empty()
        );
    }
}
