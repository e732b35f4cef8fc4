//! Triangles to samples, by comparing depths.
//!
//! Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988. Corners are rounded to 1/256 of a sample, and what lies inside is decided by whole
//! numbers, edges included, so that two triangles never both miss a sample between them.

use crate::texture::light::Light;
use glam::{DVec3, Vec3};
use marquetry_format::TileTexels;

/// Samples along a side of a pixel.
pub(super) const SAMPLES: usize = 4;
/// Parts of a sample that corners are rounded to.
const PARTS: i64 = 256;

/// A corner of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    /// From the left and from the bottom, in parts of a sample.
    x: i64,
    y: i64,
    /// More is nearer.
    depth: f32,
    /// To the right, up and towards the eye; any length.
    normal: Vec3,
    /// What is reflected of light; linear.
    albedo: Vec3,
    /// Column and row of the texel that it lies in the middle of.
    texel: [f32; 2],
}

impl Corner {
    /// One at `place`, as [`View::place`](super::view::View::place) gives it.
    pub(super) fn new(place: DVec3, normal: Vec3, albedo: Vec3, texel: [f32; 2]) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "places are within the picture, and a far one stops at the largest number"
        )]
        let part = |samples: f64| (samples * PARTS as f64 + 0.5).floor() as i64;
        #[expect(clippy::cast_possible_truncation, reason = "21 bits and a fraction")]
        let depth = place.z as f32;
        Self {
            x: part(place.x),
            y: part(place.y),
            depth,
            normal,
            albedo,
            texel,
        }
    }

    /// Samples from the left.
    pub(super) fn column(&self) -> f64 {
        self.x as f64 / PARTS as f64
    }

    /// Samples from the bottom.
    pub(super) fn row(&self) -> f64 {
        self.y as f64 / PARTS as f64
    }
}

/// Samples of a picture, rows from the bottom.
#[derive(Debug)]
pub(super) struct Canvas {
    /// Samples a row.
    columns: usize,
    rows: usize,
    depth: Vec<f32>,
    /// Linear light; means nothing where `depth` is −∞.
    light: Vec<Vec3>,
}

impl Canvas {
    /// An empty picture of so many pixels.
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width * SAMPLES, height * SAMPLES);
        Self {
            columns,
            rows,
            depth: vec![f32::NEG_INFINITY; columns * rows],
            light: vec![Vec3::ZERO; columns * rows],
        }
    }

    /// Draws a triangle, seen from both sides; with `texture` instead of its corners' albedo.
    pub(super) fn triangle(&mut self, corners: [&Corner; 3], texture: Option<&Texture<'_>>) {
        let [a, b, c] = corners;
        let area = edge(a, b, c.x, c.y);
        if area == 0 {
            return;
        }
        let is_front = area > 0;
        let [a, b, c] = if is_front { [a, b, c] } else { [a, c, b] };
        let (Some(columns), Some(rows)) = (
            covered([a.x, b.x, c.x], self.columns),
            covered([a.y, b.y, c.y], self.rows),
        ) else {
            return;
        };
        let whole = area.abs() as f32;
        for row in rows {
            let y = middle(row);
            for column in columns.clone() {
                let x = middle(column);
                let parts = [edge(b, c, x, y), edge(c, a, x, y), edge(a, b, x, y)];
                if parts.iter().any(|&part| part < 0) {
                    continue;
                }
                let [u, v, w] = parts.map(|part| part as f32 / whole);
                let depth = u * a.depth + v * b.depth + w * c.depth;
                let at = row * self.columns + column;
                if depth <= self.depth[at] {
                    continue;
                }
                self.depth[at] = depth;
                let albedo = match texture {
                    Some(texture) => texture.albedo(
                        [0, 1]
                            .map(|axis| u * a.texel[axis] + v * b.texel[axis] + w * c.texel[axis]),
                    ),
                    None => u * a.albedo + v * b.albedo + w * c.albedo,
                };
                let normal = u * a.normal + v * b.normal + w * c.normal;
                self.light[at] = albedo * lit(normal, is_front);
            }
        }
    }

    /// The picture, four bytes a pixel (sRGB, then how much of it is covered), rows from the top.
    pub(super) fn resolve(&self, light: &Light) -> Vec<u8> {
        let mut rgba = Vec::with_capacity(4 * self.depth.len() / (SAMPLES * SAMPLES));
        for row in (0..self.rows / SAMPLES).rev() {
            for column in 0..self.columns / SAMPLES {
                let (mut sum, mut count) = (Vec3::ZERO, 0_usize);
                for sample in 0..SAMPLES * SAMPLES {
                    let (i, j) = (sample % SAMPLES, sample / SAMPLES);
                    let at = (row * SAMPLES + j) * self.columns + column * SAMPLES + i;
                    if self.depth[at] > f32::NEG_INFINITY {
                        sum += self.light[at];
                        count += 1;
                    }
                }
                rgba.extend(light.srgb(sum / count.max(1) as f32));
                let share = (count * 255 + SAMPLES * SAMPLES / 2) / (SAMPLES * SAMPLES);
                rgba.push(u8::try_from(share).unwrap_or(255));
            }
        }
        rgba
    }
}

