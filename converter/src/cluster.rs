//! Small components as clusters: what is too little for charts goes, as it is, into a tree of small meshes.
//!
//! A chart costs a page, glue and at least two triangles in every cut, and a closed component needs a dozen: 3 000 cubes
//! would be 36 000 charts. So [`select`] takes the small components out of the mesh, [`leaf`] puts them on the lattice and
//! packs them along a Hilbert curve into leaves, [`tree`] builds coarser clusters over these, made by [`simplify`], and
//! [`bound`] says how far each is from what it stands for.
//!
//! Every component lies in one leaf as a whole, or below a node of its own (`group`), so that no cut can open a crack in it. Also larger components come here where charts would need many more samples than they
//! have triangles, as CAD models do ([`select::Selection::take_all`]), or are torn to shreds, as photogrammetry can be.

mod became;
pub mod bound;
mod creases;
mod direct;
mod graph;
mod group;
pub mod leaf;
mod local;
pub mod refine;
pub mod select;
pub mod shape;
pub mod simplify;
mod trace;
pub mod tree;
mod trim;

pub use trim::Budget;

use crate::mesh::ManifoldMesh;
use glam::DVec3;
use graph::{Graph, Known};
use leaf::upwards;
use marquetry_evaluation::distance::Indexed;
use marquetry_format::writer::ClusterInput;
use marquetry_format::{ClusterMesh, Lattice};
use std::collections::HashMap;

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

    /// Nodes of a group, about. With images the coarsest texel of a group decides for all of it.
    fn group(self) -> usize {
        match self {
            Self::Plain => 16,
            Self::Textured => 4,
        }
    }

    /// Whether few nodes are halved. Images of a level between would be loaded all the same.
    fn has_halves(self) -> bool {
        self == Self::Plain
    }

    /// Levels of groups, at most. Images of levels that are only passed by are loaded all the same.
    fn levels(self) -> usize {
        match self {
            Self::Plain => 16,
            Self::Textured => 2,
        }
    }

    /// Weight of what normals are changed by, a unit vector, over distances relative to the extent of a group, as it is simplified. Images have
    /// light in them that does not follow.
    fn normals(self) -> f32 {
        match self {
            Self::Plain => 0.15,
            Self::Textured => 0.0,
        }
    }

    /// Most texels of the source's images on a leaf: an image of 256² texels has gaps.
    fn texels(self) -> f32 {
        match self {
            Self::Plain => f32::INFINITY,
            Self::Textured => 30_000.0,
        }
    }
}

/// What a triangle needs of images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Need {
    /// So many texels.
    Texels(f32),
    /// Only this colour, sRGB.
    Colour([u8; 3]),
}

impl Need {
    /// Texels, of which there may be none.
    pub fn texels(self) -> f32 {
        match self {
            Self::Texels(texels) => texels,
            Self::Colour(_) => 0.0,
        }
    }

    /// That of half of the triangle.
    #[must_use]
    pub fn halved(self) -> Self {
        match self {
            Self::Texels(texels) => Self::Texels(texels / 2.0),
            Self::Colour(_) => self,
        }
    }
}

/// A graph of clusters, and what is in it.
#[derive(Debug)]
pub struct Layer {
    /// The root, and everything below it: children after what they replace.
    pub nodes: Vec<ClusterInput>,
    /// Guaranteed bound of the distance, both ways, of all leaves to their components; a length.
    pub max_error: f64,
    /// What is in it.
    pub summary: Summary,
    /// All that was built, with its area.
    graph: Graph,
    /// By node of that whether it is left out.
    is_gone: Vec<bool>,
    area: f64,
    step: f64,
}

/// What is in a graph of clusters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Components of the source.
    pub components: usize,
    /// Their triangles, halves of those that have too many texels for one.
    pub triangles: usize,
    /// Nodes of the graph.
    pub nodes: usize,
    /// Leaves of the graph.
    pub leaves: usize,
}

impl Layer {
    /// Counts what the mesh that the clusters were made of is from the source, a length, as error of every node.
    pub fn add_error(&mut self, distance: f64) {
        if distance > 0.0 {
            self.graph.add_error(distance / self.step);
            self.show(vec![false; self.graph.len()]);
        }
    }

    /// Leaves out what is finer than an RMS error of the leaves asks for, a length, with no distance above `most`, a length. Not for
    /// clusters that have colours or images, which ask for more.
    pub fn trim(&mut self, rms: f64, most: f64) {
        let budget = Budget {
            squares: (rms / self.step).powi(2) * self.area,
            distance: most / self.step,
        };
        self.show(trim::trimmed(&self.graph, budget));
    }

