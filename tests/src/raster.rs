//! Which pixels a mesh covers, worked out on the CPU in `f64`.
//!
//! A point of the picture is covered when it lies in the projection of any triangle, edges included, whichever way the
//! triangle faces. Shared edges are evaluated in one order, so two triangles never both miss a point between them.
//! Limit: no clipping. A triangle that reaches behind the eye is an error, or is left out where that is asked for.

use anyhow::{Result, bail, ensure};
use glam::{DMat4, DVec2, DVec3};
use marquetry_evaluation::image::Mask;
use std::ops::Range;

/// Where a picture is sampled without multisampling.
pub const CENTRE: [DVec2; 1] = [DVec2::splat(0.5)];

/// The standard sample positions of four-fold multisampling (Vulkan 1.0, section 25.4; Direct3D and Metal use the same).
pub const FOUR_SAMPLES: [DVec2; 4] = [
    DVec2::new(0.375, 0.125),
    DVec2::new(0.875, 0.375),
    DVec2::new(0.125, 0.625),
    DVec2::new(0.625, 0.875),
];

/// Points around those samples, farther from them than a rasterizer moves an edge when it snaps vertices to its grid of 1/256
/// pixel. Where a surface covers them all, it covers the samples for every rasterizer; beside a gap that is truly there, such as
/// a tunnel seen end on, a sample may be covered for one and not for another.
pub const AROUND_FOUR_SAMPLES: [DVec2; 16] = around(FOUR_SAMPLES);

const fn around(samples: [DVec2; 4]) -> [DVec2; 16] {
    const AWAY: f64 = 1.0 / 128.0;
    let mut points = [DVec2::ZERO; 16];
    let mut i = 0;
    while i < 16 {
        let sample = samples[i / 4];
        let x = if i % 2 == 0 { AWAY } else { -AWAY };
        let y = if i % 4 < 2 { AWAY } else { -AWAY };
        points[i] = DVec2::new(sample.x + x, sample.y + y);
        i += 1;
    }
    points
}

/// A picture to be covered.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// Clip coordinates (y up, w before the eye positive) of the positions.
    pub clip_from_position: DMat4,
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Points within a pixel, from its top left corner, in pixels; at most 16.
    pub samples: &'a [DVec2],
    /// Whether triangles may reach before the near plane (depth 1); they cover nothing then.
    pub is_within: bool,
    /// How many samples that follow each other a triangle covers all of, or none: 1, or with [`AROUND_FOUR_SAMPLES`] 4 for surfaces
    /// with T-junctions, where edges meet that are not the same for a rasterizer.
    pub together: usize,
}

/// The pixels of which `triangles` cover every sample.
///
/// # Errors
/// When a corner does not lie before the eye, and the picture is not from within.
pub fn coverage(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    picture: &Picture<'_>,
) -> Result<Mask> {
    ensure!(picture.samples.len() <= 16, "at most 16 samples");
    let size = DVec2::new(picture.width as f64, picture.height as f64);
    let pixels: Vec<Option<DVec2>> = positions
        .iter()
        .map(|&position| {
            let clip = picture.clip_from_position * position.extend(1.0);
            let ndc = DVec2::new(clip.x, -clip.y) / clip.w;
            let is_seen = clip.w > 0.0 && (!picture.is_within || clip.z <= clip.w);
            (is_seen && ndc.is_finite()).then(|| (ndc + 1.0) * 0.5 * size)
        })
        .collect();
    let mut covered = vec![0_u16; picture.width * picture.height];
    'triangles: for triangle in triangles {
        let mut corners = [DVec2::ZERO; 3];
        for (corner, &vertex) in corners.iter_mut().zip(triangle) {
            let Some(pixel) = pixels[vertex as usize] else {
                if picture.is_within {
                    continue 'triangles;
                }
                bail!("vertex {vertex} lies behind the eye");
            };
            *corner = pixel;
        }
        cover(&mut covered, picture, corners);
    }
    let all = u16::MAX >> (16 - picture.samples.len());
    let mut mask = Mask::empty(picture.width, picture.height);
    for (pixel, _) in covered
        .iter()
        .enumerate()
        .filter(|&(_, &samples)| samples == all)
    {
        mask.insert(pixel % picture.width, pixel / picture.width);
    }
    Ok(mask)
}

