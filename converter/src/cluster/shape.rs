//! A small mesh on the lattice, on its way to being a cluster.

use super::Room;
use super::leaf::divide;
use crate::mesh::adjacency::id;
use crate::texture::cluster::unwrap::is_unwrappable;
use glam::DVec3;
use marquetry_format::cluster::{MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};
use marquetry_format::{ClusterMesh, LatticePoint, octahedral};
use std::collections::HashMap;

/// A vertex: position, octahedral normal, colour (zeros where there are none).
pub type Vertex = ([u32; 3], [u8; 2], [u8; 3]);

/// A mesh of any size.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    /// Vertices, each once.
    pub vertices: Vec<Vertex>,
    /// Corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    numbers: HashMap<Vertex, u32>,
}

impl Shape {
    /// The number of `vertex`, which is added if it is new.
    pub fn vertex(&mut self, vertex: Vertex) -> u32 {
        let next = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        let number = *self.numbers.entry(vertex).or_insert(next);
        if number == next {
            self.vertices.push(vertex);
        }
        number
    }

    /// Adds a triangle, unless two of its corners are one point.
    pub fn triangle(&mut self, corners: [Vertex; 3]) -> bool {
        let [a, b, c] = corners.map(|vertex| vertex.0);
        if a == b || b == c || c == a {
            return false;
        }
        let corners = corners.map(|vertex| self.vertex(vertex));
        self.triangles.push(corners);
        true
    }

    /// Adds a copy of `other`.
    pub fn append(&mut self, other: &Self) {
        let numbers: Vec<u32> = other.vertices.iter().map(|&v| self.vertex(v)).collect();
        let corners = |t: &[u32; 3]| t.map(|v| numbers[v as usize]);
        self.triangles.extend(other.triangles.iter().map(corners));
    }

    /// The same, of a cluster.
    pub fn append_cluster(&mut self, mesh: &ClusterMesh) {
        let vertex = |corner: u8| {
            let at = usize::from(corner);
            let colour = mesh.colours.get(at).copied().unwrap_or_default();
            (mesh.positions[at], mesh.normals[at], colour)
        };
        for t in &mesh.triangles {
            self.triangle(t.map(vertex));
        }
    }

    /// The vertices that `triangles` use, and these.
    #[must_use]
    pub fn part(&self, triangles: &[[u32; 3]]) -> Self {
        let mut part = Self::default();
        for t in triangles {
            part.triangle(t.map(|v| self.vertices[v as usize]));
        }
        part
    }

    /// Parts that fit clusters, of about `most` triangles or fewer each, and the numbers of their triangles.
    pub fn split(&self, most: usize, room: Room) -> (Vec<Self>, Vec<u32>) {
        let mut triangles: Vec<u32> = (0u32..).take(self.triangles.len()).collect();
        let mut parts = Vec::new();
        self.split_into(&mut triangles, most, room, &mut parts);
        (parts, triangles)
    }

    fn split_into(&self, triangles: &mut [u32], most: usize, room: Room, parts: &mut Vec<Self>) {
        if triangles.len() <= MAX_CLUSTER_TRIANGLES || triangles.len() < 2 {
            // In order, whatever divided them.
            triangles.sort_unstable();
            let corners: Vec<[u32; 3]> = triangles
                .iter()
                .map(|&t| self.triangles[t as usize])
                .collect();
            let part = self.part(&corners);
            if triangles.len() < 2 || part.fits(room) {
                parts.push(part);
                return;
            }
        }
        let centre = |&t: &u32| {
            let corners = self.triangles[t as usize].map(|v| point(self.vertices[v as usize].0));
            corners.into_iter().sum::<DVec3>() / 3.0
        };
        let (lower, upper) = divide(triangles, most, centre);
        self.split_into(lower, most, room, parts);
        self.split_into(upper, most, room, parts);
    }

    /// Whether a cluster has room for it, and it is one.
    pub fn fits(&self, room: Room) -> bool {
        !self.triangles.is_empty()
            && self.triangles.len() <= MAX_CLUSTER_TRIANGLES
            && self.vertices.len() <= MAX_CLUSTER_VERTICES
            && (room == Room::Plain || is_unwrappable(&self.positions(), &self.triangles))
    }

    /// Area, lattice units.
    pub fn area(&self) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| point(self.vertices[v as usize].0));
            (b - a).cross(c - a).length() / 2.0
        };
        self.triangles.iter().map(of).sum()
    }

    /// As a cluster; only where it [`fits`](Self::fits).
    pub fn cluster(&self, colours: bool) -> ClusterMesh {
        let index = |v: u32| u8::try_from(v).unwrap_or(u8::MAX);
        ClusterMesh {
            positions: self.vertices.iter().map(|v| v.0).collect(),
            normals: self.vertices.iter().map(|v| v.1).collect(),
            colours: if colours {
                self.vertices.iter().map(|v| v.2).collect()
            } else {
                Vec::new()
            },
            texture: None,
            triangles: self.triangles.iter().map(|t| t.map(index)).collect(),
            ranks: Vec::new(),
        }
    }

    /// Places of vertices, each once, in the order in which they come; and by vertex the number of its place.
    pub fn places(&self) -> (Vec<LatticePoint>, Vec<u32>) {
        let mut numbers: HashMap<LatticePoint, u32> = HashMap::new();
        let mut places = Vec::new();
        let number_of = (self.vertices.iter())
            .map(|vertex| {
                *numbers.entry(vertex.0).or_insert_with(|| {
                    places.push(vertex.0);
                    id(places.len() - 1)
                })
            })
            .collect();
        (places, number_of)
    }

    /// Positions as numbers, lattice units.
    pub fn positions(&self) -> Vec<DVec3> {
        self.vertices.iter().map(|v| point(v.0)).collect()
    }

    /// Normals as vectors of length 1.
    pub fn normals(&self) -> Vec<DVec3> {
        let of = |v: &Vertex| DVec3::from_array(octahedral::decode(v.1).map(f64::from));
        self.vertices.iter().map(of).collect()
    }
}

/// A lattice point as numbers.
pub fn point(p: [u32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
