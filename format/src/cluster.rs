//! The cluster layer: a tree of small indexed meshes, each standing for everything below it.
//!
//! What deserves no chart is drawn as clusters: small components of a scan, later the objects of a scene. The nodes are
//! numbered level by level, the root first, so the children of a node lie side by side. What the tree looks like is in
//! the front of the file, with the mesh of the root; every other mesh is a page of its own.

pub(crate) mod directory;
pub(crate) mod mesh;
mod predict;
mod texture;
mod walk;

pub use texture::{ClusterTexture, MAX_TEXTURE_TEXELS, TEXTURE_STEP};

use crate::{Bounds, LatticePoint};
use std::ops::Range;

/// Most vertices of a cluster, so that an index is a byte.
pub const MAX_CLUSTER_VERTICES: usize = 256;
/// Most triangles of a cluster.
pub const MAX_CLUSTER_TRIANGLES: usize = 256;
/// Most children of a node.
pub const MAX_CLUSTER_CHILDREN: usize = 65_535;
/// Most levels of a tree of clusters, the root's included.
pub const MAX_CLUSTER_LEVELS: u8 = 32;

/// Number of a node of the cluster tree; 0 is the root.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClusterId(pub u32);

/// The triangles of one node of the cluster tree.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClusterMesh {
    /// Positions on the lattice, multiples of 2^shift.
    pub positions: Vec<LatticePoint>,
    /// Octahedral normals, as many as positions.
    pub normals: Vec<[u8; 2]>,
    /// sRGB colours, as many as positions; empty when the file has none.
    pub colours: Vec<[u8; 3]>,
    /// Corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u8; 3]>,
    /// The image on the triangles, which then takes the place of the colours.
    pub texture: Option<ClusterTexture>,
}

/// What the front of the file says of one node of the cluster tree.
#[derive(Debug, Clone, PartialEq)]
pub struct ClusterNode {
    /// The node that this is a child of; `None` for the root.
    pub parent: Option<ClusterId>,
    /// Numbers of the children; empty for a leaf.
    pub children: Range<u32>,
    /// Distance from the root.
    pub level: u8,
    /// Vertices, 3..=256.
    pub vertices: u16,
    /// Triangles, 1..=256.
    pub triangles: u16,
    /// Upper bound of the distance, both ways, between the mesh and the source of all leaves below it, lattice units.
    pub error: f32,
    /// Length of a texel of its texture, lattice units; `None` without one.
    pub texel: Option<f32>,
    /// Holds the mesh and the bounds of the children.
    pub bounds: Bounds,
    /// Where the mesh lies in the file.
    pub range: Range<u64>,
    /// Lower half of the checksum of these bytes.
    pub(crate) checksum: u32,
}

/// The cluster tree of a file and the mesh of its root.
#[derive(Debug, Clone, PartialEq)]
pub struct Clusters {
    /// By [`ClusterId`]; never empty.
    pub nodes: Vec<ClusterNode>,
    /// The mesh of the root.
    pub root: ClusterMesh,
    /// Bytes of all meshes: geometry, normals, colours and textures.
    pub(crate) part_bytes: [u64; 3],
}

impl Clusters {
    /// The node numbered `id`.
    pub fn node(&self, id: ClusterId) -> Option<&ClusterNode> {
        self.nodes.get(usize::try_from(id.0).ok()?)
    }

    /// Number of nodes.
    pub fn count(&self) -> u32 {
        u32::try_from(self.nodes.len()).unwrap_or(u32::MAX)
    }

    /// Triangles of all leaves: everything that was put into clusters.
    pub fn leaf_triangles(&self) -> u64 {
        self.nodes
            .iter()
            .filter(|node| node.children.is_empty())
            .fold(0, |sum, node| sum.saturating_add(u64::from(node.triangles)))
    }
}
