//! Components on the lattice, packed into leaves.
//!
//! A component's triangles stay as they are, with their corners rounded to the lattice; those that lose their extent are
//! left out, and what that moves is in the leaf's error. Normals are those of the mesh, but for vertices whose faces turn
//! more than `CREASE` away from them: there each face sees only those of about its own direction, so that a cube is not lit
//! like a ball.
//! Components follow each other along a Hilbert curve, and fill one leaf after the other. One that does not fit a leaf is halved
//! until its parts do; these are the children of one node, which a cut takes all or none of, so that no crack can open
//! between them.

use super::bound::{Target, hausdorff};
use super::shape::{Shape, Vertex, point};
use super::simplify::simplified;
use crate::atlas::chart_graph::hilbert_key;
use crate::atlas::quantize::lattice_from_world;
use crate::mesh::ManifoldMesh;
use glam::DVec3;
use marquetry_format::cluster::{
    MAX_CLUSTER_CHILDREN, MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES,
};
use marquetry_format::lattice::LATTICE_BITS;
use marquetry_format::writer::ClusterInput;
use marquetry_format::{Lattice, octahedral};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cosine of the angle (40°) up to which faces share a normal.
const CREASE: f64 = 0.766;

/// Most triangles of a component: halves of what just does not fit still are as few as a node has children.
pub const MOST_TRIANGLES: usize = MAX_CLUSTER_CHILDREN * MAX_CLUSTER_TRIANGLES / 2;

/// A part of a component on the lattice.
struct Piece {
    shape: Shape,
    /// Bound of its distance to the component, lattice units.
    error: f64,
}

/// Nodes that hold `components` of at most [`MOST_TRIANGLES`], in the order of a space-filling curve.
pub fn nodes(
    mesh: &ManifoldMesh,
    components: &[Vec<u32>],
    lattice: &Lattice,
    colours: bool,
) -> Vec<ClusterInput> {
    let mut found: Vec<(u64, Vec<Piece>)> = components
        .par_iter()
        .map(|component| {
            let component = Component::new(mesh, component, lattice);
            (component.key(), component.pieces())
        })
        .collect();
    found.sort_by_key(|&(key, _)| key);
    let mut nodes = Vec::new();
    let (mut shape, mut error) = (Shape::default(), 0.0f64);
    for (_, pieces) in found {
        let [piece] = pieces.as_slice() else {
            nodes.push(assembly(&pieces, colours));
            continue;
        };
        let triangles = shape.triangles.len() + piece.shape.triangles.len();
        let vertices = shape.vertices.len() + piece.shape.vertices.len();
        if triangles > MAX_CLUSTER_TRIANGLES || vertices > MAX_CLUSTER_VERTICES {
            nodes.push(leaf(&std::mem::take(&mut shape), error, colours));
            error = 0.0;
        }
        shape.append(&piece.shape);
        error = error.max(piece.error);
    }
    if !shape.triangles.is_empty() {
        nodes.push(leaf(&shape, error, colours));
    }
    nodes
}

/// A component of several leaves.
fn assembly(pieces: &[Piece], colours: bool) -> ClusterInput {
    let mut whole = Shape::default();
    for piece in pieces {
        whole.append(&piece.shape);
    }
    let below = pieces.iter().map(|piece| piece.error).fold(0.0, f64::max);
    let (coarser, error) = simplified(&whole);
    ClusterInput {
        mesh: coarser.cluster(colours),
        error: upwards(below + error),
        children: pieces
            .iter()
            .map(|piece| leaf(&piece.shape, piece.error, colours))
            .collect(),
    }
}

fn leaf(shape: &Shape, error: f64, colours: bool) -> ClusterInput {
    ClusterInput {
        mesh: shape.cluster(colours),
        error: upwards(error),
        children: Vec::new(),
    }
}

