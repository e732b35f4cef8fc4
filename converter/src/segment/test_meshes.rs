//! Generated meshes to segment.

use crate::mesh::{ManifoldMesh, NONE};
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// xorshift64*.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(super) fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % bound
    }

    pub(super) fn signed(&mut self) -> f64 {
        self.below(2001) as f64 / 1000.0 - 1.0
    }
}

/// A triangle list on its way to a [`ManifoldMesh`].
#[derive(Clone, Default)]
pub(super) struct Soup {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Soup {
    /// `columns` × `rows` vertices placed by `at(u, v)` with u, v in 0..=1 (open) or 0..1 (wrapped).
    pub(super) fn grid(
        columns: u32,
        rows: u32,
        wrap: [bool; 2],
        at: impl Fn(f64, f64) -> DVec3,
    ) -> Self {
        let mut soup = Self::default();
        let span = |count: u32, wrapped: bool| f64::from(if wrapped { count } else { count - 1 });
        for j in 0..rows {
            for i in 0..columns {
                soup.positions.push(at(
                    f64::from(i) / span(columns, wrap[0]),
                    f64::from(j) / span(rows, wrap[1]),
                ));
            }
        }
        for j in 0..rows - u32::from(!wrap[1]) {
            for i in 0..columns - u32::from(!wrap[0]) {
                let (k, l) = ((i + 1) % columns, (j + 1) % rows);
                let [a, b, c, d] = [[i, j], [k, j], [k, l], [i, l]].map(|[i, j]| j * columns + i);
                soup.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        soup
    }

    pub(super) fn disk(columns: u32, rows: u32) -> Self {
        Self::grid(columns, rows, [false; 2], |u, v| {
            DVec3::new(u, v * f64::from(rows) / f64::from(columns), 0.0)
        })
    }

    pub(super) fn torus(columns: u32, rows: u32, thin: f64) -> Self {
        Self::grid(columns, rows, [true; 2], |u, v| {
            let (u, v) = (u * std::f64::consts::TAU, v * std::f64::consts::TAU);
            let r = 1.0 + thin * v.cos();
            DVec3::new(r * u.cos(), r * u.sin(), thin * v.sin())
        })
    }

    /// A tube of unit radius, its ends closed by fans if `closed`.
    pub(super) fn tube(around: u32, along: u32, length: f64, closed: bool) -> Self {
        let mut soup = Self::grid(around, along, [true, false], |u, v| {
            let u = u * std::f64::consts::TAU;
            DVec3::new(u.cos(), u.sin(), v * length)
        });
        if closed {
            for (ring, z, flip) in [(0, -0.5, true), ((along - 1) * around, length + 0.5, false)] {
                let pole = soup.positions.len() as u32;
                soup.positions.push(DVec3::new(0.0, 0.0, z));
                for i in 0..around {
                    let (a, b) = (ring + i, ring + (i + 1) % around);
                    soup.triangles
                        .push(if flip { [pole, b, a] } else { [pole, a, b] });
                }
            }
        }
        soup
    }

    /// A sphere of rings; the poles have valence `around`.
    pub(super) fn sphere(around: u32, along: u32) -> Self {
        let mut soup = Self::tube(around, along, 1.0, true);
        for p in &mut soup.positions {
            let angle = std::f64::consts::PI * (p.z.clamp(-0.5, 1.5) + 0.5) / 2.0;
            let around = p.y.atan2(p.x);
            let ring = if p.x == 0.0 && p.y == 0.0 {
                0.0
            } else {
                angle.sin().max(0.05)
            };
            *p = DVec3::new(ring * around.cos(), ring * around.sin(), -angle.cos());
        }
        soup
    }

    pub(super) fn tetrahedron() -> Self {
        Self {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    pub(super) fn append(&mut self, other: &Self, offset: DVec3) {
        let first = self.positions.len() as u32;
        self.positions
            .extend(other.positions.iter().map(|&p| p + offset));
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    /// Flips random edges where that keeps the surface simplicial.
    pub(super) fn flipped(mut self, random: &mut Random, tries: usize) -> Self {
        for _ in 0..tries {
            let opposite: HashMap<(u32, u32), usize> = self
                .triangles
                .iter()
                .enumerate()
                .flat_map(|(i, t)| (0..3).map(move |k| ((t[k], t[(k + 1) % 3]), i)))
                .collect();
            let mut touched = vec![false; self.triangles.len()];
            for _ in 0..self.triangles.len() / 4 {
                let i = random.below(self.triangles.len());
                let (k, t) = (random.below(3), self.triangles[i]);
                let (u, v, a) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
                let Some(&j) = opposite.get(&(v, u)) else {
                    continue;
                };
                let b = self.triangles[j]
                    .into_iter()
                    .find(|&w| w != u && w != v)
                    .unwrap();
                if touched[i] || touched[j] || a == b {
                    continue;
                }
                // A pass flips edges far from each other: what changed is not in `opposite`.
                let near = |w: u32| [u, v, a, b].contains(&w);
                let degree = |w: u32| self.triangles.iter().filter(|t| t.contains(&w)).count();
                if opposite.contains_key(&(a, b))
                    || opposite.contains_key(&(b, a))
                    || degree(u) < 5
                    || degree(v) < 5
                {
                    continue;
                }
                for (n, t) in self.triangles.iter().enumerate() {
                    touched[n] |= t.iter().any(|&w| near(w));
                }
                self.triangles[i] = [a, u, b];
                self.triangles[j] = [a, b, v];
            }
        }
        self
    }

    /// Removes the triangles around random vertices that share no triangle with each other or the border.
    pub(super) fn pierced(mut self, random: &mut Random, holes: usize) -> Self {
        let directed: HashSet<(u32, u32)> = self
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])))
            .collect();
        let mut busy = vec![false; self.positions.len()];
        for t in &self.triangles {
            for (u, v) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if !directed.contains(&(v, u)) {
                    busy[u as usize] = true;
                    busy[v as usize] = true;
                }
            }
        }
        for _ in 0..holes {
            let v = random.below(self.positions.len()) as u32;
            let star: Vec<u32> = self
                .triangles
                .iter()
                .filter(|t| t.contains(&v))
                .flatten()
                .copied()
                .collect();
            if star.is_empty() || star.iter().any(|&w| busy[w as usize]) {
                continue;
            }
            for w in star {
                busy[w as usize] = true;
            }
            self.triangles.retain(|t| !t.contains(&v));
        }
        self
    }

