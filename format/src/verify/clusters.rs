//! Checks of the cluster layer: every mesh, and what holds between nodes.
//!
//! What the tree itself must keep (order, errors that do not grow, bounds within bounds) the reader has refused before.

use super::{Report, in_words};
use crate::cluster::ClusterId;
use crate::rules::Tally;
use crate::{ByteSource, Document, Error};

/// Adds the checks of clusters to `report`, if the file has any.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let Some(clusters) = &document.clusters else {
        return;
    };
    let mut meshes = Tally::default();
    let mut textures = Tally::default();
    let mut errors = Tally::default();
    let mut bounds = Tally::default();
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
        let Some(parent) = node.parent.and_then(|parent| clusters.node(parent)) else {
            continue;
        };
        errors.check(node.error <= parent.error, || {
            format!("the error of cluster {} is above its parent's", id.0)
        });
        let inside = (0..3).all(|axis| {
            let of = |point: &[u32; 3]| point.get(axis).copied();
            of(&parent.bounds.min) <= of(&node.bounds.min)
                && of(&node.bounds.max) <= of(&parent.bounds.max)
        });
        bounds.check(inside, || {
            format!("the bounds of cluster {} leave those of its parent", id.0)
        });
    }
    report.add("cluster checksums, decoding and bounds", meshes);
    if textures.count > 0 {
        report.add("cluster textures decode", textures);
    }
    report.add("cluster errors monotone up the tree", errors);
    report.add("cluster bounds within their parents'", bounds);
}
