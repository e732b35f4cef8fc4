//! Checks of the cluster layer: every mesh, and what holds between nodes.
//!
//! What the groups themselves must keep (order, errors that do not grow, bounds within bounds) the reader has refused before.

use super::{Report, in_words};
use crate::cluster::morph::{Places, UNRANKED};
use crate::cluster::{ClusterId, ClusterMesh, ClusterNode, Clusters};
use crate::rules::Tally;
use crate::{Bounds, ByteSource, Document, Error, LatticePoint};
use std::collections::BTreeMap;

/// Adds the checks of clusters to `report`, if the file has any.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let Some(clusters) = &document.clusters else {
        return;
    };
    let mut meshes = Tally::default();
    let mut textures = Tally::default();
    for (id, node) in (0u32..).map(ClusterId).zip(&clusters.nodes) {
        let decoded = source
            .read(node.range.clone())
            .map_err(Error::from)
            .and_then(|bytes| document.decode_cluster(id, &bytes));
        if let Some(texture) = decoded.as_ref().ok().and_then(|mesh| mesh.texture.as_ref()) {
            let texels = texture.decode();
            textures.check(texels.is_ok(), || {
                format!("cluster {}: {}", id.0, in_words(texels))
            });
        }
        meshes.check(decoded.is_ok(), || {
            format!("cluster {}: {}", id.0, in_words(decoded))
        });
    }
    report.add("cluster checksums, decoding and bounds", meshes);
    if textures.count > 0 {
        report.add("cluster textures decode", textures);
    }
    let became = became(document, clusters, source);
    if became.count > 0 {
        report.add("cluster vertices become vertices of their parents", became);
    }
    let [errors, bounds] = between_levels(clusters);
    report.add("cluster errors monotone up the levels", errors);
    report.add("cluster bounds within their parents'", bounds);
}

/// Ranks of children: within the places of all members, and the same at the same place.
fn became(document: &Document, clusters: &Clusters, source: &dyn ByteSource) -> Tally {
    let mut became = Tally::default();
    let mesh = |id: ClusterId| {
        let bytes = source.read(clusters.node(id)?.range.clone()).ok()?;
        document.decode_cluster(id, &bytes).ok()
    };
    for group in &clusters.groups {
        // What does not decode has been told.
        let members: Vec<ClusterMesh> = group.members.iter().filter_map(|&id| mesh(id)).collect();
        let places = Places::of(&members).len();
        let mut known: BTreeMap<LatticePoint, u8> = BTreeMap::new();
        for id in group.children.clone().map(ClusterId) {
            let Some(child) = mesh(id).filter(|child| !child.ranks.is_empty()) else {
                continue;
            };
            let mut vertices = child.positions.iter().zip(&child.ranks);
            let wrong = vertices.find(|&(place, &rank)| {
                let is_there = rank == UNRANKED || usize::from(rank) < places;
                !is_there || *known.entry(*place).or_insert(rank) != rank
            });
            became.check(wrong.is_none(), || {
                let (place, rank) = wrong.map_or_else(Default::default, |(p, r)| (*p, *r));
                format!(
                    "cluster {}: the vertex at {place:?} has rank {rank} of {places} places, or another in a cluster beside",
                    id.0
                )
            });
        }
    }
    became
}

/// Errors and bounds of children against those of all members of the group above.
fn between_levels(clusters: &Clusters) -> [Tally; 2] {
    let mut errors = Tally::default();
    let mut bounds = Tally::default();
    for group in &clusters.groups {
        let members = group.members.iter().filter_map(|&id| clusters.node(id));
        let error = members
            .clone()
            .map(|node| node.error)
            .fold(f32::INFINITY, f32::min);
        for (id, node) in group.members.iter().zip(members.clone()) {
            errors.check(node.error <= error, || {
                format!("the error of cluster {} is not its group's", id.0)
            });
        }
        let Some(common) = members.map(|node| node.bounds).reduce(|a, b| a.common(&b)) else {
            continue;
        };
        for id in group.children.clone().map(ClusterId) {
            let Some(node) = clusters.node(id) else {
                continue;
            };
            errors.check(node.error <= error, || {
                format!("the error of cluster {} is above its parent's", id.0)
            });
            bounds.check(is_inside(node, &common), || {
                format!("the bounds of cluster {} leave those of its parent", id.0)
            });
        }
    }
    [errors, bounds]
}

fn is_inside(node: &ClusterNode, bounds: &Bounds) -> bool {
    (0..3).all(|axis| {
        let of = |point: &[u32; 3]| point.get(axis).copied();
        of(&bounds.min) <= of(&node.bounds.min) && of(&node.bounds.max) <= of(&bounds.max)
    })
}
