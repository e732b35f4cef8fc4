//! The cluster layer of a file to be written: checked, in order, coded.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "sizes are checked against the limits before they are used"
)]

mod order;

use super::{ClusterInput, coded};
use crate::Error;
use crate::cluster::directory::{self, Facts, texel_code};
use crate::cluster::mesh::{encode, in_order};
use crate::cluster::{ClusterMesh, MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};
use crate::codec::page::Coding;
use crate::header::checksum;
use crate::index::quantize::BoundsCode;
use crate::lattice::{Bounds, LATTICE_BITS};
use crate::parallel::map_ordered;
use order::Order;

/// Both cluster sections, but for the checksums, which depend on the content id.
pub(super) struct ClusterLayer {
    /// The section of the facts, before and after the checksums.
    pub(super) graph: [Vec<u8>; 2],
    /// By node.
    meshes: Vec<Vec<u8>>,
    pub(super) part_bytes: [u64; 3],
}

fn refuse<T>(rule: &'static str, detail: String) -> Result<T, Error> {
    Err(Error::Input { rule, detail })
}

impl ClusterLayer {
    /// Checks and codes `clusters`, of which there is at least one.
    pub(super) fn new(clusters: &[ClusterInput], coding: Coding) -> Result<Self, Error> {
        let order = Order::new(clusters)?;
        let inputs: Vec<&ClusterInput> = order.places.iter().map(|&at| &clusters[at]).collect();
        let bounds = bounds_of(&inputs, &order);
        let links = order.links();
        let coded_meshes = map_ordered(&inputs, |input| -> Result<_, Error> {
            let mesh = checked(input, coding)?;
            let (bytes, parts) = encode(coding, &mesh)?;
            Ok((mesh.positions.len(), bytes, parts))
        });
        let (mut facts, mut meshes, mut part_bytes) = (Vec::new(), Vec::new(), [0; 3]);
        for (index, coded_mesh) in coded_meshes.into_iter().enumerate() {
            let (vertices, bytes, parts) = coded_mesh?;
            let input = inputs[index];
            for (sum, part) in
                part_bytes
                    .iter_mut()
                    .zip([parts.geometry, parts.normals, parts.colours])
            {
                *sum += part;
            }
            facts.push(Facts {
                children: links[index].children,
                back: links[index].back,
                length: if index == 0 { 0 } else { bytes.len() as u32 },
                vertices: (vertices - 1) as u8,
                triangles: (input.mesh.triangles.len() - 1) as u8,
                error: coded(input.error)?,
                bounds: BoundsCode::new(&bounds[index]),
                texel: input.texel.map_or(0, texel_code),
            });
            meshes.push(bytes);
        }
        let graph = directory::encode(&facts, &meshes[0], part_bytes)?;
        Ok(Self {
            graph,
            meshes,
            part_bytes,
        })
    }

    /// Length of the section of the facts.
    pub(super) fn graph_bytes(&self) -> u64 {
        (self.graph[0].len() + 4 * self.meshes.len() + self.graph[1].len()) as u64
    }

    /// Bytes of the mesh of the root.
    pub(super) fn root_bytes(&self) -> u64 {
        self.meshes[0].len() as u64
    }

    /// The meshes below the root.
    pub(super) fn pages(&self) -> impl Iterator<Item = &[u8]> {
        self.meshes[1..].iter().map(Vec::as_slice)
    }

    /// The section of the facts.
    pub(super) fn graph_section(&self, content_id: &[u8; 16]) -> Vec<u8> {
        let checksums = self
            .meshes
            .iter()
            .flat_map(|mesh| (checksum(content_id, mesh) as u32).to_le_bytes());
        let [head, rest] = &self.graph;
        head.iter()
            .copied()
            .chain(checksums)
            .chain(rest.iter().copied())
            .collect()
    }
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
        || !(mesh.ranks.is_empty() || mesh.ranks.len() == count)
    {
        return refuse(
            "a cluster has 1 to 256 triangles and at most 256 vertices, each with a normal, its colour and its rank",
            format!(
                "{} triangles, {count} vertices, {sizes:?}, {} ranks",
                mesh.triangles.len(),
                mesh.ranks.len()
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

/// By place in the file: what holds the node's vertices and all its children's bounds.
fn bounds_of(inputs: &[&ClusterInput], order: &Order) -> Vec<Bounds> {
    let nothing = Bounds {
        min: [u32::MAX; 3],
        max: [0; 3],
    };
    let mut bounds = map_ordered(inputs, |input| {
        let mesh = &input.mesh;
        let corners = mesh.triangles.iter().flatten();
        corners
            .filter_map(|&corner| mesh.positions.get(usize::from(corner)))
            .fold(nothing, |sum, &point| {
                union(
                    sum,
                    Bounds {
                        min: point,
                        max: point,
                    },
                )
            })
    });
    // Children come after all members, in files as in the order of groups by their last members.
    for group in order.groups.iter().rev() {
        let below = bounds[group.children.clone()]
            .iter()
            .fold(nothing, |sum, &child| union(sum, child));
        for &member in &group.members {
            bounds[member] = union(bounds[member], below);
        }
    }
    bounds
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    Bounds {
        min: [0, 1, 2].map(|axis| a.min[axis].min(b.min[axis])),
        max: [0, 1, 2].map(|axis| a.max[axis].max(b.max[axis])),
    }
}
