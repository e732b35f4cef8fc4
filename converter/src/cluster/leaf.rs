//! Components on the lattice, packed into leaves.
//!
//! A component's triangles stay as they are, with their corners rounded to the lattice; those that lose their extent are
//! left out, and what that moves is in the leaf's error. Normals are those of the mesh, but for creases (`creases`), where each face sees only
//! those of about its own direction, so that a cube is not lit like a ball.
//! Components follow each other along a Hilbert curve, and fill one leaf after the other. One that does not fit a leaf is halved
//! until its parts do, which `group` puts together again.

use super::bound::{Target, hausdorff};
use super::creases::{self, Creases};
use super::graph::Graph;
use super::group;
use super::shape::{Shape, Vertex, point};
use super::{Need, Room};
use crate::atlas::chart_graph::hilbert_key;
use crate::atlas::quantize::lattice_from_world;
use crate::mesh::ManifoldMesh;
use glam::DVec3;
use marquetry_format::cluster::{
    MAX_CLUSTER_CHILDREN, MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES,
};
use marquetry_format::lattice::LATTICE_BITS;
use marquetry_format::{Lattice, octahedral};
use rayon::prelude::*;

/// Most triangles of a component: even if no two nodes become one, there are as few as a node has children.
pub const MOST_TRIANGLES: usize = MAX_CLUSTER_CHILDREN * MAX_CLUSTER_TRIANGLES / 2;

/// A part of a component on the lattice.
pub(super) struct Piece {
    pub(super) shape: Shape,
    /// Bound of its distance to the component, lattice units.
    pub(super) error: f64,
    /// Texels of the source's images on it.
    texels: f32,
}

/// What components are made clusters of.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The triangles.
    pub mesh: &'a ManifoldMesh,
    /// Where they are put.
    pub lattice: &'a Lattice,
    /// What triangles need of images; empty without images.
    pub needs: &'a [Need],
    /// What nodes have room for.
    pub room: Room,
    /// Whether vertices have colours.
    pub colours: bool,
}

/// A component on the lattice.
enum Placed {
    /// It fits a leaf.
    Piece(Piece),
    /// It does not; the last node stands for it.
    Graph(Graph),
}

/// Adds nodes that hold `components` of at most [`MOST_TRIANGLES`] to an empty graph; those that stand for them, in the order of a
/// space-filling curve.
pub(super) fn nodes(source: &Source<'_>, components: &[Vec<u32>]) -> (Graph, Vec<u32>) {
    let Source { room, colours, .. } = *source;
    let is_angular = creases::is_angular(source.mesh, &components.concat());
    let mut found: Vec<(u64, Placed)> = components
        .par_iter()
        .map(|component| {
            let component = Component::new(source, component, is_angular);
            (component.key(), component.placed())
        })
        .collect();
    found.sort_by_key(|&(key, _)| key);
    let (mut graph, mut roots) = (Graph::default(), Vec::new());
    let (mut shape, mut error, mut texels) = (Shape::default(), 0.0f64, 0.0f32);
    for (_, placed) in found {
        let piece = match placed {
            Placed::Piece(piece) => piece,
            Placed::Graph(component) => {
                roots.push(graph.append(component));
                continue;
            }
        };
        let triangles = shape.triangles.len() + piece.shape.triangles.len();
        let vertices = shape.vertices.len() + piece.shape.vertices.len();
        let is_full = triangles > MAX_CLUSTER_TRIANGLES
            || vertices > MAX_CLUSTER_VERTICES
            || texels + piece.texels > room.texels()
            || (piece.texels > 0.0) != (texels > 0.0)
            || !fits_together(&shape, &piece.shape, room);
        if is_full && !shape.triangles.is_empty() {
            roots.push(graph.leaf(&std::mem::take(&mut shape), error, colours));
            (error, texels) = (0.0, 0.0);
        }
        texels += piece.texels;
        shape.append(&piece.shape);
        error = error.max(piece.error);
    }
    if !shape.triangles.is_empty() {
        roots.push(graph.leaf(&shape, error, colours));
    }
    (graph, roots)
}

/// Whether a leaf has room for both; where it is plain their numbers say.
fn fits_together(shape: &Shape, other: &Shape, room: Room) -> bool {
    room == Room::Plain || {
        let mut both = shape.clone();
        both.append(other);
        both.fits(room)
    }
}

/// Divides `items`, of which there are at least two, across the longest extent of their centres into two parts, so that as few parts of
/// at most `most` as can be come of each.
pub(super) fn divide<T: Copy + Ord>(
    items: &mut [T],
    most: usize,
    centre: impl Fn(&T) -> DVec3,
) -> (&mut [T], &mut [T]) {
    let (low, high) = items
        .iter()
        .map(&centre)
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
    let axis = (high - low).max_position();
    let parts = items.len().div_ceil(most).max(2);
    let first = items.len() * (parts / 2) / parts;
    items.select_nth_unstable_by(first, |a, b| {
        centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(b))
    });
    items.split_at_mut(first)
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
    source: &'a Source<'a>,
    mesh: &'a ManifoldMesh,
    triangles: &'a [u32],
    lattice: &'a Lattice,
    /// Every vertex with every face at it, ascending.
    faces: Vec<[u32; 2]>,
    /// Number of vertices.
    vertices: usize,
    creases: Creases,
}

