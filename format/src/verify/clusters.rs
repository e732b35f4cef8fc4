//! Checks of the cluster layer: every mesh, and what holds between nodes.
//!
//! What the groups themselves must keep (order, errors that do not grow, bounds within bounds) the reader has refused before.

use super::{Report, in_words};
use crate::cluster::morph::UNRANKED;
use crate::cluster::{ClusterGroupId, ClusterId, ClusterMesh, ClusterNode, Clusters};
use crate::rules::Tally;
use crate::{Bounds, ByteSource, Document, Error, LatticePoint};
use std::collections::{HashMap, HashSet};

/// Adds the checks of clusters to `report`, if the file has any.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let Some(clusters) = &document.clusters else {
        return;
    };
    let mut meshes = Tally::default();
    let mut textures = Tally::default();
    let mut ranks = Ranks::default();
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
        match decoded {
            Ok(mesh) => {
                meshes.check(true, String::new);
                ranks.add(clusters, id, mesh);
            }
            Err(_) => meshes.check(false, || format!("cluster {}: {}", id.0, in_words(decoded))),
        }
    }
    report.add("cluster checksums, decoding and bounds", meshes);
    if textures.count > 0 {
        report.add("cluster textures decode", textures);
    }
    if ranks.tally.count > 0 {
        report.add(
            "cluster vertices become vertices of their parents",
            ranks.tally,
        );
    }
    let [errors, bounds] = between_levels(clusters);
    report.add("cluster errors monotone up the levels", errors);
    report.add("cluster bounds within their parents'", bounds);
}

/// Ranks of children: within the places of all members, and the same at the same place. Nodes come in order, so that members are before
/// their group's children, which are side by side.
#[derive(Default)]
struct Ranks {
    /// Positions of members whose group's children are still to come.
    members: HashMap<ClusterId, Vec<LatticePoint>>,
    /// The group whose children come, how many places its members have, and ranks by place.
    group: Option<ClusterGroupId>,
    places: usize,
    known: HashMap<LatticePoint, u8>,
    tally: Tally,
}

impl Ranks {
    fn add(&mut self, clusters: &Clusters, id: ClusterId, mesh: ClusterMesh) {
        let Some(node) = clusters.node(id) else {
            return;
        };
        let above = node.parent.and_then(|parent| clusters.node(parent)?.group);
        if above != self.group {
            self.group = above;
            self.known.clear();
            let group = above.and_then(|above| clusters.group(above));
            let members = group.map_or(&[][..], |group| &group.members);
            // What does not decode has been told.
            let members = members.iter().filter_map(|id| self.members.remove(id));
            self.places = members.flatten().collect::<HashSet<_>>().len();
        }
        if !mesh.ranks.is_empty() {
            let mut vertices = mesh.positions.iter().zip(&mesh.ranks);
            let wrong = vertices.find(|&(place, &rank)| {
                let is_there = rank == UNRANKED || usize::from(rank) < self.places;
                !is_there || *self.known.entry(*place).or_insert(rank) != rank
            });
            let places = self.places;
            self.tally.check(wrong.is_none(), || {
                let (place, rank) = wrong.map_or_else(Default::default, |(p, r)| (*p, *r));
                format!(
                    "cluster {}: the vertex at {place:?} has rank {rank} of {places} places, or another in a cluster beside",
                    id.0
                )
            });
        }
        if node.group.is_some() {
            self.members.insert(id, mesh.positions);
        }
    }
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