/// The least `f32` that is not below `length`.
pub(super) fn upwards(length: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounded up again")]
    let rounded = length as f32;
    if f64::from(rounded) < length {
        rounded.next_up()
    } else {
        rounded
    }
}

struct Component<'a> {
    mesh: &'a ManifoldMesh,
    triangles: &'a [u32],
    lattice: &'a Lattice,
    /// Faces at each vertex.
    faces: BTreeMap<u32, Vec<u32>>,
}

impl<'a> Component<'a> {
    fn new(mesh: &'a ManifoldMesh, triangles: &'a [u32], lattice: &'a Lattice) -> Self {
        let mut faces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &t in triangles {
            for v in mesh.triangles[t as usize] {
                faces.entry(v).or_default().push(t);
            }
        }
        Self {
            mesh,
            triangles,
            lattice,
            faces,
        }
    }

    /// The component in as few parts as clusters have room for.
    fn pieces(&self) -> Vec<Piece> {
        // One leaf without creases is better than two with them.
        if self.triangles.len() <= MAX_CLUSTER_TRIANGLES && self.faces.len() <= MAX_CLUSTER_VERTICES
        {
            let is_creased =
                self.shape(self.triangles, true).0.vertices.len() <= MAX_CLUSTER_VERTICES;
            return vec![self.piece(self.triangles, is_creased)];
        }
        for creased in [true, false] {
            let mut pieces = Vec::new();
            self.split(&mut self.triangles.to_vec(), creased, &mut pieces);
            if pieces.len() <= MAX_CLUSTER_CHILDREN || !creased {
                return pieces;
            }
        }
        Vec::new()
    }