impl<'a> Component<'a> {
    fn new(source: &'a Source<'a>, triangles: &'a [u32], is_angular: bool) -> Self {
        let Source { mesh, lattice, .. } = *source;
        let corners = |&t: &u32| mesh.triangles[t as usize].map(|v| [v, t]);
        let mut faces: Vec<[u32; 2]> = triangles.iter().flat_map(corners).collect();
        faces.sort_unstable();
        let around = || faces.chunk_by(|a, b| a[0] == b[0]);
        Self {
            source,
            mesh,
            triangles,
            lattice,
            vertices: around().count(),
            creases: if is_angular {
                Creases::of(mesh, around())
            } else {
                Creases::default()
            },
            faces,
        }
    }

    /// Faces at a vertex.
    fn around(&self, v: u32) -> impl Iterator<Item = u32> + Clone {
        let first = self.faces.partition_point(|face| face[0] < v);
        let faces = self.faces[first..].iter();
        faces
            .take_while(move |face| face[0] == v)
            .map(|face| face[1])
    }

    /// Texels of the source's images on some triangles.
    fn texels(&self, triangles: &[u32]) -> f32 {
        let texels = triangles.iter().filter_map(|&t| self.need(t));
        texels.map(Need::texels).sum()
    }

    fn need(&self, triangle: u32) -> Option<Need> {
        self.source.needs.get(triangle as usize).copied()
    }

    /// The colour that is all that a triangle needs of an image.
    fn colour(&self, triangle: u32) -> Option<[u8; 3]> {
        match self.need(triangle)? {
            Need::Colour(colour) => Some(colour),
            Need::Texels(_) => None,
        }
    }

    /// What nodes of nothing but these triangles have room for: no image where all are of one colour each.
    fn room(&self, triangles: &[u32]) -> Room {
        if triangles.iter().all(|&t| self.colour(t).is_some()) {
            Room::Plain
        } else {
            self.source.room
        }
    }

    fn placed(&self) -> Placed {
        let Source { room, colours, .. } = *self.source;
        // One leaf without creases is better than two with them.
        if self.triangles.len() <= MAX_CLUSTER_TRIANGLES && self.vertices <= MAX_CLUSTER_VERTICES {
            let own = self.room(self.triangles);
            let is_mixed =
                own != Room::Plain && self.triangles.iter().any(|&t| self.colour(t).is_some());
            let piece = |creased| {
                let piece = self.piece(self.triangles, creased);
                let fits = piece.shape.fits(own) && piece.texels <= room.texels();
                (fits && !is_mixed).then_some(piece)
            };
            if let Some(piece) = piece(true).or_else(|| piece(false)) {
                return Placed::Piece(piece);
            }
        }
        let (mut plain, mut textured): (Vec<u32>, Vec<u32>) = self
            .triangles
            .iter()
            .partition(|&&t| self.colour(t).is_some());
        let mut pieces = Vec::new();
        for triangles in [&mut textured, &mut plain] {
            if !triangles.is_empty() {
                pieces.extend(self.pieces(triangles));
            }
        }
        let unit = 1 << self.source.lattice.shift;
        let share = self.triangles.len() as f64 / self.source.mesh.triangles.len() as f64;
        Placed::Graph(group::graph(pieces, share, unit, colours, room))
    }

    /// Divides `triangles`, all or none of which are of one colour each, across their longest extent until the parts fit clusters.
    fn pieces(&self, triangles: &mut [u32]) -> Vec<Piece> {
        let room = self.room(triangles);
        // An image has the light of creases in it, and they would double the vertices of rough scans.
        let creased = self.source.needs.is_empty();
        let is_whole = triangles.len() < 2;
        let is_small =
            triangles.len() <= MAX_CLUSTER_TRIANGLES && self.texels(triangles) <= room.texels();
        if is_whole || is_small {
            let piece = self.piece(triangles, creased);
            if is_whole || piece.shape.fits(room) {
                return vec![piece];
            }
        }
        let centre = |&t: &u32| self.corners(t).into_iter().sum::<DVec3>() / 3.0;
        let (lower, upper) = divide(triangles, MAX_CLUSTER_TRIANGLES, centre);
        let (mut pieces, upper) = rayon::join(|| self.pieces(lower), || self.pieces(upper));
        pieces.extend(upper);
        pieces
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
        Piece {
            shape,
            error,
            texels: self.texels(triangles),
        }
    }

    /// Place along the curve.
    fn key(&self) -> u64 {
        let vertices = self.vertices.max(1) as f64;
        let places = self.faces.chunk_by(|a, b| a[0] == b[0]);
        let centre = places.map(|faces| self.place(faces[0][0])).sum::<DVec3>() / vertices;
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
        let normal = if creased {
            self.creases.normal(self.mesh, [v, t], self.around(v))
        } else {
            self.mesh.normals[v as usize]
        };
        let colour = self
            .colour(t)
            .or_else(|| self.mesh.colours.get(v as usize).copied());
        (
            self.rounded(v),
            octahedral::encode(normal.as_vec3().to_array()),
            colour.unwrap_or_default(),
        )
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
