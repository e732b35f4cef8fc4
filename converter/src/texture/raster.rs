//! Texels of a chart, sampled from the source.
//!
//! Every triangle of the patch is rasterized over the texels' centres; the first triangle by index owns a centre. A texel
//! whose footprint on the image is longer than a texel there is the mean of up to `MOST_SAMPLES`² samples spread over
//! it. Texels that rounding leaves without a triangle get that of their neighbour.

use super::appearance::{Material, TexturedFace};
use super::images::Texels;
use super::light::Light;
use crate::atlas::patch::Patch;
use crate::parameterize::Parametrization;
use glam::{DVec2, Vec2, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Samples of a texel along each axis at most.
const MOST_SAMPLES: u32 = 4;

/// Linear light, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Picture {
    /// Texels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The texels.
    pub light: Vec<Vec3>,
}

impl Picture {
    /// The texel (i, j); the nearest where it is outside.
    pub fn at(&self, i: i64, j: i64) -> Vec3 {
        let inside = |k: i64, count: u32| {
            usize::try_from(k.clamp(0, i64::from(count.max(1)) - 1)).unwrap_or_default()
        };
        let index = inside(j, self.height) * self.width as usize + inside(i, self.width);
        self.light.get(index).copied().unwrap_or_default()
    }

    /// The area mean of 2 × 2 texels each; both sides are even.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut light = Vec::with_capacity(width as usize * height as usize);
        for j in 0..i64::from(height) {
            for i in 0..i64::from(width) {
                let sum = self.at(2 * i, 2 * j)
                    + self.at(2 * i + 1, 2 * j)
                    + self.at(2 * i, 2 * j + 1)
                    + self.at(2 * i + 1, 2 * j + 1);
                light.push(0.25 * sum);
            }
        }
        Self {
            width,
            height,
            light,
        }
    }
}

/// Texels `x..x + width` by `y..y + height` of a chart of `across` × `up` texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// Texels of the whole chart along u and v.
    pub chart: (u32, u32),
    /// First texel.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Texels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A chart and what covers it.
#[derive(Debug)]
pub struct Canvas<'a> {
    /// The source's piece.
    pub patch: &'a Patch,
    /// Its place on the square.
    pub parametrization: &'a Parametrization,
    /// What covers its triangles.
    pub faces: &'a [TexturedFace],
    /// All materials.
    pub materials: &'a [Material],
    /// The images that the faces need.
    pub images: BTreeMap<u32, Arc<Texels>>,
}

impl Canvas<'_> {
    /// Samples a region.
    pub fn draw(&self, region: Region, light: &Light) -> Picture {
        let mut out = Picture {
            width: region.width,
            height: region.height,
            light: vec![Vec3::NAN; region.width as usize * region.height as usize],
        };
        for (triangle, face) in (0..self.patch.triangles.len()).zip(self.faces) {
            self.draw_face(triangle, face, region, light, &mut out);
        }
        fill_gaps(&mut out);
        out
    }

    fn draw_face(
        &self,
        triangle: usize,
        face: &TexturedFace,
        region: Region,
        light: &Light,
        out: &mut Picture,
    ) {
        let corners = self.patch.triangles[triangle];
        let chart = DVec2::new(f64::from(region.chart.0), f64::from(region.chart.1));
        let first = DVec2::new(f64::from(region.x), f64::from(region.y));
        let [a, b, c] = corners.map(|v| self.parametrization.uv[v as usize] * chart - first);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let Some((i0, i1)) = centres(low.x, high.x, region.width) else {
            return;
        };
        let Some((j0, j1)) = centres(low.y, high.y, region.height) else {
            return;
        };
        let area = (b - a).perp_dot(c - a);
        if area == 0.0 {
            return;
        }
        let paint = self.paint(corners, face);
        // How the weights of b and c grow along the rows and columns of texels.
        let step_i = (DVec2::new(c.y - a.y, a.y - b.y) / area).as_vec2();
        let step_j = (DVec2::new(a.x - c.x, b.x - a.x) / area).as_vec2();
        for j in j0..=j1 {
            for i in i0..=i1 {
                let place = &mut out.light[j as usize * region.width as usize + i as usize];
                if !place.is_nan() {
                    continue;
                }
                let point = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5);
                let s = (point - a).perp_dot(c - a) / area;
                let t = (b - a).perp_dot(point - a) / area;
                // A little wider than the triangle: no centre on an edge may fall between two.
                if s < -1e-9 || t < -1e-9 || s + t > 1.0 + 1e-9 {
                    continue;
                }
                #[expect(clippy::cast_possible_truncation, reason = "weights")]
                let weights = Vec2::new(s as f32, t as f32);
                *place = paint.mean(weights, step_i, step_j, light);
            }
        }
    }

    fn paint(&self, corners: [u32; 3], face: &TexturedFace) -> Paint<'_> {
        let colours = corners.map(|v| self.patch.attributes[v as usize].colour);
        Paint::new(colours, face, self.materials, &self.images)
    }
}