    /// Replaces the bounds of all leaves, sums of what each step did, by what can be guaranteed of `surface`, which is all of them as [`append_finest`] has it,
    /// and `source`, of whose distances few are above `found`, a length. What is above the leaves gains as much.
    pub fn tighten(&mut self, surface: &Indexed<'_>, source: &Indexed<'_>, found: f64) {
        let leaves: Vec<direct::Leaf> = self
            .leaves()
            .map(|leaf| direct::Leaf {
                triangles: leaf.mesh.triangles.len(),
                bound: f64::from(leaf.error) * self.step,
            })
            .collect();
        let bounds = direct::bounds(surface, source, &leaves, found);
        let bounds: Vec<f32> = bounds
            .into_iter()
            .map(|bound| upwards(bound / self.step))
            .collect();
        let mut rest = bounds.as_slice();
        let mut all: Vec<&[f32]> = vec![&[]; self.nodes.len()];
        for (node, own) in self.nodes.iter_mut().zip(&mut all) {
            if node.children.is_empty() {
                (*own, rest) = rest.split_at(node.mesh.triangles.len());
                node.error = own.iter().copied().fold(0.0, f32::max);
            }
        }
        let shown = self.shown();
        let mut known: Vec<Option<Known>> = vec![None; self.graph.len()];
        for (&id, (number, node)) in shown.iter().zip(self.nodes.iter().enumerate()) {
            // What was painted may have leaves below that the graph does not know of, which follow all that it does.
            let mut leaves: Vec<usize> = node.children.iter().map(|&k| k as usize).collect();
            if leaves.is_empty() {
                leaves.push(number);
            } else if leaves.iter().any(|&child| child < shown.len()) {
                continue;
            }
            // All that have the same leaves have one error.
            let errors = leaves.iter().map(|&leaf| self.nodes[leaf].error);
            let error = errors.fold(0.0, f32::max);
            let leaves = leaves
                .iter()
                .map(|&leaf| (&self.nodes[leaf].mesh, all[leaf]));
            let local = by_corners(&self.graph.node(id).mesh, leaves);
            known[id as usize] = Some(Known { error, local });
        }
        self.graph.tighten(&shown, known);
        for (&id, node) in shown.iter().zip(&mut self.nodes) {
            node.error = self.graph.node(id).error;
        }
        self.state_error();
    }

    /// What the first nodes are in the graph, the last of which is the first here.
    fn shown(&self) -> Vec<u32> {
        let ids = (0u32..).zip(&self.is_gone);
        let kept = ids.filter_map(|(id, is_gone)| (!is_gone).then_some(id));
        let mut shown: Vec<u32> = kept.collect();
        shown.reverse();
        shown
    }

    /// Whether something was left out.
    pub fn is_trimmed(&self) -> bool {
        self.nodes.len() < self.graph.len()
    }

    fn show(&mut self, is_gone: Vec<bool>) {
        self.nodes = self.graph.nodes(&is_gone);
        self.is_gone = is_gone;
        self.count();
        self.state_error();
    }

    /// Counts the nodes anew.
    pub fn count(&mut self) {
        self.summary.nodes = self.nodes.len();
        self.summary.leaves = self.leaves().count();
    }

    fn state_error(&mut self) {
        let max_error = self.leaves().map(|leaf| leaf.error).fold(0.0, f32::max);
        self.max_error = f64::from(max_error) * self.step;
    }

    fn leaves(&self) -> impl Iterator<Item = &ClusterInput> {
        self.nodes.iter().filter(|node| node.children.is_empty())
    }
}

/// What is known of the triangles of `mesh`, which are those of other meshes, in another order, of each of which something is known: the largest of those with the same corners.
fn by_corners<'a>(
    mesh: &ClusterMesh,
    others: impl Iterator<Item = (&'a ClusterMesh, &'a [f32])>,
) -> Vec<f32> {
    let corners = |mesh: &ClusterMesh, t: &[u8; 3]| {
        let mut corners = t.map(|corner| mesh.positions[usize::from(corner)]);
        corners.sort_unstable();
        corners
    };
    let (mut known, mut largest) = (HashMap::new(), 0.0_f32);
    for (other, bounds) in others {
        for (t, &bound) in other.triangles.iter().zip(bounds) {
            let own = known.entry(corners(other, t)).or_insert(bound);
            *own = own.max(bound);
            largest = largest.max(bound);
        }
    }
    let of = |t: &[u8; 3]| known.get(&corners(mesh, t)).copied().unwrap_or(largest);
    mesh.triangles.iter().map(of).collect()
}

/// Builds the tree of `components`, lists of triangles of `mesh`, of which there is at least one. `needs` has what each
/// triangle needs of images; it is empty where clusters need no room for textures.
///
/// The same for any number of threads.
pub fn build(
    mesh: &ManifoldMesh,
    components: &[Vec<u32>],
    lattice: &Lattice,
    colours: bool,
    needs: &[Need],
) -> Layer {
    let room = if needs.is_empty() {
        Room::Plain
    } else {
        Room::Textured
    };
    let source = leaf::Source {
        mesh,
        lattice,
        needs,
        room,
        colours,
    };
    let (mut graph, roots) = leaf::nodes(&source, components);
    tree::tree(&mut graph, roots, colours, room);
    let mut layer = Layer {
        nodes: Vec::new(),
        max_error: 0.0,
        summary: Summary {
            components: components.len(),
            triangles: components.iter().map(Vec::len).sum(),
            ..Summary::default()
        },
        area: graph.area(),
        is_gone: vec![false; graph.len()],
        graph,
        step: lattice.step,
    };
    layer.show(layer.is_gone.clone());
    layer
}

/// Appends the triangles of all leaves among `nodes`, in world units.
pub fn append_finest(
    nodes: &[ClusterInput],
    lattice: &Lattice,
    positions: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
) {
    for node in nodes.iter().filter(|node| node.children.is_empty()) {
        let first = u32::try_from(positions.len()).unwrap_or(u32::MAX);
        let world = |&p: &_| lattice.world_from_lattice(p);
        positions.extend(node.mesh.positions.iter().map(world));
        let corners = |t: &[u8; 3]| t.map(|corner| first + u32::from(corner));
        triangles.extend(node.mesh.triangles.iter().map(corners));
    }
}

#[cfg(test)]
mod tests;
