//! From bytes to resident pages, and what to ask for next.

use super::jobs::Subject;
use super::{Needed, Viewer};
use crate::Request;
use crate::decode::{DecodeJob, Decoded, Decoding, PageWork, Work};
use crate::lod::cluster::target::GroupSurface;
use crate::lod::mesh::base_of;
use crate::residency::fetch::Item;
use crate::residency::page_table::{Budget, bytes_of};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{PageId, PageTask};
use std::sync::Arc;

/// Samples that decoding a cluster counts for.
const CLUSTER_COST: usize = 256;

/// What a page takes.
#[derive(Debug, Clone, Copy)]
struct Room {
    /// That of its samples; `None` for a cluster.
    resolution: Option<u8>,
    bytes: u64,
}

/// Samples of a page at `resolution`.
fn samples_of(resolution: u8) -> usize {
    let side = (1usize << resolution) + 1;
    side * side
}

impl Viewer {
    /// Puts into place what was decoded elsewhere, and decodes what arrived, parents first, as far as one update may and the
    /// cache has room.
    pub(super) fn decode_arrived(&mut self) {
        self.take_in_finished();
        if self.fetcher.has_arrived() {
            let needed = &self.needed_index;
            self.fetcher.want_only(|page| needed.get(page.0).is_some());
        }
        if self.jobs.decoding == Decoding::Elsewhere {
            return;
        }
        self.decode_tiles();
        let mut left = self.options.pages_per_update * samples_of(PAGE_RESOLUTION);
        let mut last = None;
        while left > 0
            && let Some((job, cost)) = self.next_page_job(&mut last)
        {
            left = left.saturating_sub(cost);
            self.take_in(job.run());
        }
    }

    /// The next page behind `last` that can be decoded and has room in the cache, with the samples it counts for.
    pub(super) fn next_page_job(
        &mut self,
        last: &mut Option<PageId>,
    ) -> Option<(DecodeJob, usize)> {
        while let Some(page) = self.fetcher.next_arrived(*last) {
            *last = Some(page);
            let Some(what) = self.needed_page(page) else {
                continue;
            };
            let has_parent = what.parent.is_none_or(|parent| self.table.contains(parent));
            let above = self.surface_above(what);
            let is_decodable = has_parent && (above.is_some() || what.node.is_some());
            let Some(room) = self.room_for(what).filter(|_| is_decodable) else {
                continue;
            };
            if !self.reserve(what, room) {
                return None;
            }
            let bytes = self.fetcher.begin_decoding(page);
            match self.task(what, bytes) {
                Ok(task) => {
                    let subject = Subject::Page(page);
                    let work = Work::Page(PageWork { task, above });
                    let job = self.jobs.begin(subject, room.bytes, work);
                    return Some((job, room.resolution.map_or(CLUSTER_COST, samples_of)));
                }
                Err(reason) => self.refuse_page(page, &reason),
            }
        }
        None
    }

    /// What a cluster moves to; `None` for a page of samples, and while some member of the group above is not there.
    fn surface_above(&mut self, what: Needed) -> Option<Arc<GroupSurface>> {
        self.table.group_surface(&self.document, what.group?)
    }

    pub(super) fn needed_page(&self, page: PageId) -> Option<Needed> {
        let index = self.needed_index.get(page.0)?;
        self.needed.get(index as usize).copied()
    }

    /// What a page takes; `None` while its index entry is not there.
    fn room_for(&self, what: Needed) -> Option<Room> {
        if what.node.is_none() {
            return Some(Room {
                resolution: None,
                bytes: self.cluster_bytes(what.page),
            });
        }
        let entry = self.document.page(what.page)?;
        let has_colours = self.document.metadata.has_colours;
        Some(Room {
            resolution: Some(entry.resolution),
            bytes: bytes_of(entry.resolution, entry.has_children, has_colours),
        })
    }

