//! Which cut a view gets, and which pages that takes.
//!
//! Where the wanted pages do not fit the cache, or there are more clusters than slots, the target error of everything
//! beyond the base is raised, in steps of a quarter octave, until they do. The smallest step that fits is searched for, so
//! it is a function of the view, not of history.

use super::{Needed, Viewer};
use crate::camera::View;
use crate::lod::animate::Drawn;
use crate::lod::cluster::{self, NeededCluster};
use crate::lod::cut::Cut;
use crate::lod::desire::{Target, Wanted, cluster_importance_px, importance_px};
use crate::lod::residency::{NeededPage, needed_pages, restrict};
use crate::lod::rest::at_rest;
use crate::options::Transition;
use crate::residency::page_table::{bytes_of, bytes_of_cluster};
use crate::residency::upload::MAX_CLUSTER_SLOTS;
use marquetry_format::{ClusterGroupId, PageId};

/// Steps of the target error to a factor of two.
const BUDGET_STEPS_PER_OCTAVE: f64 = 4.0;
/// Clusters that devices have room for beside the root, however large the cache is.
const MOST_CLUSTERS: usize = MAX_CLUSTER_SLOTS as usize - 1;
/// Beyond this step nothing but the base is wanted.
const LAST_BUDGET_STEP: u32 = 120;

/// What a cut takes of the cache.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanSize {
    bytes: u64,
    /// Pages that are clusters.
    clusters: usize,
}

/// A cut that a view wants, and what it takes.
struct Plan {
    wanted: Wanted,
    size: PlanSize,
    /// The pages it needs; `None` where the plan before has the same cut.
    needed: Option<(Vec<NeededPage>, Vec<NeededCluster>)>,
    fits: bool,
}

impl Viewer {
    /// Screen-space error, pixels, that pages beyond the base are wanted for at a budget step.
    pub(super) fn paged_error_px(&self, step: u32) -> f64 {
        if step >= LAST_BUDGET_STEP {
            return f64::INFINITY;
        }
        self.options.error_px * (f64::from(step) / BUDGET_STEPS_PER_OCTAVE).exp2()
    }

    /// Finds the finest cut whose pages fit the cache, and the pages it needs.
    pub(super) fn plan(&mut self, view: &View) {
        self.stale.plan = false;
        self.stale.target = true;
        self.planned_resting = self.is_resting();
        let previous = (!self.planned_resting).then(|| self.wanted.cut.clone());
        let mut best = self.try_step(view, previous.as_ref(), self.budget_step);
        while !best.fits {
            self.budget_step += 1;
            best = self.try_step(view, previous.as_ref(), self.budget_step);
        }
        while let Some(finer) = self.budget_step.checked_sub(1) {
            let attempt = self.try_step(view, previous.as_ref(), finer);
            if !attempt.fits {
                break;
            }
            self.budget_step = finer;
            best = attempt;
        }
        let is_new = best.needed.is_some();
        // Nobody asks how much is to be seen of what is there.
        if is_new || self.filter.is_some() || self.missing().next().is_some() {
            let (pages, clusters) =
                (best.needed).unwrap_or_else(|| self.needed_by(&best.wanted.cut));
            self.need(view, &pages, &clusters);
        }
        self.wanted = best.wanted;
        self.planned_size = Some(best.size);
        self.pin();
    }

    /// The cut that a view wants at a budget step.
    fn try_step(&self, view: &View, previous: Option<&Cut>, step: u32) -> Plan {
        let target = Target {
            view,
            error_px: self.options.error_px,
            paged_error_px: self.paged_error_px(step),
            previous,
        };
        let wanted = self.forest.want(&self.document, &target);
        let known = self.planned_size.filter(|_| wanted.cut == self.wanted.cut);
        let (size, needed) = known.map_or_else(
            || {
                let (pages, clusters) = self.needed_by(&wanted.cut);
                let size = PlanSize {
                    bytes: self.cache_bytes(&pages, &clusters),
                    clusters: clusters.len(),
                };
                (size, Some((pages, clusters)))
            },
            |size| (size, None),
        );
        let fits = size.bytes <= self.page_capacity() && size.clusters <= MOST_CLUSTERS
            || step >= LAST_BUDGET_STEP;
        Plan {
            wanted,
            size,
            needed,
            fits,
        }
    }

    fn needed_by(&self, cut: &Cut) -> (Vec<NeededPage>, Vec<NeededCluster>) {
        (
            needed_pages(cut, &self.document),
            cluster::needed(&self.document, cut),
        )
    }

    /// Whether a change is shown in one frame.
    pub(super) fn changes_at_once(&self) -> bool {
        self.options.transition == Transition::None || self.options.morph_seconds == 0.0
    }

    /// What is there of the plan, and how far on its way the view shows it at rest.
    pub(super) fn aim(&self, view: &View) -> Drawn {
        let cut = if self.missing().next().is_none() {
            self.wanted.cut.clone()
        } else {
            restrict(&self.wanted.cut, &self.document, |page| {
                self.table.contains(page)
            })
        };
        if self.changes_at_once() || self.fades() {
            return Drawn::of(cut);
        }
        let target = Target {
            view,
            error_px: self.options.error_px,
            paged_error_px: self.paged_error_px(self.budget_step),
            previous: None,
        };
        at_rest(&self.document, &self.forest, &target, cut)
    }

