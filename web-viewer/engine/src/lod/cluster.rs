//! The cluster layer's part of a cut: which nodes are drawn, in whole, in place of everything below them.
//!
//! A node is drawn or all of its children are; the root is always in memory, so there is always something to draw. No two
//! nodes share a surface, so they need no balance and no stitching, and one takes the place of others at once.
//! Limit: nothing moves from one node's surface to the next, which therefore differ by up to the target error.

use super::cut::Cut;
use super::mesh::MeshBuilder;
use crate::EngineError;
use marquetry_format::{ByteSource, ClusterId, ClusterMesh, ClusterNode, Document, PageId};

/// A page of a cluster that a cut needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NeededCluster {
    /// The page.
    pub page: PageId,
    /// The page of the node above; `None` below the root.
    pub parent: Option<PageId>,
    /// The node above, which is drawn while this one is not there.
    pub above: ClusterId,
}

/// Nodes of the tree that `cut` draws, or those that it draws others in place of.
fn walk(document: &Document, cut: &Cut, mut visit: impl FnMut(ClusterId, &ClusterNode, bool)) {
    let Some(tree) = &document.clusters else {
        return;
    };
    let mut stack = vec![ClusterId(0)];
    while let Some(id) = stack.pop() {
        let Some(node) = tree.node(id) else { continue };
        let is_split = cut.is_cluster_split(id) && !node.children.is_empty();
        if is_split {
            stack.extend(node.children.clone().rev().map(ClusterId));
        }
        visit(id, node, is_split);
    }
}

/// The nodes that `cut` draws.
pub fn drawn(document: &Document, cut: &Cut) -> Vec<ClusterId> {
    let mut drawn = Vec::new();
    walk(document, cut, |id, _, is_split| {
        if !is_split {
            drawn.push(id);
        }
    });
    drawn
}

/// The pages that `cut` needs beyond the root, parents before children.
pub fn needed(document: &Document, cut: &Cut) -> Vec<NeededCluster> {
    let mut needed = Vec::new();
    walk(document, cut, |id, node, is_split| {
        if is_split {
            let parent = document.page_of_cluster(id);
            let pages = node.children.clone().map(ClusterId);
            needed.extend(
                pages
                    .filter_map(|child| document.page_of_cluster(child))
                    .map(|page| NeededCluster {
                        page,
                        parent,
                        above: id,
                    }),
            );
        }
    });
    needed
}

/// Splits, from the root down, every node that is `too_coarse`.
pub fn refine(
    document: &Document,
    cut: &mut Cut,
    mut too_coarse: impl FnMut(ClusterId, &ClusterNode) -> bool,
) {
    let Some(tree) = &document.clusters else {
        return;
    };
    let mut stack = vec![ClusterId(0)];
    while let Some(id) = stack.pop() {
        let Some(node) = tree.node(id) else { continue };
        if !node.children.is_empty() && too_coarse(id, node) {
            cut.split_cluster(id);
            stack.extend(node.children.clone().map(ClusterId));
        }
    }
}

/// Undoes every split whose children are not all resident, and what is below it (rule R7).
pub fn restrict(document: &Document, cut: &mut Cut, mut resident: impl FnMut(PageId) -> bool) {
    let wanted = cut.clone();
    cut.collapse_clusters();
    refine(document, cut, |id, node| {
        wanted.is_cluster_split(id)
            && node.children.clone().all(|child| {
                document
                    .page_of_cluster(ClusterId(child))
                    .is_some_and(&mut resident)
            })
    });
}

/// Triangles of the nodes that `cut` draws.
pub fn triangles(document: &Document, cut: &Cut) -> u64 {
    let mut sum = 0;
    walk(document, cut, |_, node, is_split| {
        if !is_split {
            sum += u64::from(node.triangles);
        }
    });
    sum
}

/// Largest geometric error of the nodes that `cut` draws, lattice units.
pub fn error(document: &Document, cut: &Cut) -> f64 {
    let mut largest = 0.0f64;
    walk(document, cut, |_, node, is_split| {
        if !is_split {
            largest = largest.max(f64::from(node.error));
        }
    });
    largest
}

