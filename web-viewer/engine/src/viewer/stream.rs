//! From bytes to resident pages, and what to ask for next.

use super::{Needed, Viewer};
use crate::Request;
use crate::lod::mesh::base_of;
use crate::residency::fetch::Item;
use crate::residency::page_table::bytes_of;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{PageId, PageSamples};

/// Samples that decoding a cluster counts for.
const CLUSTER_COST: usize = 256;

/// Samples of a page at `resolution`.
fn samples_of(resolution: u8) -> usize {
    let side = (1usize << resolution) + 1;
    side * side
}

impl Viewer {
    /// Decodes what arrived, parents first, as far as one update may and the cache has room.
    pub(super) fn decode_arrived(&mut self) {
        self.decode_colour();
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
            let what = *needed;
            if left == 0 {
                break;
            }
            if what
                .parent
                .is_some_and(|parent| !self.table.contains(parent))
            {
                continue;
            }
            if what.node.is_none() {
                if !self.decode_cluster(what) {
                    break;
                }
                left = left.saturating_sub(CLUSTER_COST);
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
                .make_room(bytes, self.page_capacity(), &self.pinned)
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

    /// Decodes the mesh of a cluster that arrived; false where the cache has no room for it.
    fn decode_cluster(&mut self, what: Needed) -> bool {
        let capacity = self.page_capacity();
        let size = self.cluster_bytes(what.page);
        if !self.table.make_room(size, capacity, &self.pinned) {
            return false;
        }
        let page = what.page;
        let bytes = self.fetcher.bytes_of(page).unwrap_or(&[]);
        let decoded = match self.document.cluster_of_page(page) {
            Some(id) => self
                .document
                .decode_cluster(id, bytes)
                .map_err(|error| error.to_string()),
            None => Err("is no cluster's".to_owned()),
        };
        match decoded {
            Ok(mesh) => {
                let node = self.document.cluster_node_of_page(page);
                let level = node.map_or(0, |node| node.level);
                if !self
                    .table
                    .insert_cluster(page, what.parent, level, mesh, size)
                {
                    return false;
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
        true
    }

    fn decode(&self, what: Needed) -> Result<PageSamples, String> {
        let bytes = self.fetcher.bytes_of(what.page).unwrap_or(&[]);
        let node = what.node.ok_or("is no chart's")?;
        let decoded = match (node.parent(), what.parent) {
            (None, _) => self.document.decode_root(node.chart, bytes),
            (Some((_, quadrant)), parent) => {
                let samples = match parent {
                    Some(parent) => self.table.samples(parent),
                    None => base_of(&self.document, node.chart),
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