    fn cache_bytes(&self, needed: &[NeededPage], clusters: &[NeededCluster]) -> u64 {
        let has_colours = self.document.metadata.has_colours;
        let entries = needed
            .iter()
            .filter_map(|needed| self.document.page(needed.page));
        entries
            .map(|entry| bytes_of(entry.resolution, entry.has_children, has_colours))
            .sum::<u64>()
            + clusters
                .iter()
                .map(|needed| self.cluster_bytes(needed.page))
                .sum::<u64>()
    }

    /// What the cluster on a page takes of the cache.
    pub(super) fn cluster_bytes(&self, page: PageId) -> u64 {
        let range = self.document.page_range(page).unwrap_or_default();
        bytes_of_cluster(range.end - range.start)
    }

    fn need(&mut self, view: &View, pages: &[NeededPage], clusters: &[NeededCluster]) {
        // Not all of the map, which is as long as the file has pages.
        for needed in self.needed.drain(..) {
            self.needed_index.remove(needed.page.0);
        }
        for what in pages {
            self.add_needed(Needed {
                page: what.page,
                parent: what.parent,
                node: Some(what.node),
                group: None,
                importance_px: self.importance_px(view, what),
                allowed: true,
            });
        }
        for what in clusters {
            let tree = self.document.clusters.as_ref();
            let above = tree.and_then(|tree| tree.node(what.above));
            let group = above.and_then(|node| node.group);
            let over = tree.zip(group).and_then(|(tree, id)| tree.group(id));
            self.add_needed(Needed {
                page: what.page,
                parent: what.parent,
                node: None,
                group,
                importance_px: above
                    .zip(over)
                    .filter(|_| !self.table.contains(what.page))
                    .map_or(0.0, |(node, group)| {
                        cluster_importance_px(view, group, node)
                    }),
                allowed: true,
            });
        }
    }

    /// Pages of the members of a group.
    fn members(&self, group: Option<ClusterGroupId>) -> impl Iterator<Item = PageId> + '_ {
        let clusters = self.document.clusters.as_ref();
        let group = group.and_then(|id| clusters?.group(id));
        let members = group.into_iter().flat_map(|group| &group.members);
        members.filter_map(|&id| self.document.page_of_cluster(id))
    }

    /// Adds a page, which is allowed where its parent and the filter let it pass.
    fn add_needed(&mut self, mut needed: Needed) {
        let is_allowed = |page: &PageId| {
            let index = self.needed_index.get(page.0);
            index
                .and_then(|index| self.needed.get(index as usize))
                .is_none_or(|needed| needed.allowed)
        };
        needed.allowed = self.filter.as_ref().is_none_or(|filter| {
            needed.parent.iter().all(is_allowed)
                && self.members(needed.group).all(|page| is_allowed(&page))
                && filter(needed.page)
        });
        let index = u32::try_from(self.needed.len()).unwrap_or(u32::MAX);
        self.needed_index.insert(needed.page.0, index);
        self.needed.push(needed);
    }

    /// All pages that `cut` needs, of charts and of clusters.
    fn pages_of(&self, cut: &Cut) -> Vec<PageId> {
        let charts = needed_pages(cut, &self.document);
        let clusters = cluster::needed(&self.document, cut);
        charts
            .iter()
            .map(|needed| needed.page)
            .chain(clusters.iter().map(|needed| needed.page))
            .collect()
    }

    /// Screen-space error, pixels, of what is drawn while `what` is not there; 0 where it is, as nobody asks.
    fn importance_px(&self, view: &View, what: &NeededPage) -> f64 {
        if self.table.contains(what.page) {
            return 0.0;
        }
        let (node, resolution) = match what.node.parent() {
            Some((parent, _)) => (parent, None),
            None => (what.node, Some(usize::from(self.document.base_resolution))),
        };
        let page = self
            .document
            .page_of_node(node)
            .and_then(|page| self.document.page(page));
        let Some(entry) = page else { return 0.0 };
        let error = resolution
            .and_then(|resolution| entry.errors.get(resolution))
            .or_else(|| entry.errors.last());
        error.map_or(0.0, |error| importance_px(view, *error, &entry.bounds))
    }

    /// Pins the pages of the plan and of what is drawn, and marks them as used; what is pinned already is no less used than before.
    pub(super) fn pin(&mut self) {
        // What is drawn in place of what is wanted, and is nowhere finer, needs no other pages.
        let is_all = self.fade.is_none() && self.drawn.cut.is_in(&self.wanted.cut);
        let is_pinned = |(cut, needed): &(Cut, usize)| {
            is_all && *cut == self.wanted.cut && *needed == self.needed.len()
        };
        if self.pinned_for.as_ref().is_some_and(is_pinned) {
            return;
        }
        self.pinned_for = is_all.then(|| (self.wanted.cut.clone(), self.needed.len()));
        let mut drawn = if is_all {
            Vec::new()
        } else {
            self.pages_of(&self.drawn.cut)
        };
        if let Some(fade) = &self.fade {
            drawn.extend(self.pages_of(&fade.leaving.cut));
        }
        self.pinned.clear();
        let needed = self.needed.iter().map(|needed| needed.page.0);
        self.pinned
            .extend(needed.chain(drawn.iter().map(|page| page.0)));
        self.table.touch(drawn.into_iter());
        self.table
            .touch(self.needed.iter().map(|needed| needed.page));
    }
}
