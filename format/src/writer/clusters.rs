//! The cluster layer of a file to be written: checked, in order, coded.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "sizes are checked against the limits before they are used"
)]

use super::{ClusterInput, coded};
use crate::cluster::directory::{self, Facts, texel_code};
use crate::cluster::mesh::{encode, in_order};
use crate::cluster::{
    ClusterMesh, MAX_CLUSTER_CHILDREN, MAX_CLUSTER_LEVELS, MAX_CLUSTER_TRIANGLES,
    MAX_CLUSTER_VERTICES,
};
use crate::codec::page::Coding;
use crate::header::checksum;
use crate::index::quantize::BoundsCode;
use crate::lattice::{Bounds, LATTICE_BITS};
use crate::parallel::map_ordered;
use crate::{Error, Limits};

/// Both cluster sections, but for the checksums, which depend on the content id.
pub(super) struct ClusterLayer {
    /// The section of the tree, before and after the checksums.
    pub(super) tree: [Vec<u8>; 2],
    /// By node.
    meshes: Vec<Vec<u8>>,
    pub(super) part_bytes: [u64; 3],
}

fn refuse<T>(rule: &'static str, detail: String) -> Result<T, Error> {
    Err(Error::Input { rule, detail })
}

impl ClusterLayer {
    /// Checks and codes the tree below `root`.
    pub(super) fn new(root: &ClusterInput, coding: Coding) -> Result<Self, Error> {
        let nodes = in_levels(root)?;
        let bounds = bounds_of(&nodes);
        let coded_meshes = map_ordered(&nodes, |node| -> Result<_, Error> {
            let mesh = checked(node.input, coding)?;
            let (bytes, parts) = encode(coding, &mesh)?;
            Ok((mesh.positions.len(), bytes, parts))
        });
        let (mut facts, mut meshes, mut part_bytes) = (Vec::new(), Vec::new(), [0; 3]);
        for (index, coded_mesh) in coded_meshes.into_iter().enumerate() {
            let (vertices, bytes, parts) = coded_mesh?;
            let Node { input, parent } = nodes[index];
            let error = coded(input.error)?;
            if let Some(parent) = parent.map(|parent| nodes[parent].input)
                && input.error > parent.error
            {
                return refuse(
                    "errors never grow on the way down",
                    format!("cluster {index}: {} below {}", input.error, parent.error),
                );
            }
            for (sum, part) in
                part_bytes
                    .iter_mut()
                    .zip([parts.geometry, parts.normals, parts.colours])
            {
                *sum += part;
            }
            facts.push(Facts {
                children: input.children.len() as u16,
                length: if index == 0 { 0 } else { bytes.len() as u32 },
                vertices: (vertices - 1) as u8,
                triangles: (input.mesh.triangles.len() - 1) as u8,
                error,
                bounds: BoundsCode::new(&bounds[index]),
                texel: input.texel.map_or(0, texel_code),
            });
            meshes.push(bytes);
        }
        let tree = directory::encode(&facts, &meshes[0], part_bytes)?;
        Ok(Self {
            tree,
            meshes,
            part_bytes,
        })
    }

    /// Length of the section of the tree.
    pub(super) fn tree_bytes(&self) -> u64 {
        (self.tree[0].len() + 4 * self.meshes.len() + self.tree[1].len()) as u64
    }

    /// Bytes of the mesh of the root.
    pub(super) fn root_bytes(&self) -> u64 {
        self.meshes[0].len() as u64
    }

    /// The meshes below the root.
    pub(super) fn pages(&self) -> impl Iterator<Item = &[u8]> {
        self.meshes[1..].iter().map(Vec::as_slice)
    }

    /// The section of the tree.
    pub(super) fn tree_section(&self, content_id: &[u8; 16]) -> Vec<u8> {
        let checksums = self
            .meshes
            .iter()
            .flat_map(|mesh| (checksum(content_id, mesh) as u32).to_le_bytes());
        let [head, rest] = &self.tree;
        head.iter()
            .copied()
            .chain(checksums)
            .chain(rest.iter().copied())
            .collect()
    }
}

#[derive(Clone, Copy)]
struct Node<'a> {
    input: &'a ClusterInput,
    parent: Option<usize>,
}