    /// Halves `triangles` across their longest extent until the parts fit clusters.
    fn split(&self, triangles: &mut [u32], creased: bool, pieces: &mut Vec<Piece>) {
        let fits = triangles.len() <= MAX_CLUSTER_TRIANGLES
            && self.shape(triangles, creased).0.vertices.len() <= MAX_CLUSTER_VERTICES;
        if fits || triangles.len() < 2 {
            pieces.push(self.piece(triangles, creased));
            return;
        }
        let centre = |&t: &u32| self.corners(t).into_iter().sum::<DVec3>() / 3.0;
        let (low, high) = triangles
            .iter()
            .map(centre)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let axis = (high - low).max_position();
        let half = triangles.len() / 2;
        triangles.select_nth_unstable_by(half, |a, b| {
            centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(b))
        });
        let (lower, upper) = triangles.split_at_mut(half);
        self.split(lower, creased, pieces);
        self.split(upper, creased, pieces);
    }

    fn piece(&self, triangles: &[u32], creased: bool) -> Piece {
        let (mut shape, flat) = self.shape(triangles, creased);
        let mut error = if shape.triangles.is_empty() {
            shape = self.stand_in(triangles);
            self.whole_error(triangles, &shape)
        } else {
            self.moved_error(triangles)
        };
        if !shape.triangles.is_empty() && !flat.is_empty() {
            let positions = shape.positions();
            if let Some(target) = Target::new(&positions, &shape.triangles) {
                for t in flat {
                    error = error.max(target.distance(self.corners(t), error));
                }
            }
        }
        Piece { shape, error }
    }

    /// Place along the curve.
    fn key(&self) -> u64 {
        let vertices = self.faces.len().max(1) as f64;
        let centre = self.faces.keys().map(|&v| self.place(v)).sum::<DVec3>() / vertices;
        hilbert_key(centre / f64::from(1u32 << LATTICE_BITS))
    }

    /// Where a vertex is, lattice units.
    fn place(&self, v: u32) -> DVec3 {
        let origin = DVec3::from_array(self.lattice.origin);
        (self.mesh.positions[v as usize] - origin) / self.lattice.step
    }

    fn corners(&self, t: u32) -> [DVec3; 3] {
        self.mesh.triangles[t as usize].map(|v| self.place(v))
    }

    fn rounded(&self, v: u32) -> [u32; 3] {
        lattice_from_world(self.lattice, self.mesh.positions[v as usize])
    }

    /// Some triangles on the lattice, and those that have lost their extent there.
    fn shape(&self, triangles: &[u32], creased: bool) -> (Shape, Vec<u32>) {
        let mut shape = Shape::default();
        let mut flat = Vec::new();
        for &t in triangles {
            let corners = self.mesh.triangles[t as usize];
            if !shape.triangle(corners.map(|v| self.vertex(v, t, creased))) {
                flat.push(t);
            }
        }
        (shape, flat)
    }

    /// Vertex `v` as face `t` sees it.
    fn vertex(&self, v: u32, t: u32, creased: bool) -> Vertex {
        let mut normal = self.mesh.normals[v as usize];
        let around = self.faces.get(&v).map_or(&[][..], Vec::as_slice);
        let turns = |&f: &u32| self.face_normal(f).dot(normal) < CREASE;
        if creased && around.iter().any(turns) {
            let own = self.face_normal(t);
            let alike = around
                .iter()
                .map(|&f| self.face_normal(f))
                .filter(|n| n.dot(own) >= CREASE);
            normal = alike.sum::<DVec3>().normalize_or(normal);
        }
        let colour = self.mesh.colours.get(v as usize).copied();
        (
            self.rounded(v),
            octahedral::encode(normal.as_vec3().to_array()),
            colour.unwrap_or_default(),
        )
    }

    /// Unit normal of a face; zero where it has no area.
    fn face_normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// How far rounding moves a vertex at most: what lies between vertices moves no farther.
    fn moved_error(&self, triangles: &[u32]) -> f64 {
        triangles
            .iter()
            .flat_map(|&t| self.mesh.triangles[t as usize])
            .map(|v| self.place(v).distance(point(self.rounded(v))))
            .fold(0.0, f64::max)
    }

    /// Of a shape that does not correspond to the triangles vertex by vertex.
    fn whole_error(&self, triangles: &[u32], shape: &Shape) -> f64 {
        let positions: Vec<DVec3> = triangles.iter().flat_map(|&t| self.corners(t)).collect();
        let triangles: Vec<[u32; 3]> = (0u32..)
            .zip(triangles)
            .map(|(k, _)| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        let own = shape.positions();
        hausdorff(
            (&positions, &triangles),
            (&own, &shape.triangles),
            f64::INFINITY,
        )
    }

    /// One small triangle along the longest edge, for triangles that have no extent on the lattice.
    fn stand_in(&self, triangles: &[u32]) -> Shape {
        let edges = triangles.iter().flat_map(|&t| {
            let [a, b, c] = self.mesh.triangles[t as usize];
            [[a, b], [b, c], [c, a]].map(|[a, b]| (t, a, b))
        });
        let length = |&(_, a, b): &(u32, u32, u32)| self.place(a).distance_squared(self.place(b));
        let longest = edges.max_by(|a, b| length(a).total_cmp(&length(b)));
        let mut shape = Shape::default();
        let Some((t, a, b)) = longest else {
            return shape;
        };
        let unit = 1u32 << self.lattice.shift;
        let beside = |p: [u32; 3], axis: usize| {
            let mut q = p;
            // Towards the inside of the lattice, which has more than two units.
            q[axis] = if p[axis] >= unit {
                p[axis] - unit
            } else {
                p[axis] + unit
            };
            q
        };
        let from = self.rounded(a);
        let mut to = self.rounded(b);
        if to == from {
            to = beside(from, 0);
        }
        let thinnest = (0..3)
            .min_by_key(|&axis: &usize| from[axis].abs_diff(to[axis]))
            .unwrap_or(1);
        let (_, normal, colour) = self.vertex(a, t, false);
        shape.triangle([from, to, beside(from, thinnest)].map(|p| (p, normal, colour)));
        shape
    }
}
