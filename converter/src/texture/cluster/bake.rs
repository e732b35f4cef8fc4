//! The image of a mesh that was laid out.
//!
//! Every texel belongs to the triangle nearest to its centre, of those within reach of a patch's margin, and is asked for at the
//! place on it that is nearest. What lies farther from all of them is filled smoothly, from coarse to fine, for filters and for compression.

use super::super::images::Texels;
use super::super::light::Light;
use super::unwrap::Unwrapped;
use glam::{Vec2, Vec3};

/// Distance, texels, up to which a texel belongs to a triangle.
const REACH: f32 = 2.6;

/// A place on a triangle of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// The triangle.
    pub triangle: u32,
    /// Weights of its second and third corner.
    pub weights: Vec2,
}

/// How weights grow from texel to texel, along columns and along rows.
pub type Steps = [Vec2; 2];

#[derive(Clone, Copy)]
struct Flat {
    corners: [Vec2; 3],
    area: f32,
}

impl Flat {
    /// Squared distance of a point, and the weights of the nearest point.
    fn nearest(&self, point: Vec2) -> (f32, Vec2) {
        let [a, b, c] = self.corners;
        if self.area != 0.0 {
            let s = (point - a).perp_dot(c - a) / self.area;
            let t = (b - a).perp_dot(point - a) / self.area;
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                return (0.0, Vec2::new(s, t));
            }
        }
        let on_edge = |from: Vec2, to: Vec2| {
            let along = to - from;
            let part = (point - from).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
            let part = part.clamp(0.0, 1.0);
            ((from + along * part).distance_squared(point), part)
        };
        let (ab, bc, ca) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
        if ab.0 <= bc.0 && ab.0 <= ca.0 {
            (ab.0, Vec2::new(ab.1, 0.0))
        } else if bc.0 <= ca.0 {
            (bc.0, Vec2::new(1.0 - bc.1, bc.1))
        } else {
            (ca.0, Vec2::new(0.0, 1.0 - ca.1))
        }
    }

    /// Zero where weights do not follow from texels.
    fn steps(&self) -> Steps {
        let [a, b, c] = self.corners;
        // Rounding has left little of such a triangle.
        if self.area.abs() < 1.0 {
            return [Vec2::ZERO; 2];
        }
        [
            Vec2::new(c.y - a.y, a.y - b.y) / self.area,
            Vec2::new(a.x - c.x, b.x - a.x) / self.area,
        ]
    }
}

/// Asks for the colour, linear light, of every texel that belongs to a triangle. With more than one of `samples` a side a texel is the mean of
/// that many squared: it shows what part of it belongs to which.
pub fn bake(
    mesh: &Unwrapped,
    light: &Light,
    samples: u32,
    colour: impl Fn(Spot, Steps) -> Vec3,
) -> Texels {
    let [width, height] = mesh.size;
    let flats: Vec<Flat> = mesh
        .triangles
        .iter()
        .map(|t| {
            let corners = t.map(|v| {
                let (_, [i, j]) = mesh.vertices[v as usize];
                Vec2::new(f32::from(i), f32::from(j))
            });
            let [a, b, c] = corners;
            let area = (b - a).perp_dot(c - a);
            Flat { corners, area }
        })
        .collect();
    let steps: Vec<Steps> = flats
        .iter()
        .map(|flat| flat.steps().map(|step| step / samples as f32))
        .collect();
    let count = width as usize * height as usize;
    let mut texels: Vec<Option<(Vec3, f32)>> = vec![None; count];
    for k in 0..samples * samples {
        let part = Vec2::new((k % samples) as f32, (k / samples) as f32);
        let offset = (part + 0.5) / samples as f32 - 0.5;
        for (texel, owner) in texels
            .iter_mut()
            .zip(owners([width, height], &flats, offset))
        {
            if let Some(spot) = owner {
                let (sum, count) = texel.get_or_insert_default();
                *sum += colour(spot, steps[spot.triangle as usize]);
                *count += 1.0;
            }
        }
    }
    let texels = texels
        .into_iter()
        .map(|texel| texel.map(|(sum, count)| sum / count));
    let filled = filled([width, height], texels.collect());
    Texels {
        width,
        height,
        rgb: filled.into_iter().map(|texel| light.srgb(texel)).collect(),
    }
}

/// The place nearest to the point of every texel that is so far from its centre.
fn owners([width, height]: [u32; 2], flats: &[Flat], offset: Vec2) -> Vec<Option<Spot>> {
    let mut owners: Vec<Option<(f32, Spot)>> = vec![None; width as usize * height as usize];
    for (triangle, flat) in (0u32..).zip(flats) {
        let [a, b, c] = flat.corners;
        let low = (a.min(b).min(c) - REACH).ceil().max(Vec2::ZERO).as_uvec2();
        let high = (a.max(b).max(c) + REACH).as_uvec2();
        for j in low.y..=high.y.min(height.saturating_sub(1)) {
            for i in low.x..=high.x.min(width.saturating_sub(1)) {
                let owner = &mut owners[j as usize * width as usize + i as usize];
                let before = owner.map_or(REACH * REACH, |(distance2, _)| distance2);
                if before == 0.0 {
                    continue;
                }
                let (distance2, weights) = flat.nearest(Vec2::new(i as f32, j as f32) + offset);
                if distance2 < before {
                    *owner = Some((distance2, Spot { triangle, weights }));
                }
            }
        }
    }
    let owners = owners.into_iter();
    owners.map(|owner| Some(owner?.1)).collect()
}