fn in_levels(root: &ClusterInput) -> Result<Vec<Node<'_>>, Error> {
    let limit = Limits::default().clusters as usize;
    let mut nodes = vec![Node {
        input: root,
        parent: None,
    }];
    let (mut next, mut level_end, mut level) = (0, 1, 0);
    while next < nodes.len() {
        if next == level_end {
            level += 1;
            level_end = nodes.len();
        }
        let children = &nodes[next].input.children;
        if children.len() == 1 || children.len() > MAX_CLUSTER_CHILDREN {
            return refuse(
                "a cluster has no child or 2 to 65 535",
                format!("cluster {next} has {}", children.len()),
            );
        }
        nodes.extend(children.iter().map(|input| Node {
            input,
            parent: Some(next),
        }));
        if nodes.len() > limit || level >= usize::from(MAX_CLUSTER_LEVELS) {
            return refuse(
                "the tree of clusters is not too large",
                format!("{} clusters in {level} levels", nodes.len()),
            );
        }
        next += 1;
    }
    Ok(nodes)
}

/// The mesh in the order in which it is coded.
fn checked(input: &ClusterInput, coding: Coding) -> Result<ClusterMesh, Error> {
    let mesh = &input.mesh;
    let count = mesh.positions.len();
    let colours = if coding.has_colours { count } else { 0 };
    let sizes = [mesh.normals.len(), mesh.colours.len()];
    if mesh.triangles.is_empty()
        || mesh.triangles.len() > MAX_CLUSTER_TRIANGLES
        || count > MAX_CLUSTER_VERTICES
        || sizes != [count, colours]
    {
        return refuse(
            "a cluster has 1 to 256 triangles and at most 256 vertices, each with a normal and its colour",
            format!(
                "{} triangles, {count} vertices, {sizes:?}",
                mesh.triangles.len()
            ),
        );
    }
    if input.texel.is_some() != mesh.texture.is_some()
        || input.texel.is_some_and(|t| t.is_nan() || t <= 0.0)
    {
        return refuse(
            "a textured cluster has texels of some length",
            format!("{:?}", input.texel),
        );
    }
    if let Some(texture) = &mesh.texture {
        if texture.places.len() != count {
            return refuse(
                "every vertex of a textured cluster has a place",
                format!("{count} vertices, {} places", texture.places.len()),
            );
        }
        texture.check()?;
    }
    let mask = (1u32 << coding.shift) - 1;
    let outside = |p: &&[u32; 3]| p.iter().any(|&c| c >> LATTICE_BITS != 0 || c & mask != 0);
    if let Some(point) = mesh.positions.iter().find(outside) {
        return refuse(
            "positions are multiples of 2^shift below 2^21",
            format!("{point:?} at shift {}", coding.shift),
        );
    }
    let flat = |t: &&[u8; 3]| t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    if let Some(triangle) = mesh.triangles.iter().find(flat) {
        return refuse(
            "a triangle has three different vertices",
            format!("{triangle:?}"),
        );
    }
    match in_order(mesh) {
        Some(ordered) => Ok(ordered),
        None => refuse(
            "a triangle names vertices of its cluster",
            format!("{count} vertices"),
        ),
    }
}

fn bounds_of(nodes: &[Node<'_>]) -> Vec<Bounds> {
    let mut bounds = map_ordered(nodes, |node| {
        let mut bounds = Bounds {
            min: [u32::MAX; 3],
            max: [0; 3],
        };
        let mesh = &node.input.mesh;
        let corners = mesh.triangles.iter().flatten();
        for point in corners.filter_map(|&corner| mesh.positions.get(usize::from(corner))) {
            for ((min, max), &c) in bounds.min.iter_mut().zip(&mut bounds.max).zip(point) {
                *min = c.min(*min);
                *max = c.max(*max);
            }
        }
        bounds
    });
    for index in (1..nodes.len()).rev() {
        if let Some(parent) = nodes[index].parent {
            let Bounds { min, max } = bounds[index];
            for axis in 0..3 {
                bounds[parent].min[axis] = bounds[parent].min[axis].min(min[axis]);
                bounds[parent].max[axis] = bounds[parent].max[axis].max(max[axis]);
            }
        }
    }
    bounds
}
