//! Patches for tests: all are counter-clockwise seen from +z, with corner 0 at the lower left.

#![expect(
    clippy::cast_possible_truncation,
    reason = "attributes are f32, rounding is meant"
)]

use crate::atlas::patch::{Attributes, Border, Patch};
use glam::{DVec3, Vec3};

/// `SplitMix64`.
#[derive(Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In 0..count.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.next() % count as u64).unwrap()
    }
}

/// Borders by arc length, running along the side where `forward` says so.
pub(crate) fn with_borders(mut patch: Patch, forward: [bool; 4]) -> (Patch, Vec<Border>) {
    let mut borders = Vec::new();
    for (side, along) in forward.into_iter().enumerate() {
        let mut vertices = patch.sides[side].clone();
        if !along {
            vertices.reverse();
        }
        let points: Vec<DVec3> = vertices
            .iter()
            .map(|&v| patch.positions[v as usize])
            .collect();
        let mut params = vec![0.0];
        for (k, pair) in points.windows(2).enumerate() {
            // The small constant keeps parameters increasing over points of zero distance.
            params.push(params[k] + pair[0].distance(pair[1]) + 1e-6);
        }
        let length = params[params.len() - 1];
        for param in &mut params {
            *param /= length;
        }
        let attributes = vertices
            .iter()
            .map(|&v| patch.attributes[v as usize])
            .collect();
        borders.push(Border {
            points,
            attributes,
            params,
        });
        patch.borders[side] = (u32::try_from(side).unwrap(), along);
    }
    (patch, borders)
}

/// `cells`² squares with jittered vertices and diagonals at random, bent by `height`.
pub(crate) fn bumpy(
    cells: usize,
    jitter: f64,
    seed: u64,
    height: impl Fn(f64, f64) -> f64,
) -> Patch {
    let mut random = Random(seed);
    let mut patch = Patch::default();
    let row = cells + 1;
    for j in 0..row {
        for i in 0..row {
            let inner = |k: usize| if k == 0 || k == cells { 0.0 } else { jitter };
            let x = (i as f64 + inner(i) * (random.unit() - 0.5)) / cells as f64;
            let y = (j as f64 + inner(j) * (random.unit() - 0.5)) / cells as f64;
            patch.positions.push(DVec3::new(x, y, height(x, y)));
            patch.attributes.push(Attributes {
                normal: Vec3::new(random.unit() as f32 - 0.5, random.unit() as f32 - 0.5, 1.0)
                    .normalize_or_zero(),
                colour: Vec3::new(x as f32, y as f32, random.unit() as f32),
                cap: 0.0,
            });
        }
    }
    let at = |i: usize, j: usize| u32::try_from(j * row + i).unwrap();
    for j in 0..cells {
        for i in 0..cells {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if random.below(2) == 0 {
                patch.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                patch.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    patch.sides = [
        (0..row).map(|i| at(i, 0)).collect(),
        (0..row).map(|j| at(cells, j)).collect(),
        (0..row).map(|i| at(cells - i, cells)).collect(),
        (0..row).map(|j| at(0, cells - j)).collect(),
    ];
    patch
}

/// Two triangles, and then `count` times a random triangle split at a random inner point, `noise` high.
pub(crate) fn shattered(count: usize, noise: f64, seed: u64) -> Patch {
    let mut random = Random(seed);
    let mut patch = bumpy(1, 0.0, seed, |_, _| 0.0);
    for vertex in (4u32..).take(count) {
        let at = random.below(patch.triangles.len());
        let [a, b, c] = patch.triangles[at];
        let (p, q) = (0.1 + 0.4 * random.unit(), 0.1 + 0.4 * random.unit());
        let weights = [p, q, 1.0 - p - q];
        let mut position = DVec3::ZERO;
        for (&corner, weight) in [a, b, c].iter().zip(weights) {
            position += patch.positions[corner as usize] * weight;
        }
        patch
            .positions
            .push(position + DVec3::Z * noise * (random.unit() - 0.5));
        patch.attributes.push(Attributes {
            normal: Vec3::Z,
            colour: Vec3::splat(random.unit() as f32),
            cap: 0.0,
        });
        patch.triangles[at] = [a, b, vertex];
        patch.triangles.extend([[b, c, vertex], [c, a, vertex]]);
    }
    patch
}
