//! What segmentation needs to know of a mesh: edges, boundary loops, components, vertex areas.

use super::complex::id;
use super::contract::Cell;
use crate::mesh::{ManifoldMesh, NONE};
use glam::DVec3;
use rayon::prelude::*;

/// A mesh prepared for segmentation. Lengths are in units of the bounding box's longest side.
#[derive(Debug)]
pub(super) struct Surface {
    /// One cell a vertex: its position, normal, and a third of its triangles' area (never zero).
    pub(super) cells: Vec<Cell>,
    /// Boundary loop of every vertex, or [`NONE`].
    pub(super) loop_of: Vec<u32>,
    /// Vertices of every boundary loop, in order.
    pub(super) loops: Vec<Vec<u32>>,
    /// Vertices of every component, each along a Morton curve.
    pub(super) components: Vec<Vec<u32>>,
    /// Component of every vertex.
    pub(super) component_of: Vec<u32>,
    /// Mean length of all edges.
    pub(super) mean_length: f64,
    offsets: Vec<u32>,
    targets: Vec<u32>,
    /// Length of the edge to every target; never zero.
    lengths: Vec<f32>,
}

impl Surface {
    /// Prepares `mesh`.
    pub(super) fn of(mesh: &ManifoldMesh) -> Self {
        let ((offsets, targets), ((loop_of, loops), cells)) = rayon::join(
            || edges(mesh),
            || rayon::join(|| boundary(mesh), || cells(mesh)),
        );
        let mut surface = Self {
            cells,
            loop_of,
            loops,
            components: Vec::new(),
            component_of: vec![NONE; mesh.positions.len()],
            mean_length: 0.0,
            offsets,
            targets,
            lengths: Vec::new(),
        };
        surface.measure();
        surface.find_components();
        surface
    }

    /// Vertices joined to `v` by an edge, ascending.
    pub(super) fn neighbours(&self, v: u32) -> &[u32] {
        &self.targets[self.offsets[v as usize] as usize..self.offsets[v as usize + 1] as usize]
    }

    /// Vertices joined to `v` by an edge, ascending, and how long it is to seven digits.
    pub(super) fn edges_from(&self, v: u32) -> impl Iterator<Item = (u32, f64)> {
        let range = self.offsets[v as usize] as usize..self.offsets[v as usize + 1] as usize;
        let lengths = self.lengths[range.clone()].iter();
        self.targets[range]
            .iter()
            .zip(lengths)
            .map(|(&w, &length)| (w, f64::from(length)))
    }

    fn measure(&mut self) {
        const PIECE: usize = 1 << 12;
        let mut lengths = vec![0.0_f32; self.targets.len()];
        let mut rest = lengths.as_mut_slice();
        let mut pieces = Vec::new();
        for first in (0..self.cells.len()).step_by(PIECE) {
            let end = (first + PIECE).min(self.cells.len());
            let count = self.offsets[end] - self.offsets[first];
            let (own, after) = rest.split_at_mut(count as usize);
            pieces.push((id(first)..id(end), own));
            rest = after;
        }
        pieces.into_par_iter().for_each(|(vertices, own)| {
            let ends = vertices.flat_map(|v| self.neighbours(v).iter().map(move |&w| (v, w)));
            for (slot, (v, w)) in own.iter_mut().zip(ends) {
                #[expect(clippy::cast_possible_truncation, reason = "seven digits do")]
                let length = self.length(v, w) as f32;
                *slot = length.max(f32::MIN_POSITIVE);
            }
        });
        let sum: f64 = lengths.iter().map(|&length| f64::from(length)).sum();
        self.mean_length = sum / lengths.len().max(1) as f64;
        self.lengths = lengths;
    }

    /// Length of the edge `u`–`v`.
    pub(super) fn length(&self, u: u32, v: u32) -> f64 {
        self.cells[u as usize]
            .centroid
            .distance(self.cells[v as usize].centroid)
    }

    /// Area of all vertices of a component.
    pub(super) fn area(&self, component: usize) -> f64 {
        self.components[component]
            .iter()
            .map(|&v| self.cells[v as usize].area)
            .sum()
    }

    fn find_components(&mut self) {
        let mut stack = Vec::new();
        for start in 0..id(self.cells.len()) {
            if self.component_of[start as usize] != NONE || self.neighbours(start).is_empty() {
                continue;
            }
            let component = id(self.components.len());
            let mut members = Vec::new();
            self.component_of[start as usize] = component;
            stack.push(start);
            while let Some(v) = stack.pop() {
                members.push((morton(self.cells[v as usize].centroid), v));
                for at in self.offsets[v as usize]..self.offsets[v as usize + 1] {
                    let w = self.targets[at as usize];
                    if self.component_of[w as usize] == NONE {
                        self.component_of[w as usize] = component;
                        stack.push(w);
                    }
                }
            }
            members.par_sort_unstable();
            self.components
                .push(members.into_iter().map(|(_, v)| v).collect());
        }
    }
}

