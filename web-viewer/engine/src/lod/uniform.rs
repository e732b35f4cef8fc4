//! Cuts that do not depend on a view: everywhere the same error, or as fine as a budget allows.
//!
//! Used by `export` and `measure`. Needs the whole index ([`Document::load_index`]).

use super::balance;
use super::cluster;
use super::cut::{Cut, Leaf, QUADRANTS};
use super::residency::{children, needed_pages};
use crate::EngineError;
use marquetry_format::header::{Section, SectionKind};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, Document, NodeId, PageId};
use std::collections::HashSet;

/// How fine a uniform cut is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fineness {
    /// Everything that is in the file.
    Finest,
    /// Geometric error of at most this, lattice units, wherever the file has it.
    Error(f64),
    /// As fine as possible with at most this many triangles: where the next group of clusters is too large, others are split that fit.
    Triangles(u64),
    /// As fine as possible with at most this many stored bytes: the base and the pages the cut needs.
    Bytes(u64),
}

/// The balanced cut of that fineness. A budget below the coarsest cut gives the coarsest.
///
/// # Errors
/// [`EngineError::IndexIncomplete`] where the index is not wholly loaded.
pub fn uniform_cut(document: &Document, fineness: Fineness) -> Result<Cut, EngineError> {
    check_index(document)?;
    match fineness {
        Fineness::Finest => Ok(cut_at(document, -1.0)),
        Fineness::Error(error) => Ok(cut_at(document, error.max(0.0))),
        Fineness::Triangles(most) => {
            Ok(within(document, |cut| cut_triangles(document, cut) <= most))
        }
        Fineness::Bytes(most) => {
            let before_pages = bytes_before_pages(document);
            Ok(within(document, |cut| {
                cut_bytes(document, cut).saturating_add(before_pages) <= most
            }))
        }
    }
}

/// Triangles that `cut` draws, of charts and clusters.
pub fn cut_triangles(document: &Document, cut: &Cut) -> u64 {
    cut.triangles() + cluster::triangles(document, cut)
}

/// Stored bytes of the pages that `cut` needs beyond the base.
pub fn cut_bytes(document: &Document, cut: &Cut) -> u64 {
    let pages = needed_pages(cut, document);
    pages
        .iter()
        .filter_map(|needed| document.page(needed.page))
        .map(|entry| u64::from(entry.length))
        .sum::<u64>()
        + cluster::bytes(document, cut)
}

/// Bytes of all but the pages of charts and clusters.
pub fn bytes_before_pages(document: &Document) -> u64 {
    [SectionKind::Pages, SectionKind::ClusterPages]
        .into_iter()
        .filter_map(|kind| document.header().section(kind).ok())
        .map(Section::length)
        .fold(document.file_length(), u64::saturating_sub)
}

fn check_index(document: &Document) -> Result<(), EngineError> {
    match (0..document.page_count()).find(|page| document.page(PageId(*page)).is_none()) {
        Some(page) => Err(EngineError::IndexIncomplete(page)),
        None => Ok(()),
    }
}

/// The coarsest balanced cut with errors of at most `error` wherever the file has them.
fn cut_at(document: &Document, error: f64) -> Cut {
    let mut cut = Cut::coarsest(document.charts.len());
    for index in 0..document.charts.len() {
        let Ok(id) = u32::try_from(index) else { break };
        let root = NodeId::root(ChartId(id));
        let Some(entry) = document.page(PageId(id)) else {
            continue;
        };
        let fine_enough = entry.errors.iter().position(|e| f64::from(*e) <= error);
        let last = entry.errors.len().saturating_sub(1);
        let resolution = fine_enough
            .unwrap_or(last)
            .min(usize::from(entry.resolution));
        cut.set_root(
            ChartId(id),
            u8::try_from(resolution).unwrap_or(PAGE_RESOLUTION),
        );
        if fine_enough.is_some() {
            continue;
        }
        let mut stack = vec![(root, PageId(id))];
        while let Some((node, page)) = stack.pop() {
            let Some(first) = document.first_child(page) else {
                continue;
            };
            cut.split(node);
            for (quadrant, page) in QUADRANTS.into_iter().zip(children(first)) {
                let too_coarse = |e: &f32| f64::from(*e) > error;
                if document
                    .page(page)
                    .and_then(|entry| entry.errors.first())
                    .is_some_and(too_coarse)
                {
                    stack.push((node.child(quadrant), page));
                }
            }
        }
    }
    balance::refine(&mut cut, &document.charts, |leaf| {
        is_refinable(document, leaf)
    });
    balance::coarsen(&mut cut, &document.charts);
    cluster::refine(document, &mut cut, |_, _, over| f64::from(over) > error);
    cut
}

fn is_refinable(document: &Document, leaf: Leaf) -> bool {
    let Some(page) = document.page_of_node(leaf.node) else {
        return false;
    };
    let root_resolution = document.page(page).map_or(0, |entry| entry.resolution);
    leaf.grid_resolution() < root_resolution || document.first_child(page).is_some()
}

/// The finest cut of equal error that `fits`, by bisection over the errors in the file, and what fits beyond.
fn within(document: &Document, fits: impl Fn(&Cut) -> bool) -> Cut {
    let mut errors: Vec<f64> = (0..document.page_count())
        .filter_map(|page| document.page(PageId(page)))
        .flat_map(|entry| entry.errors.iter().map(|e| f64::from(*e)))
        .chain(
            document
                .clusters
                .iter()
                .flat_map(|tree| tree.nodes.iter().map(|node| f64::from(node.error))),
        )
        .chain([-1.0])
        .collect();
    errors.sort_unstable_by(f64::total_cmp);
    errors.dedup();
    let (mut low, mut high) = (0, errors.len());
    let mut best = Cut::coarsest(document.charts.len());
    while low < high {
        let middle = low.midpoint(high);
        let cut = cut_at(document, errors[middle]);
        if fits(&cut) {
            best = cut;
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    fill(document, best, fits)
}

/// Groups of clusters that [`fill`] tries to split beyond those that it did.
const TRIES: usize = 64;

/// Splits more groups of clusters, coarse ones first, while the cut `fits`: the next by error may be larger than what is left, one after it not.
fn fill(document: &Document, mut cut: Cut, fits: impl Fn(&Cut) -> bool) -> Cut {
    let mut refused = HashSet::new();
    loop {
        let groups = cluster::splittable(document, &cut);
        let mut is_finer = false;
        for group in groups {
            if refused.len() == TRIES || refused.contains(&group.children.start) {
                continue;
            }
            let mut finer = cut.clone();
            finer.split_group(group);
            if fits(&finer) {
                cut = finer;
                is_finer = true;
            } else {
                refused.insert(group.children.start);
            }
        }
        if !is_finer {
            return cut;
        }
    }
}
