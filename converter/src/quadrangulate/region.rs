//! One region as a triangulated disk, flattened to a convex polygon.

use super::QuadrangulateError;
use super::arcs::{Arc, Outline, Points, mix};
use crate::atlas::patch::Attributes;
use crate::mesh::NONE;
use crate::parameterize::{Flat, Weights, flatten};
use glam::{DVec2, DVec3};
use std::collections::HashMap;
use std::f64::consts::TAU;
use xxhash_rust::xxh3::Xxh3;

/// A region is to be split where more than this part of its area is lost in a speck.
const LOST_AREA: f64 = 0.02;

/// One side of a region, counter-clockwise.
#[derive(Debug)]
pub(super) struct RegionSide {
    /// Vertices, both corners included.
    pub(super) vertices: Vec<u32>,
    /// Index into `vertices` of the middle.
    pub(super) middle: usize,
    /// Borders of the first and the second half, and whether the side runs along them.
    pub(super) halves: [(u32, bool); 2],
}

/// A region with its own vertex numbers.
#[derive(Debug)]
pub(super) struct Region {
    pub(super) id: u32,
    pub(super) positions: Vec<DVec3>,
    pub(super) attributes: Vec<Attributes>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) sides: Vec<RegionSide>,
    /// Vertex of the whole mesh that each of the first vertices is; the others come from cutting.
    mesh_vertices: Vec<u32>,
}

impl Region {
    /// `mesh_vertices` is how many of the first points are the mesh's own vertices.
    pub(super) fn new(
        id: u32,
        mesh_vertices: usize,
        points: &Points,
        arcs: &[Arc],
        outline: &Outline,
    ) -> Result<Self, QuadrangulateError> {
        let mut used: Vec<u32> = outline.triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let missing = QuadrangulateError::Structure {
            region: id,
            fault: "a border point belongs to no triangle",
        };
        let local = |global: &u32| {
            used.binary_search(global)
                .ok()
                .and_then(|i| u32::try_from(i).ok())
        };
        let triangles = outline
            .triangles
            .iter()
            .map(|t| Some([local(&t[0])?, local(&t[1])?, local(&t[2])?]))
            .collect::<Option<Vec<_>>>();
        let sides = outline
            .sides
            .iter()
            .map(|&(id, forward)| {
                let arc = &arcs[id as usize];
                let mut vertices = arc.points.iter().map(local).collect::<Option<Vec<u32>>>()?;
                let (mut middle, mut halves) = (arc.middle, [(2 * id, true), (2 * id + 1, true)]);
                if !forward {
                    vertices.reverse();
                    middle = vertices.len() - 1 - middle;
                    halves = [(2 * id + 1, false), (2 * id, false)];
                }
                Some(RegionSide {
                    vertices,
                    middle,
                    halves,
                })
            })
            .collect::<Option<Vec<_>>>();
        let (Some(triangles), Some(sides)) = (triangles, sides) else {
            return Err(missing);
        };
        let mut region = Self {
            id,
            positions: used.iter().map(|&g| points.positions[g as usize]).collect(),
            attributes: used
                .iter()
                .map(|&g| points.attributes[g as usize])
                .collect(),
            triangles,
            sides,
            mesh_vertices: used
                .iter()
                .copied()
                .take_while(|&g| (g as usize) < mesh_vertices)
                .collect(),
        };
        region.split_chords()?;
        Ok(region)
    }