/// Neighbour lists as (offsets, targets), without repetition even if the mesh is not simplicial.
fn edges(mesh: &ManifoldMesh) -> (Vec<u32>, Vec<u32>) {
    let count = mesh.positions.len();
    let ends = || {
        mesh.triangles
            .iter()
            .zip(mesh.twins.chunks_exact(3))
            .flat_map(|(t, twins)| (0..3).map(move |k| (t[k], t[(k + 1) % 3], twins[k] == NONE)))
    };
    let mut slots = vec![0_u32; count + 1];
    for (u, v, open) in ends() {
        slots[u as usize + 1] += 1;
        slots[v as usize + 1] += u32::from(open);
    }
    for v in 0..count {
        slots[v + 1] += slots[v];
    }
    let mut lists = vec![0_u32; slots[count] as usize];
    let mut next = slots.clone();
    let mut put = |u: u32, v: u32| {
        lists[next[u as usize] as usize] = v;
        next[u as usize] += 1;
    };
    for (u, v, open) in ends() {
        put(u, v);
        if open {
            put(v, u);
        }
    }
    let mut offsets = Vec::with_capacity(count + 1);
    let mut targets = Vec::with_capacity(lists.len());
    offsets.push(0);
    for v in 0..count {
        let list = &mut lists[slots[v] as usize..slots[v + 1] as usize];
        list.sort_unstable();
        let first = targets.len();
        for &w in &*list {
            if targets.len() == first || targets.last() != Some(&w) {
                targets.push(w);
            }
        }
        offsets.push(id(targets.len()));
    }
    (offsets, targets)
}

fn boundary(mesh: &ManifoldMesh) -> (Vec<u32>, Vec<Vec<u32>>) {
    let mut following = vec![NONE; mesh.positions.len()];
    for (t, twins) in mesh.triangles.iter().zip(mesh.twins.chunks_exact(3)) {
        for k in 0..3 {
            if twins[k] == NONE {
                following[t[k] as usize] = t[(k + 1) % 3];
            }
        }
    }
    let mut loop_of = vec![NONE; mesh.positions.len()];
    let mut loops = Vec::new();
    for start in 0..id(following.len()) {
        let mut members = Vec::new();
        let mut v = start;
        while following[v as usize] != NONE && loop_of[v as usize] == NONE {
            loop_of[v as usize] = id(loops.len());
            members.push(v);
            v = following[v as usize];
        }
        if !members.is_empty() {
            loops.push(members);
        }
    }
    (loop_of, loops)
}

fn cells(mesh: &ManifoldMesh) -> Vec<Cell> {
    let low = mesh
        .positions
        .iter()
        .fold(DVec3::INFINITY, |a, &b| a.min(b));
    let high = mesh
        .positions
        .iter()
        .fold(DVec3::NEG_INFINITY, |a, &b| a.max(b));
    let size = (high - low).max_element();
    let unit = if size > 0.0 && size.is_finite() {
        size.recip()
    } else {
        1.0
    };
    let mut cells: Vec<Cell> = mesh
        .positions
        .iter()
        .enumerate()
        .map(|(v, &p)| Cell {
            centroid: (p - low) * unit,
            normal: mesh.normals.get(v).copied().unwrap_or(DVec3::ZERO),
            area: 0.0,
        })
        .collect();
    let mut total = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| cells[v as usize].centroid);
        let area = (b - a).cross(c - a).length() / 6.0;
        total += area * 3.0;
        for &v in t {
            cells[v as usize].area += area;
        }
    }
    // Zero weights would make centroids and costs undefined.
    let floor = (total / cells.len().max(1) as f64 * 1e-9).max(1e-200);
    for cell in &mut cells {
        cell.area = cell.area.max(floor);
    }
    cells
}

/// Interleaves 20 bits of each coordinate of a point of the unit cube.
fn morton(p: DVec3) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, as wanted"
    )]
    let spread = |x: f64| {
        let mut bits = (x * 1_048_575.0) as u64 & 0xf_ffff;
        bits = (bits | bits << 32) & 0x001f_0000_0000_ffff;
        bits = (bits | bits << 16) & 0x001f_0000_ff00_00ff;
        bits = (bits | bits << 8) & 0x100f_00f0_0f00_f00f;
        bits = (bits | bits << 4) & 0x10c3_0c30_c30c_30c3;
        (bits | bits << 2) & 0x1249_2492_4924_9249
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}