/// Stored bytes of the pages that `cut` needs beyond the root.
pub fn bytes(document: &Document, cut: &Cut) -> u64 {
    needed(document, cut)
        .iter()
        .filter_map(|needed| document.page_range(needed.page))
        .map(|range| range.end - range.start)
        .sum()
}

/// Adds what `cut` draws of the clusters to a mesh.
///
/// # Errors
/// When a page cannot be read or is not valid.
pub fn append(
    document: &Document,
    source: &dyn ByteSource,
    cut: &Cut,
    builder: &mut MeshBuilder,
) -> Result<(), EngineError> {
    for id in drawn(document, cut) {
        let missing = EngineError::IndexIncomplete(id.0);
        let mesh: ClusterMesh = match document.page_of_cluster(id) {
            Some(page) => {
                let range = document.page_range(page).ok_or(missing)?;
                let bytes = source.read(range).map_err(marquetry_format::Error::from)?;
                document.decode_cluster(id, &bytes)?
            }
            None => match &document.clusters {
                Some(tree) => tree.root.clone(),
                None => return Err(missing),
            },
        };
        builder
            .add_cluster(&mesh)
            .ok_or(EngineError::IndexIncomplete(id.0))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, clustered};
    use std::collections::BTreeSet;

    #[test]
    fn restricted_cuts_cover_every_leaf_once() {
        let (document, _) = clustered(300).unwrap();
        let tree = document.clusters.as_ref().unwrap();
        let mut random = Random::new(21);
        for _ in 0..40 {
            let mut cut = Cut::coarsest(document.charts.len());
            refine(&document, &mut cut, |_, _| random.below(4) > 0);
            let pages: Vec<PageId> = needed(&document, &cut).iter().map(|n| n.page).collect();
            let there: BTreeSet<PageId> = pages
                .iter()
                .copied()
                .filter(|_| random.below(8) > 0)
                .collect();
            let wanted = cut.clone();
            restrict(&document, &mut cut, |page| there.contains(&page));
            let mut covered = vec![0; tree.nodes.len()];
            for id in drawn(&document, &cut) {
                assert!(
                    document
                        .page_of_cluster(id)
                        .is_none_or(|page| there.contains(&page))
                );
                let mut below = vec![id.0];
                while let Some(node) = below.pop() {
                    let children = tree.nodes[node as usize].children.clone();
                    covered[node as usize] += i32::from(children.is_empty());
                    below.extend(children);
                }
            }
            for (node, covered) in tree.nodes.iter().zip(covered) {
                assert_eq!(covered, i32::from(node.children.is_empty()));
            }
            assert!(triangles(&document, &cut) <= triangles(&document, &wanted));
            let everywhere = |_| true;
            let mut again = wanted.clone();
            restrict(&document, &mut again, everywhere);
            assert_eq!(again, wanted);
        }
    }

    #[test]
    fn parents_come_before_children() {
        let (document, _) = clustered(300).unwrap();
        let mut cut = Cut::coarsest(document.charts.len());
        refine(&document, &mut cut, |_, _| true);
        let mut seen = BTreeSet::new();
        for needed in needed(&document, &cut) {
            assert!(needed.parent.is_none_or(|parent| seen.contains(&parent)));
            seen.insert(needed.page);
        }
        let below_root = document.clusters.as_ref().unwrap().nodes.len() - 1;
        assert_eq!(seen.len(), below_root);
    }

    #[test]
    fn finest_mesh_holds_the_triangles_of_all_leaves() {
        let (document, source) = clustered(70).unwrap();
        let mut cut = Cut::coarsest(document.charts.len());
        refine(&document, &mut cut, |_, _| true);
        let mut builder = MeshBuilder::new(false);
        append(&document, &source, &cut, &mut builder).unwrap();
        let leaves = document.clusters.as_ref().unwrap().leaf_triangles();
        assert_eq!(builder.finish().triangles.len() as u64, leaves);
        assert_eq!(leaves, 4 * 70);
    }
}
