//! Made-up clusters.

use super::{Random, Shape, metadata};
use crate::lod::cut::Cut;
use marquetry_format::cluster::ClusterTexture;
use marquetry_format::writer::{ClusterInput, Content, write};
use marquetry_format::{ClusterMesh, Document, Error, LatticePoint, Limits, octahedral};

/// A torus with a cluster tree beside it: `count` (at least 1) tetrahedra strewn over the lattice, ten a leaf.
///
/// # Errors
/// When the file cannot be written or read: a fault of this crate or of the format's.
pub fn clustered(count: u32) -> Result<(Document, Vec<u8>), Error> {
    clustered_with(count, None)
}

/// The same, with this frame of at least 16 × 16 texels on every cluster.
///
/// # Errors
/// As [`clustered`].
pub fn clustered_with(count: u32, frame: Option<&[u8]>) -> Result<(Document, Vec<u8>), Error> {
    let mut random = Random::new(6);
    let tetrahedra: Vec<LatticePoint> = (0..count.max(1))
        .map(|n| {
            let along = (n * 20_000) % (1 << 20);
            [along, random.below(1 << 18), random.below(1 << 18)].map(|c| c / 4 * 4)
        })
        .collect();
    let mesh = |places: &[LatticePoint]| {
        let mut mesh = ClusterMesh::default();
        for [x, y, z] in places {
            let first = u8::try_from(mesh.positions.len()).unwrap_or(u8::MAX);
            for [a, b, c] in [[0, 0, 0], [9000, 0, 0], [0, 9000, 0], [0, 0, 9000]] {
                mesh.positions.push([x + a, y + b, z + c]);
                mesh.normals.push(octahedral::encode([1.0, 0.5, 0.25]));
                mesh.colours.push([200, 120, 40]);
            }
            for corners in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
                mesh.triangles
                    .push(corners.map(|corner: u8| first + corner));
            }
        }
        mesh.texture = frame.map(|frame| ClusterTexture {
            places: (0u8..16)
                .cycle()
                .map(|k| [k, 15 - k])
                .take(mesh.positions.len())
                .collect(),
            frame: frame.to_vec(),
        });
        mesh
    };
    // Texels of the leaves are 1 000 long, those above four times as long as below.
    let texel = |below: Option<f32>| frame.map(|_| below.map_or(1000.0, |texel| 4.0 * texel));
    // The leaves, then every level above; turned around at the end, so that the root is first.
    let mut nodes: Vec<(ClusterInput, Vec<LatticePoint>)> = tetrahedra
        .chunks(10)
        .map(|places| {
            let input = ClusterInput {
                mesh: mesh(places),
                error: 2.0,
                texel: texel(None),
                children: Vec::new(),
            };
            (input, places.to_vec())
        })
        .collect();
    let mut level = 0..nodes.len();
    while level.len() > 1 {
        let (start, count) = (level.start, level.len());
        let groups = count.div_ceil(4);
        for group in 0..groups {
            let children = start + group * count / groups..start + (group + 1) * count / groups;
            let below = &nodes[children.clone()];
            let places = below.iter().flat_map(|(_, places)| places).step_by(4);
            let places: Vec<_> = places.copied().collect();
            let errors = below.iter().map(|(child, _)| child.error);
            let input = ClusterInput {
                mesh: mesh(&places),
                error: 4.0 * errors.fold(10_000.0, f32::max),
                texel: texel(below.first().and_then(|(child, _)| child.texel)),
                children: children
                    .filter_map(|child| u32::try_from(child).ok())
                    .collect(),
            };
            nodes.push((input, places));
        }
        level = level.end..nodes.len();
    }
    let nodes = nodes.into_iter().map(|(node, _)| node).collect();
    written(&root_first(nodes))
}

/// Nodes the other way round, the last first.
pub(super) fn root_first(mut nodes: Vec<ClusterInput>) -> Vec<ClusterInput> {
    let last = u32::try_from(nodes.len().saturating_sub(1)).unwrap_or(u32::MAX);
    nodes.reverse();
    for child in nodes.iter_mut().flat_map(|node| &mut node.children) {
        *child = last - *child;
    }
    nodes
}

/// A torus with these clusters beside it.
pub(super) fn written(clusters: &[ClusterInput]) -> Result<(Document, Vec<u8>), Error> {
    let metadata = metadata();
    let finest = Cut::coarsest(Shape::Torus.charts(2).len());
    let charts = Shape::Torus.inputs(&finest);
    let content = Content {
        charts: &charts,
        clusters,
        ..Content::default()
    };
    let mut bytes = Vec::new();
    write(&metadata, &metadata.lattice, &content, &mut bytes)?;
    let mut document = Document::open(&bytes, Limits::default())?;
    document.load_index(&bytes)?;
    Ok((document, bytes))
}