fn cover(covered: &mut [u16], picture: &Picture<'_>, [a, b, c]: [DVec2; 3]) {
    let area = edge(a, b, c);
    if area == 0.0 {
        return;
    }
    let sign = area.signum();
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let columns = pixel_range(min.x, max.x, picture.width);
    for y in pixel_range(min.y, max.y, picture.height) {
        for x in columns.clone() {
            let corner = DVec2::new(x as f64, y as f64);
            let is_in = |sample: &DVec2| {
                let point = corner + *sample;
                let sides = [(a, b), (b, c), (c, a)];
                (sides.iter()).all(|&(p, q)| sign * edge(p, q, point) >= 0.0)
            };
            let groups = picture.samples.chunks(picture.together.max(1));
            let mut first = 0;
            for samples in groups {
                if samples.iter().all(is_in) {
                    let bits = (1_u16 << samples.len().min(15)) - 1;
                    covered[y * picture.width + x] |= bits << first;
                }
                first += samples.len();
            }
        }
    }
}

/// Pixels that `min..=max` touches.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts of floats saturate"
)]
fn pixel_range(min: f64, max: f64, len: usize) -> Range<usize> {
    let start = (min.floor() as usize).min(len);
    let end = if max < 0.0 {
        0
    } else {
        (max as usize + 1).min(len)
    };
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

    fn picture(clip_from_position: DMat4, size: usize, samples: &[DVec2]) -> Picture<'_> {
        Picture {
            clip_from_position,
            width: size,
            height: size,
            samples,
            is_within: false,
            together: 1,
        }
    }

    #[test]
    fn square_covers_the_pixels_within_it() {
        let positions = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, y)| DVec3::new(x, y, 0.0));
        for triangles in [[[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]] {
            for samples in [&CENTRE[..], &FOUR_SAMPLES] {
                let mask = coverage(
                    &positions,
                    &triangles,
                    &picture(DMat4::IDENTITY, 8, samples),
                )
                .unwrap();
                assert_eq!(mask.count(), 16);
                assert!(mask.contains(2, 2) && mask.contains(5, 5) && !mask.contains(6, 5));
            }
        }
    }

    #[test]
    fn pixel_counts_when_all_its_samples_are_covered() {
        // Covers the left 60 % of the middle column of pixels: three of four samples are within.
        let positions = [
            (-1.0, -1.0),
            (0.2 / 3.0, -1.0),
            (0.2 / 3.0, 1.0),
            (-1.0, 1.0),
        ]
        .map(|(x, y)| DVec3::new(x, y, 0.0));
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let by_centre = coverage(
            &positions,
            &triangles,
            &picture(DMat4::IDENTITY, 3, &CENTRE),
        )
        .unwrap();
        let by_samples = coverage(
            &positions,
            &triangles,
            &picture(DMat4::IDENTITY, 3, &FOUR_SAMPLES),
        )
        .unwrap();
        assert_eq!((by_centre.count(), by_samples.count()), (6, 3));
    }

    #[test]
    fn closed_model_has_no_pinholes() {
        let sphere = meshes::sphere(200, 100);
        let clip_from_position = DMat4::from_scale(DVec3::splat(0.9));
        let mask = coverage(
            &sphere.positions,
            &sphere.triangles,
            &picture(clip_from_position, 400, &CENTRE),
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
        let mut clip_from_position = DMat4::IDENTITY;
        clip_from_position.z_axis.w = -1.0;
        clip_from_position.w_axis.w = 0.0;
        let positions = [DVec3::Z, DVec3::X - DVec3::Z, DVec3::Y - DVec3::Z];
        assert!(
            coverage(
                &positions,
                &[[0, 1, 2]],
                &picture(clip_from_position, 4, &CENTRE)
            )
            .is_err()
        );
    }

    #[test]
    fn triangle_beside_the_picture_covers_nothing() {
        for shift in [-3.0, 2.0] {
            let positions = [(0.0, 0.0), (0.9, 0.0), (0.0, 0.9)]
                .map(|(x, y)| DVec3::new(x + shift, y + shift, 0.0));
            let mask = coverage(
                &positions,
                &[[0, 1, 2]],
                &picture(DMat4::IDENTITY, 4, &CENTRE),
            )
            .unwrap();
            assert!(mask.is_empty());
        }
    }
}