/// The image of some triangles.
#[derive(Debug)]
pub(super) struct Texture<'a> {
    pub(super) texels: &'a TileTexels,
    pub(super) light: &'a Light,
}

impl Texture<'_> {
    /// Of the texel nearest to column and row `place`.
    fn albedo(&self, place: [f32; 2]) -> Vec3 {
        let TileTexels { width, height, rgb } = self.texels;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "below 256; NaN becomes 0"
        )]
        let nearest = |place: f32, side: u32| ((place + 0.5) as u32).min(side.saturating_sub(1));
        let [column, row] = [nearest(place[0], *width), nearest(place[1], *height)];
        let at = 3 * (row * width + column) as usize;
        let texel = rgb.get(at..at + 3).unwrap_or(&[0; 3]);
        self.light.linear([texel[0], texel[1], texel[2]])
    }
}

/// Twice the area of the triangle of `a`, `b` and a point: above 0 where the point is to the left of a → b.
fn edge(a: &Corner, b: &Corner, x: i64, y: i64) -> i64 {
    (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)
}

/// The middle of a sample.
fn middle(sample: usize) -> i64 {
    i64::try_from(sample).unwrap_or(i64::MAX / PARTS - 1) * PARTS + PARTS / 2
}

/// The samples whose middles lie between the least and the greatest of `places`, of `count` in all.
fn covered(places: [i64; 3], count: usize) -> Option<std::ops::Range<usize>> {
    let (min, max) = (places.iter().min()?, places.iter().max()?);
    let last = i64::try_from(count).ok()?;
    let start = (min + PARTS / 2 - 1).div_euclid(PARTS).clamp(0, last);
    let end = (max + PARTS / 2).div_euclid(PARTS).clamp(0, last);
    let range = usize::try_from(start).ok()?..usize::try_from(end).ok()?;
    (!range.is_empty()).then_some(range)
}

/// Cosine of the angle to the eye from which on a normal tells the side.
const CLEARLY: f32 = 0.25;

