//! A mesh of any kind, made by formula, and what can be done to it.

#![expect(
    clippy::cast_possible_truncation,
    reason = "made-up meshes have fewer than 2^32 vertices"
)]

use glam::DVec3;
use std::fmt::Write as _;

/// A mesh of any kind.
#[derive(Debug, Clone, Default)]
pub(crate) struct Soup {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// 64 bits that look random and depend on two numbers alone (splitmix64).
pub(crate) fn bits(seed: u64, counter: u64) -> u64 {
    let mut z = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(counter.wrapping_add(1).wrapping_mul(0xD1B5_4A32_D192_ED03));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// −1..1.
pub(crate) fn signed(seed: u64, counter: u64) -> f64 {
    (bits(seed, counter) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Soup {
    pub(crate) fn obj(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        for p in &self.positions {
            let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        text
    }

    pub(crate) fn vertex(&mut self, p: DVec3) -> u32 {
        self.positions.push(p);
        self.positions.len() as u32 - 1
    }

    pub(crate) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// This and `other`.
    pub(crate) fn with(mut self, other: &Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        self
    }

    /// Every vertex moved by up to `length` along each axis.
    pub(crate) fn shaken(mut self, length: f64, seed: u64) -> Self {
        for (n, p) in (0u64..).zip(&mut self.positions) {
            *p += length * DVec3::from_array([0, 1, 2].map(|axis| signed(seed, 3 * n + axis)));
        }
        self
    }

    /// About half of the triangles turned round.
    pub(crate) fn half_flipped(mut self, seed: u64) -> Self {
        for (n, t) in (0u64..).zip(&mut self.triangles) {
            if bits(seed, n) & 1 == 1 {
                t.swap(1, 2);
            }
        }
        self
    }

    /// One vertex in `every` pulled out to `length` times its distance from the origin.
    pub(crate) fn spiked(mut self, length: f64, every: usize) -> Self {
        let step = self.positions.len() / every;
        for p in self.positions.iter_mut().skip(step / 2).step_by(step) {
            *p *= length;
        }
        self
    }

    /// Every vertex moved by `f`.
    pub(crate) fn map(mut self, f: impl Fn(DVec3) -> DVec3) -> Self {
        for p in &mut self.positions {
            *p = f(*p);
        }
        self
    }

    /// One triangle in `every` cut in three at a point `share` of the way from an edge to the opposite corner: 0 leaves a triangle without
    /// area.
    pub(crate) fn pinched(mut self, every: usize, share: f64) -> Self {
        for t in (0..self.triangles.len()).step_by(every) {
            let [a, b, c] = self.triangles[t];
            let [p, q, r] = [a, b, c].map(|v| self.positions[v as usize]);
            let middle = p.midpoint(q);
            let m = self.vertex(middle.lerp(r, share));
            self.triangles[t] = [a, b, m];
            self.triangles.extend([[b, c, m], [c, a, m]]);
        }
        self
    }
}
