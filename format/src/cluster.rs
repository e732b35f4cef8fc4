//! The cluster layer: small indexed meshes, each standing for everything below it.
//!
//! What deserves no chart is drawn as clusters: small components of a scan, later the objects of a scene. A group of nodes
//! is replaced, all its members together, by the group's children. In a tree every group has one member; where a surface
//! is in many nodes, members of one group may be children of different groups, so that no border of nodes is kept from
//! level to level. Nodes are numbered level by level, the root first, the children of a group side by side. The groups
//! are told in the front of the file, with the mesh of the root; every other mesh is a page of its own.

pub(crate) mod directory;
pub(crate) mod graph;
pub(crate) mod mesh;
mod model;
pub mod morph;
mod predict;
mod texture;
mod twins;
mod walk;

pub use texture::{ClusterTexture, MAX_TEXTURE_TEXELS, TEXTURE_STEP};

use crate::{Bounds, LatticePoint};
use std::ops::Range;

/// Most vertices of a cluster, so that an index is a byte.
pub const MAX_CLUSTER_VERTICES: usize = 256;
/// Most triangles of a cluster.
pub const MAX_CLUSTER_TRIANGLES: usize = 256;
/// Most children of a group.
pub const MAX_CLUSTER_CHILDREN: usize = 65_535;
/// Most levels of clusters, the root's included.
pub const MAX_CLUSTER_LEVELS: u8 = 32;

/// Number of a node of the cluster layer; 0 is the root.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClusterId(pub u32);

/// Number of a group of clusters, in the order of their first members.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClusterGroupId(pub u32);

/// The triangles of one cluster.
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
    /// What each vertex becomes as the group that this is a child of is replaced by its members: a rank among their places
    /// ([`morph`]). As many as positions; empty where nothing is known.
    pub ranks: Vec<u8>,
}

/// What the front of the file says of one cluster.
#[derive(Debug, Clone, PartialEq)]
pub struct ClusterNode {
    /// The first member of the group that this is a child of; `None` for the root.
    pub parent: Option<ClusterId>,
    /// The group that this is a member of; `None` for a leaf.
    pub group: Option<ClusterGroupId>,
    /// Numbers of that group's children; empty for a leaf.
    pub children: Range<u32>,
    /// 0 for the root, else 1 more than the greatest of the members of the group that this is a child of; below
    /// [`MAX_CLUSTER_LEVELS`].
    pub level: u8,
    /// Vertices, 3..=256.
    pub vertices: u16,
    /// Triangles, 1..=256.
    pub triangles: u16,
    /// Upper bound of the distance, both ways, between what the mesh shows and its source, lattice units: the same for all
    /// members of a group, never less than for its children.
    pub error: f32,
    /// Length of a texel of its texture, lattice units; `None` without one.
    pub texel: Option<f32>,
    /// Holds the mesh and the bounds of all children.
    pub bounds: Bounds,
    /// Where the mesh lies in the file.
    pub range: Range<u64>,
    /// Lower half of the checksum of these bytes.
    pub(crate) checksum: u32,
}

/// Clusters that are replaced together, by the same children.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClusterGroup {
    /// In ascending order, at least one. Together they show what the children show.
    pub members: Vec<ClusterId>,
    /// Numbers of the children, 2 to 65 535, all above the members'.
    pub children: Range<u32>,
    /// Whether something below is nearer to the source than the members. It is not where the children are the same again: leaves of as many triangles,
    /// of which one has the members' error. Nothing is gained by them but finer images.
    pub is_nearer: bool,
}

/// The clusters of a file, and the mesh of their root.
#[derive(Debug, Clone, PartialEq)]
pub struct Clusters {
    /// By [`ClusterId`]; never empty.
    pub nodes: Vec<ClusterNode>,
    /// By [`ClusterGroupId`]; every node that is no leaf is a member of one, every node but the root a child of one.
    pub groups: Vec<ClusterGroup>,
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

    /// The group numbered `id`.
    pub fn group(&self, id: ClusterGroupId) -> Option<&ClusterGroup> {
        self.groups.get(usize::try_from(id.0).ok()?)
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