/// The viewer's light (`shared/light.wgsl`) on a surface; it comes with the eye.
fn lit(normal: Vec3, is_front: bool) -> Vec3 {
    const SKY: Vec3 = Vec3::new(0.27, 0.30, 0.35);
    const GROUND: Vec3 = Vec3::new(0.07, 0.06, 0.05);
    const KEY: Vec3 = Vec3::new(0.95, 0.91, 0.84);
    const TO_KEY: Vec3 = Vec3::new(-0.481_92, 0.525_73, 0.700_97);
    // Zero where normals cancel.
    let normal = normal.try_normalize().unwrap_or(Vec3::Z);
    // As in the viewer (`grid.wgsl`): a triangle may be turned over where its surface is not.
    let normal = if is_front || normal.z > CLEARLY {
        normal
    } else {
        -normal
    };
    let height = 0.5 + 0.5 * normal.y;
    GROUND + (SKY - GROUND) * height + KEY * normal.dot(TO_KEY).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, y: f64, depth: f64, albedo: Vec3) -> Corner {
        Corner::new(DVec3::new(x, y, depth), Vec3::Z, albedo, [0.0; 2])
    }

    fn square(canvas: &mut Canvas, [left, bottom, right, top]: [f64; 4], depth: f64, albedo: Vec3) {
        let corners = [[left, bottom], [right, bottom], [right, top], [left, top]]
            .map(|[x, y]| corner(x, y, depth, albedo));
        let [a, b, c, d] = &corners;
        canvas.triangle([a, b, c], None);
        canvas.triangle([a, c, d], None);
    }

    fn covered_samples(canvas: &Canvas) -> usize {
        canvas
            .depth
            .iter()
            .filter(|depth| depth.is_finite())
            .count()
    }

    #[test]
    fn a_square_covers_its_samples_and_no_others() {
        let mut canvas = Canvas::new(8, 8);
        square(&mut canvas, [4.0, 8.0, 20.0, 31.0], 1.0, Vec3::ONE);
        assert_eq!(covered_samples(&canvas), 16 * 23);
        let rgba = canvas.resolve(&Light::new());
        let alpha = |x: usize, y: usize| rgba[4 * (8 * y + x) + 3];
        assert_eq!([alpha(0, 3), alpha(1, 0), alpha(1, 1)], [0, 191, 255]);
        assert_eq!([alpha(4, 5), alpha(4, 6), alpha(5, 5)], [255, 0, 0]);
    }

    #[test]
    fn the_nearest_surface_wins_in_any_order() {
        let picture = |order: [usize; 2]| {
            let mut canvas = Canvas::new(4, 4);
            let shown = [(1.0, Vec3::X), (2.0, Vec3::Y)];
            for (depth, albedo) in order.map(|index| shown[index]) {
                square(&mut canvas, [0.0, 0.0, 16.0, 16.0], depth, albedo);
            }
            canvas.resolve(&Light::new())
        };
        let rgba = picture([0, 1]);
        assert_eq!(rgba, picture([1, 0]));
        assert!(
            rgba.chunks(4)
                .all(|p| p[0] == 0 && p[1] > 200 && p[3] == 255)
        );
    }

    #[test]
    fn triangles_that_share_edges_leave_no_sample_out() {
        let mut canvas = Canvas::new(16, 16);
        let middle = corner(31.3, 29.7, 1.0, Vec3::ONE);
        let around: Vec<Corner> = (0..64)
            .map(|k| {
                let k = f64::from(k);
                let along = 64.0 * (k % 16.0) / 16.0;
                let [x, y] = match k {
                    ..16.0 => [along, 0.0],
                    ..32.0 => [64.0, along],
                    ..48.0 => [64.0 - along, 64.0],
                    _ => [0.0, 64.0 - along],
                };
                corner(x, y, 1.0, Vec3::ONE)
            })
            .collect();
        for (k, corner) in around.iter().enumerate() {
            canvas.triangle([&middle, corner, &around[(k + 1) % 64]], None);
        }
        assert_eq!(covered_samples(&canvas), 64 * 64);
    }

    #[test]
    fn both_sides_are_lit_alike() {
        let light = |order: [usize; 3], normal| {
            let mut canvas = Canvas::new(1, 1);
            let corners = [[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]]
                .map(|[x, y]| Corner::new(DVec3::new(x, y, 0.0), normal, Vec3::ONE, [0.0; 2]));
            canvas.triangle(order.map(|at| &corners[at]), None);
            canvas.light[0]
        };
        let front = light([0, 1, 2], Vec3::Z);
        assert!(front.x > 0.7);
        assert_eq!(light([0, 2, 1], Vec3::NEG_Z), front);
        assert!(light([0, 1, 2], Vec3::NEG_Z).x < 0.3);
    }

    #[test]
    fn flat_and_far_triangles_draw_nothing() {
        let mut canvas = Canvas::new(2, 2);
        let far = corner(1e6, 1e6, 0.0, Vec3::ONE);
        let near = corner(9e5, 1e6, 0.0, Vec3::ONE);
        canvas.triangle([&far, &near, &far], None);
        canvas.triangle([&far, &near, &corner(1e6, 9e5, 0.0, Vec3::ONE)], None);
        assert_eq!(covered_samples(&canvas), 0);
    }
}