    /// Splits every interior edge whose ends lie on one side: on the polygon it would be flat.
    fn split_chords(&mut self) -> Result<(), QuadrangulateError> {
        // A corner lies on two sides.
        let mut on: Vec<[u32; 2]> = vec![[NONE; 2]; self.positions.len()];
        for (s, side) in (0u32..).zip(&self.sides) {
            for &v in &side.vertices {
                let slot = &mut on[v as usize];
                slot[usize::from(slot[0] != NONE)] = s;
            }
        }
        let mut uses: HashMap<(u32, u32), u32> = HashMap::new();
        let shared = |a: u32, b: u32| {
            let (a, b) = (on[a as usize], on[b as usize]);
            a.iter().any(|s| *s != NONE && b.contains(s))
        };
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if shared(a, b) {
                    *uses.entry((a.min(b), a.max(b))).or_default() += 1;
                }
            }
        }
        let mut chords: Vec<(u32, u32)> = uses
            .into_iter()
            .filter(|&(_, n)| n > 1)
            .map(|(e, _)| e)
            .collect();
        if chords.is_empty() {
            return Ok(());
        }
        chords.sort_unstable();
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        for (a, b) in chords {
            let Ok(id) = u32::try_from(self.positions.len()) else {
                return Err(QuadrangulateError::Structure {
                    region: self.id,
                    fault: "too many vertices",
                });
            };
            let (pa, pb) = (self.positions[a as usize], self.positions[b as usize]);
            self.positions.push(0.5 * (pa + pb));
            let attributes = mix(
                &self.attributes[a as usize],
                &self.attributes[b as usize],
                0.5,
            );
            self.attributes.push(attributes);
            middles.insert((a, b), id);
        }
        let mut triangles = Vec::with_capacity(self.triangles.len() + 2 * middles.len());
        for &t in &self.triangles {
            let m = [0, 1, 2].map(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                middles.get(&(a.min(b), a.max(b))).copied()
            });
            split_triangle(t, m, &mut triangles);
        }
        self.triangles = triangles;
        Ok(())
    }

    /// Positions on a convex polygon around the origin with one vertex a corner, sides in order; the middle of each
    /// side is the middle of the polygon's side.
    pub(super) fn flattened(&self, weights: Weights) -> Flat {
        let fixed = self.outline();
        flatten(&self.positions, &self.triangles, &fixed, weights)
    }

    /// Names what is in the region: equal regions are flattened alike.
    pub(super) fn key(&self) -> u128 {
        let mut hash = Xxh3::new();
        let mut add = |number: u64| hash.update(&number.to_le_bytes());
        for c in self.positions.iter().flat_map(DVec3::to_array) {
            add(c.to_bits());
        }
        add(u64::MAX);
        self.triangles
            .as_flattened()
            .iter()
            .for_each(|&v| add(v.into()));
        for side in &self.sides {
            add(u64::MAX);
            add(side.middle as u64);
            side.vertices.iter().for_each(|&v| add(v.into()));
        }
        hash.digest128()
    }

    /// The mesh's vertex at the tip of what `flat` has lost, if that is much.
    pub(super) fn speck(&self, flat: &Flat) -> Option<u32> {
        let (tip, _) = flat.tip.filter(|_| flat.lost > LOST_AREA)?;
        self.mesh_vertices.get(tip as usize).copied()
    }

    /// Where the border vertices go; `None` for the others.
    fn outline(&self) -> Vec<Option<DVec2>> {
        let n = self.sides.len() as f64;
        let lengths: Vec<f64> = self
            .sides
            .iter()
            .map(|s| self.length(&s.vertices))
            .collect();
        let total: f64 = lengths.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        // Half by number, half by length, and none near half a turn: the polygon holds its centre well inside.
        let mut shares: Vec<f64> = lengths
            .iter()
            .map(|l| 0.5 / n + 0.5 * (l / total).min(0.3))
            .collect();
        let sum: f64 = shares.iter().sum();
        for share in &mut shares {
            *share /= sum;
        }
        let mut angle = 0.0;
        let corners: Vec<DVec2> = shares
            .iter()
            .map(|share| {
                let corner = DVec2::from_angle(TAU * angle);
                angle += share;
                corner
            })
            .collect();
        let mut fixed = vec![None; self.positions.len()];
        for (s, side) in self.sides.iter().enumerate() {
            let (from, to) = (corners[s], corners[(s + 1) % corners.len()]);
            let (first, second) = side.vertices.split_at(side.middle);
            let middle = second[0];
            let half = |vertices: &mut dyn Iterator<Item = u32>,
                        from: DVec2,
                        to: DVec2,
                        fixed: &mut [Option<DVec2>]| {
                let ids: Vec<u32> = vertices.collect();
                let border = super::arcs::border(
                    ids.iter().map(|&v| self.positions[v as usize]).collect(),
                    Vec::new(),
                );
                for (&v, &t) in ids.iter().zip(&border.params) {
                    fixed[v as usize] = Some(from.lerp(to, t));
                }
            };
            let centre = from.midpoint(to);
            half(
                &mut first.iter().copied().chain([middle]),
                from,
                centre,
                &mut fixed,
            );
            half(&mut second.iter().copied(), centre, to, &mut fixed);
        }
        // The last side wrote corner 0 again, with the same value up to rounding.
        for (side, corner) in self.sides.iter().zip(&corners) {
            fixed[side.vertices[0] as usize] = Some(*corner);
        }
        fixed
    }

    fn length(&self, vertices: &[u32]) -> f64 {
        vertices
            .windows(2)
            .map(|w| self.positions[w[0] as usize].distance(self.positions[w[1] as usize]))
            .sum()
    }
}

/// Replaces triangle `t` by up to four around the middles `m` of its edges (edge k from corner k).
fn split_triangle(t: [u32; 3], m: [Option<u32>; 3], out: &mut Vec<[u32; 3]>) {
    match m {
        [None, None, None] => out.push(t),
        [Some(a), Some(b), Some(c)] => {
            out.extend([[t[0], a, c], [a, t[1], b], [c, b, t[2]], [a, b, c]]);
        }
        _ => {
            // Turn so that edge 0 has a middle, and edge 2 has none.
            let k = (0..3)
                .find(|&k| m[k].is_some() && m[(k + 2) % 3].is_none())
                .unwrap_or(0);
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            match (m[k], m[(k + 1) % 3]) {
                (Some(ab), Some(bc)) => out.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
                (Some(ab), None) => out.extend([[a, ab, c], [ab, b, c]]),
                _ => out.push(t),
            }
        }
    }
}