/// Fills gaps with the mean of what is there, from coarse to fine.
fn filled([width, height]: [u32; 2], texels: Vec<Option<Vec3>>) -> Vec<Vec3> {
    if width <= 1 && height <= 1 {
        return texels.into_iter().map(Option::unwrap_or_default).collect();
    }
    if texels.iter().all(Option::is_some) {
        return texels.into_iter().flatten().collect();
    }
    let (across, up) = (width.div_ceil(2), height.div_ceil(2));
    let mut coarse = Vec::with_capacity(across as usize * up as usize);
    for j in 0..up {
        for i in 0..across {
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| (2 * i + x, 2 * j + y)) {
                if x < width
                    && y < height
                    && let Some(texel) = texels[y as usize * width as usize + x as usize]
                {
                    sum += texel;
                    count += 1.0;
                }
            }
            coarse.push((count > 0.0).then(|| sum / count));
        }
    }
    let coarse = filled([across, up], coarse);
    let below = |k: usize| {
        let (i, j) = (k % width as usize / 2, k / width as usize / 2);
        coarse[j * across as usize + i]
    };
    let texels = texels.iter().enumerate();
    texels
        .map(|(k, texel)| texel.unwrap_or_else(|| below(k)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A right triangle with legs of 10 texels whose corner is at (4, 4), on an image of 24 × 24.
    fn triangle() -> Unwrapped {
        Unwrapped {
            vertices: vec![(0, [4, 4]), (1, [14, 4]), (2, [4, 14])],
            triangles: vec![[0, 1, 2]],
            size: [24, 24],
            scale: 1.0,
        }
    }

    #[test]
    fn texels_are_asked_for_where_they_lie() {
        let light = Light::new();
        let image = bake(&triangle(), &light, 1, |spot, [step_i, step_j]| {
            assert!(step_i.distance(Vec2::new(0.1, 0.0)) < 1e-6);
            assert!(step_j.distance(Vec2::new(0.0, 0.1)) < 1e-6);
            Vec3::new(spot.weights.x, spot.weights.y, 0.0)
        });
        let at = |i: usize, j: usize| light.linear(image.rgb[24 * j + i]);
        for [i, j] in [[4, 4], [14, 4], [4, 14], [7, 9]] {
            let expected = Vec3::new(i as f32 - 4.0, j as f32 - 4.0, 0.0) / 10.0;
            assert!(at(i, j).distance(expected) < 0.01, "{i} {j}");
        }
        // Beside it, what is nearest: along the legs and beyond the longest side.
        assert!(at(3, 9).distance(at(4, 9)) < 0.01);
        assert!(at(2, 9).distance(at(4, 9)) < 0.01);
        assert!(at(10, 10).distance(Vec3::new(0.5, 0.5, 0.0)) < 0.01);
        // Far away some colour that is there, rather than black.
        assert!(at(23, 23).length() > 0.1);
    }

    #[test]
    fn texels_across_a_border_show_both_sides() {
        let mut mesh = triangle();
        mesh.vertices.push((3, [14, 14]));
        mesh.triangles.push([1, 3, 2]);
        let light = Light::new();
        for (samples, expected) in [(1, Vec3::X), (2, Vec3::new(0.75, 0.25, 0.0))] {
            let image = bake(&mesh, &light, samples, |spot, [step_i, _]| {
                if spot.triangle == 0 {
                    assert!((step_i.x * samples as f32 - 0.1).abs() < 1e-6);
                    Vec3::X
                } else {
                    Vec3::Y
                }
            });
            let at = |i: usize, j: usize| light.linear(image.rgb[24 * j + i]);
            // What lies on the border itself is the first one's.
            assert!(at(9, 9).distance(expected) < 0.01, "{}", at(9, 9));
            assert!(at(8, 8).distance(Vec3::X) < 0.01);
            assert!(at(10, 10).distance(Vec3::Y) < 0.01);
        }
    }

    #[test]
    fn triangles_without_extent_on_the_image_do_no_harm() {
        let mut mesh = triangle();
        mesh.vertices.push((3, [9, 9]));
        mesh.triangles.insert(0, [1, 3, 2]);
        let image = bake(&mesh, &Light::new(), 1, |spot, _| {
            if spot.triangle == 1 { Vec3::X } else { Vec3::Y }
        });
        assert_eq!(image.rgb[24 * 6 + 6], [255, 0, 0]);
        assert_eq!(image.rgb.len(), 24 * 24);
    }
}
