//! Small components as clusters: what is too little for charts goes, as it is, into a tree of small meshes.
//!
//! A chart costs a page, glue and at least two triangles in every cut, and a closed component needs a dozen: 3 000 cubes
//! would be 36 000 charts. So [`select`] takes the small components out of the mesh, [`leaf`] puts them on the lattice and
//! packs them along a Hilbert curve into leaves, [`tree`] builds coarser clusters over these, made by [`simplify`], and
//! [`bound`] says how far each is from what it stands for.
//!
//! Every component lies in one leaf as a whole, or below a node of its own (`patchwork`), so that no cut through the tree can
//! open a crack in it. Also larger components come here where charts would need many more samples than they
//! have triangles, as CAD models do ([`select::Selection::take_all`]), or are torn to shreds, as photogrammetry can be.

pub mod bound;
pub mod leaf;
mod patchwork;
pub mod refine;
pub mod select;
pub mod shape;
pub mod simplify;
pub mod tree;

use crate::mesh::ManifoldMesh;
use glam::DVec3;
use marquetry_format::ClusterMesh;
use marquetry_format::Lattice;

/// What a node has room for beside its triangles and vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Room {
    /// Nothing.
    Plain,
    /// An image of its own, which has to show the triangles without cutting them into too many patches.
    Textured,
}

impl Room {
    /// Most texels of a triangle.
    pub const MOST_TEXELS: f32 = 8_000.0;

    /// Most texels of the source's images on a leaf: an image of 256² texels has gaps.
    fn texels(self) -> f32 {
        match self {
            Self::Plain => f32::INFINITY,
            Self::Textured => 30_000.0,
        }
    }
}

/// One node of the tree of clusters.
#[derive(Debug, Clone, Default)]
pub struct ClusterInput {
    /// Its triangles.
    pub mesh: ClusterMesh,
    /// Bound of the distance to the source, lattice units; never above the parent's.
    pub error: f32,
    /// Length of a texel of its texture, lattice units.
    pub texel: Option<f32>,
    /// None, or 2 to 65 535.
    pub children: Vec<ClusterInput>,
}

impl ClusterInput {
    /// The nodes of the tree, level by level, as the format's writer takes them.
    pub fn into_levels(self) -> Vec<marquetry_format::writer::ClusterInput> {
        let mut waiting = std::collections::VecDeque::from([self]);
        let (mut nodes, mut next) = (Vec::new(), 1);
        while let Some(node) = waiting.pop_front() {
            let end = next + u32::try_from(node.children.len()).unwrap_or(u32::MAX);
            nodes.push(marquetry_format::writer::ClusterInput {
                mesh: node.mesh,
                error: node.error,
                texel: node.texel,
                children: (next..end).collect(),
            });
            waiting.extend(node.children);
            next = end;
        }
        nodes
    }
}

/// A tree of clusters, and what is in it.
#[derive(Debug)]
pub struct Layer {
    /// The root.
    pub root: ClusterInput,
    /// Guaranteed bound of the distance, both ways, of all leaves to their components; a length.
    pub max_error: f64,
    /// What is in it.
    pub summary: Summary,
}

/// What is in a tree of clusters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Components of the source.
    pub components: usize,
    /// Their triangles, halves of those that have too many texels for one.
    pub triangles: usize,
    /// Nodes of the tree.
    pub nodes: usize,
    /// Leaves of the tree.
    pub leaves: usize,
}

impl Layer {
    /// Counts what the mesh that the clusters were made of is from the source, a length, as error of every node.
    pub fn add_error(&mut self, distance: f64, lattice: &Lattice) {
        if distance <= 0.0 {
            return;
        }
        self.max_error += distance;
        let mut stack = vec![&mut self.root];
        while let Some(node) = stack.pop() {
            node.error = leaf::upwards(f64::from(node.error) + distance / lattice.step);
            stack.extend(&mut node.children);
        }
    }
}

/// Builds the tree of `components`, lists of triangles of `mesh`, of which there is at least one. `texels` has those of the source's
/// images by triangle; it is empty where clusters need no room for textures.
///
/// The same for any number of threads.
pub fn build(
    mesh: &ManifoldMesh,
    components: &[Vec<u32>],
    lattice: &Lattice,
    colours: bool,
    texels: &[f32],
) -> Layer {
    let room = if texels.is_empty() {
        Room::Plain
    } else {
        Room::Textured
    };
    let source = leaf::Source {
        mesh,
        lattice,
        texels,
        room,
        colours,
    };
    let nodes = leaf::nodes(&source, components);
    let mut summary = Summary {
        components: components.len(),
        triangles: components.iter().map(Vec::len).sum(),
        nodes: 0,
        leaves: 0,
    };
    let root = tree::tree(nodes, room);
    let mut max_error = 0.0f64;
    let mut stack = vec![&root];
    while let Some(node) = stack.pop() {
        summary.nodes += 1;
        if node.children.is_empty() {
            summary.leaves += 1;
            max_error = max_error.max(f64::from(node.error));
        }
        stack.extend(&node.children);
    }
    Layer {
        root,
        max_error: max_error * lattice.step,
        summary,
    }
}

/// Appends the triangles of all leaves below `root`, in world units.
pub fn append_finest(
    root: &ClusterInput,
    lattice: &Lattice,
    positions: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
) {
    let mut stack = vec![root];
    while let Some(node) = stack.pop() {
        if !node.children.is_empty() {
            stack.extend(&node.children);
            continue;
        }
        let first = u32::try_from(positions.len()).unwrap_or(u32::MAX);
        let world = |&p: &_| lattice.world_from_lattice(p);
        positions.extend(node.mesh.positions.iter().map(world));
        let corners = |t: &[u8; 3]| t.map(|corner| first + u32::from(corner));
        triangles.extend(node.mesh.triangles.iter().map(corners));
    }
}

#[cfg(test)]
mod tests;