    fn reserve(&mut self, what: Needed, room: Room) -> bool {
        let budget = Budget {
            capacity_bytes: self.page_capacity(),
            pinned: &self.pinned,
        };
        let Needed { page, parent, .. } = what;
        match room.resolution {
            Some(resolution) => self
                .table
                .reserve_samples(page, parent, resolution, room.bytes, budget),
            None => self.table.reserve_cluster(page, parent, room.bytes, budget),
        }
    }

    /// Everything that decoding a page takes.
    fn task(&self, what: Needed, bytes: Vec<u8>) -> Result<PageTask, String> {
        let document = &self.document;
        let task = match what.node.map(|node| (node, node.parent())) {
            None => {
                let id = document.cluster_of_page(what.page);
                document.cluster_task(id.ok_or("is no cluster's")?, bytes)
            }
            Some((node, None)) => document.root_task(node.chart, bytes),
            Some((node, Some((_, quadrant)))) => {
                let samples = match what.parent {
                    Some(parent) => self.table.samples(parent).cloned(),
                    None => base_of(document, node.chart).cloned().map(Arc::new),
                };
                let samples = samples.ok_or("its parent is not in memory")?;
                document.child_task(what.page, quadrant, samples, bytes)
            }
        };
        task.map_err(|error| error.to_string())
    }

    /// Puts a decoded page into place; drops it where it is not needed any more.
    pub(super) fn take_page(&mut self, page: PageId, decoded: Result<Decoded, String>) {
        if self.needed_index.get(page.0).is_none() {
            self.let_go(page);
            return;
        }
        let taken = match decoded {
            Err(reason) => Err(reason),
            Ok(Decoded::Samples(samples)) => {
                let entry = self.document.page(page);
                let has_children = entry.is_some_and(|entry| entry.has_children);
                let taken = self.table.insert(page, samples, has_children);
                taken
                    .then_some(())
                    .ok_or_else(|| "has another resolution than its index says".to_owned())
            }
            Ok(Decoded::Cluster(mesh, targets)) => {
                let node = self.document.cluster_node_of_page(page);
                let level = node.map_or(0, |node| node.level);
                let taken = self.table.insert_cluster(page, level, mesh, &targets);
                taken
                    .then_some(())
                    .ok_or_else(|| "is no cluster's".to_owned())
            }
            Ok(Decoded::Image(_)) => Err("is an image".to_owned()),
        };
        match taken {
            Ok(()) => {
                self.fetcher.end_decoding(page);
                self.fetcher.succeed(Item::Page(page));
                self.fetched += 1;
                self.stale.target = true;
            }
            Err(reason) => self.refuse_page(page, &reason),
        }
    }

    /// Has a page fetched again that did not decode.
    fn refuse_page(&mut self, page: PageId, reason: &str) {
        self.let_go(page);
        let words = format!("page {}: {reason}", page.0);
        self.fetcher.fail(self.clock, &[Item::Page(page)], &words);
    }

    fn let_go(&mut self, page: PageId) {
        self.table.release(page);
        self.fetcher.end_decoding(page);
    }

    /// What to fetch now: the index first, then pages by importance.
    pub(super) fn schedule(&mut self) -> Vec<Request> {
        let mut missing: Vec<&Needed> = self.missing().filter(|needed| needed.allowed).collect();
        missing.sort_by(|a, b| {
            b.importance_px
                .total_cmp(&a.importance_px)
                .then_with(|| a.page.cmp(&b.page))
        });
        let pages: Vec<PageId> = missing.into_iter().map(|needed| needed.page).collect();
        let limit = self.options.requests_in_flight;
        let mut requests = self.fetcher.schedule(
            self.clock,
            limit,
            &self.document,
            &self.wanted.blocks,
            &pages,
        );
        if let Some(layer) = &mut self.colour {
            let spare = limit.saturating_sub(self.fetcher.in_flight());
            requests.extend(layer.schedule(self.clock, spare));
        }
        requests
    }
}