/// The colour over one triangle.
#[derive(Debug)]
pub(super) struct Paint<'a> {
    colours: [Vec3; 3],
    textured: Option<(&'a Material, &'a Texels, [Vec2; 3])>,
}

impl<'a> Paint<'a> {
    /// The image on `face`, if it is among `images`, else the `colours` of its corners, linear light.
    pub(super) fn new(
        colours: [Vec3; 3],
        face: &TexturedFace,
        materials: &'a [Material],
        images: &'a BTreeMap<u32, Arc<Texels>>,
    ) -> Self {
        let material = materials.get(face.material as usize);
        let textured = material.and_then(|material| {
            let texels = images.get(&material.image?)?;
            let size = Vec2::new(texels.width as f32, texels.height as f32);
            Some((material, texels.as_ref(), face.uv.map(|uv| uv * size)))
        });
        Self { colours, textured }
    }

    /// Texels of the image that the triangle covers; `None` without an image.
    pub(super) fn texels(&self) -> Option<f32> {
        let (_, _, [p, q, r]) = &self.textured?;
        Some(0.5 * (*q - *p).perp_dot(*r - *p).abs())
    }

    /// Whether the image is a single texel: a colour of its own, that ends where the triangle does.
    pub(super) fn is_plain(&self) -> bool {
        self.textured
            .is_some_and(|(_, texels, _)| texels.rgb.len() == 1)
    }

    /// The mean over a texel that moves the weights by `step_i` and `step_j`.
    pub(super) fn mean(&self, weights: Vec2, step_i: Vec2, step_j: Vec2, light: &Light) -> Vec3 {
        let samples = self.samples(step_i, step_j);
        let mut sum = Vec3::ZERO;
        for k in 0..samples * samples {
            let n = samples as f32;
            let part = Vec2::new((k % samples) as f32, (k / samples) as f32);
            let offset = (part + 0.5) / n - 0.5;
            sum += self.at(weights + step_i * offset.x + step_j * offset.y, light);
        }
        sum / (samples * samples) as f32
    }

    /// The colour at the weights of the second and third corner, kept inside the triangle.
    fn at(&self, weights: Vec2, light: &Light) -> Vec3 {
        let weights = weights.max(Vec2::ZERO);
        let weights = weights / (weights.x + weights.y).max(1.0);
        let blend = |a, b, c| a + (b - a) * weights.x + (c - a) * weights.y;
        if let Some((material, texels, [p, q, r])) = &self.textured {
            let place = *p + (*q - *p) * weights.x + (*r - *p) * weights.y;
            texels.sample(light, place, material.wrap) * material.factor
        } else {
            let [a, b, c] = self.colours;
            blend(a, b, c)
        }
    }

    /// Samples along each axis of a texel that moves the weights by `step_i` and `step_j`.
    fn samples(&self, step_i: Vec2, step_j: Vec2) -> u32 {
        let Some((_, _, [p, q, r])) = &self.textured else {
            return 1;
        };
        let travel = |step: Vec2| ((*q - *p) * step.x + (*r - *p) * step.y).length();
        let longest = travel(step_i).max(travel(step_j));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped; NaN becomes 0"
        )]
        let samples = (longest - 0.25).ceil().clamp(1.0, MOST_SAMPLES as f32) as u32;
        samples.max(1)
    }
}

/// The texels of a line of `count` whose centres lie between `low` and `high`.
fn centres(low: f64, high: f64, count: u32) -> Option<(u32, u32)> {
    let first = (low - 0.5 - 1e-6).ceil().max(0.0);
    let last = (high - 0.5 + 1e-6).floor().min(f64::from(count) - 1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within 0..count"
    )]
    let range = (first as u32, last as u32);
    (first <= last).then_some(range)
}

/// Gives texels without a colour that of a neighbour, ring by ring; black where there is none at all.
fn fill_gaps(picture: &mut Picture) {
    let (width, height) = (i64::from(picture.width), i64::from(picture.height));
    let whole = |k: usize| i64::try_from(k).unwrap_or(i64::MAX);
    loop {
        let empty: Vec<usize> = (0..picture.light.len())
            .filter(|&k| picture.light[k].is_nan())
            .collect();
        if empty.is_empty() {
            return;
        }
        let mut filled = Vec::new();
        for &k in &empty {
            let (i, j) = (whole(k) % width, whole(k) / width);
            let near = [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(di, dj)| (i + di, j + dj));
            let known = near
                .into_iter()
                .filter(|&(i, j)| (0..width).contains(&i) && (0..height).contains(&j))
                .map(|(i, j)| picture.at(i, j))
                .filter(|light| !light.is_nan());
            let (sum, count) = known.fold((Vec3::ZERO, 0.0), |(s, n), c| (s + c, n + 1.0));
            if count > 0.0 {
                filled.push((k, sum / count));
            }
        }
        if filled.is_empty() {
            picture.light.fill(Vec3::ZERO);
        }
        for (k, light) in filled {
            picture.light[k] = light;
        }
    }
}
