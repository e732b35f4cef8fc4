//! From bytes to resident pages, and what to ask for next.

use super::{Needed, Viewer};
use crate::Request;
use crate::lod::mesh::base_of;
use crate::lod::residency::NeededPage;
use crate::residency::fetch::Item;
use crate::residency::page_table::bytes_of;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{PageId, PageSamples};

/// Samples of a page at `resolution`.
fn samples_of(resolution: u8) -> usize {
    let side = (1usize << resolution) + 1;
    side * side
}

impl Viewer {
    /// Decodes what arrived, parents first, as far as one update may and the cache has room.
    pub(super) fn decode_arrived(&mut self) {
        let mut left = self.options.pages_per_update * samples_of(PAGE_RESOLUTION);
        for page in self.fetcher.arrived() {
            let Some(needed) = self
                .needed_index
                .get(&page)
                .and_then(|index| self.needed.get(*index))
            else {
                self.fetcher.forget(page);
                continue;
            };
            let what = needed.what;
            if left == 0 {
                break;
            }
            if what
                .parent
                .is_some_and(|parent| !self.table.contains(parent))
            {
                continue;
            }
            let Some(entry) = self.document.page(page) else {
                continue;
            };
            let has_children = entry.has_children;
            let bytes = bytes_of(
                entry.resolution,
                has_children,
                self.document.metadata.has_colours,
            );
            if !self
                .table
                .make_room(bytes, self.options.cache_bytes, &self.pinned)
            {
                break;
            }
            left = left.saturating_sub(samples_of(entry.resolution));
            match self.decode(what) {
                Ok(samples) => {
                    if !self.table.insert(page, what.parent, samples, has_children) {
                        break;
                    }
                    self.fetched += 1;
                    self.fetcher.succeed(Item::Page(page));
                    self.stale.target = true;
                }
                Err(reason) => self.fetcher.fail(
                    self.clock,
                    &[Item::Page(page)],
                    &format!("page {}: {reason}", page.0),
                ),
            }
            self.fetcher.forget(page);
        }
    }

    fn decode(&self, what: NeededPage) -> Result<PageSamples, String> {
        let bytes = self.fetcher.bytes_of(what.page).unwrap_or(&[]);
        let decoded = match (what.node.parent(), what.parent) {
            (None, _) => self.document.decode_root(what.node.chart, bytes),
            (Some((_, quadrant)), parent) => {
                let samples = match parent {
                    Some(parent) => self.table.samples(parent),
                    None => base_of(&self.document, what.node.chart),
                };
                let samples = samples.ok_or("its parent is not in memory")?;
                self.document
                    .decode_child(what.page, quadrant, samples, bytes)
            }
        };
        decoded.map_err(|error| error.to_string())
    }

    /// What to fetch now: the index first, then pages by importance.
    pub(super) fn schedule(&mut self) -> Vec<Request> {
        let mut missing: Vec<&Needed> = self.missing().filter(|needed| needed.allowed).collect();
        missing.sort_by(|a, b| {
            b.importance_px
                .total_cmp(&a.importance_px)
                .then_with(|| a.what.page.cmp(&b.what.page))
        });
        let pages: Vec<PageId> = missing.into_iter().map(|needed| needed.what.page).collect();
        let limit = self.options.requests_in_flight;
        self.fetcher.schedule(
            self.clock,
            limit,
            &self.document,
            &self.wanted.blocks,
            &pages,
        )
    }
}
