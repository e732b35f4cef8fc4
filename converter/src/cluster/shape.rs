//! A small mesh on the lattice, on its way to being a cluster.

use super::Room;
use crate::texture::cluster::unwrap::is_unwrappable;
use glam::DVec3;
use marquetry_format::ClusterMesh;
use marquetry_format::cluster::{MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};
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

    /// Whether a cluster has room for it, and it is one.
    pub fn fits(&self, room: Room) -> bool {
        !self.triangles.is_empty()
            && self.triangles.len() <= MAX_CLUSTER_TRIANGLES
            && self.vertices.len() <= MAX_CLUSTER_VERTICES
            && (room == Room::Plain || is_unwrappable(&self.positions(), &self.triangles))
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
        }
    }

    /// Positions as numbers, lattice units.
    pub fn positions(&self) -> Vec<DVec3> {
        self.vertices.iter().map(|v| point(v.0)).collect()
    }
}

/// A lattice point as numbers.
pub fn point(p: [u32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