    pub(super) fn noisy(mut self, random: &mut Random, amplitude: f64) -> Self {
        for p in &mut self.positions {
            *p += DVec3::new(random.signed(), random.signed(), random.signed()) * amplitude;
        }
        self
    }

    /// Welds equal positions.
    pub(super) fn welded(self) -> Self {
        let mut ids: HashMap<[u64; 3], u32> = HashMap::new();
        let mut positions = Vec::new();
        let into: Vec<u32> = self
            .positions
            .iter()
            .map(|&p| {
                *ids.entry((p + 0.0).to_array().map(f64::to_bits))
                    .or_insert_with(|| {
                        positions.push(p);
                        positions.len() as u32 - 1
                    })
            })
            .collect();
        Self {
            positions,
            triangles: self
                .triangles
                .iter()
                .map(|t| t.map(|v| into[v as usize]))
                .collect(),
        }
    }

    /// Drops triangles that make a degenerate or third-sided edge, splits fans.
    pub(super) fn manifold(&self) -> ManifoldMesh {
        let mut directed: HashMap<(u32, u32), u32> = HashMap::new();
        let mut triangles = Vec::new();
        for &t in &self.triangles {
            let edges = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
            if edges
                .iter()
                .any(|edge| edge.0 == edge.1 || directed.contains_key(edge))
            {
                continue;
            }
            for (k, edge) in edges.into_iter().enumerate() {
                directed.insert(edge, triangles.len() as u32 * 3 + k as u32);
            }
            triangles.push(t);
        }
        let mut twins = vec![NONE; triangles.len() * 3];
        for (h, twin) in twins.iter_mut().enumerate() {
            let t = triangles[h / 3];
            *twin = directed
                .get(&(t[next(h) % 3], t[h % 3]))
                .copied()
                .unwrap_or(NONE);
        }
        let mut mesh = ManifoldMesh {
            triangles,
            twins,
            ..ManifoldMesh::default()
        };
        let mut done = vec![false; mesh.twins.len()];
        let old = mesh.triangles.clone();
        for corner in 0..done.len() {
            if done[corner] {
                continue;
            }
            let origin = old[corner / 3][corner % 3];
            let vertex = mesh.positions.len() as u32;
            mesh.positions.push(self.positions[origin as usize]);
            mesh.origin.push(origin);
            // Clockwise from the corner, then counter-clockwise.
            let mut at = corner;
            while !done[at] {
                done[at] = true;
                mesh.triangles[at / 3][at % 3] = vertex;
                match mesh.twins[at] {
                    NONE => break,
                    twin => at = next(twin as usize),
                }
            }
            at = corner;
            while let Some(&twin) = mesh.twins.get(next(next(at))).filter(|&&twin| twin != NONE) {
                at = twin as usize;
                if std::mem::replace(&mut done[at], true) {
                    break;
                }
                mesh.triangles[at / 3][at % 3] = vertex;
            }
        }
        let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            for &v in t {
                normals[v as usize] += (b - a).cross(c - a);
            }
        }
        mesh.normals = normals.into_iter().map(DVec3::normalize_or_zero).collect();
        mesh
    }
}

fn next(h: usize) -> usize {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}
