//! The colour tiles of a viewer.

use super::desire::{Scales, WantedTile, WantedTiles, want};
use super::map::{MapPlace, Shown, TileMap};
use super::slots::tile_bytes;
use super::store::TileStore;
use super::stream::{Item, TileStream};
use super::upload::{Mip, TileUpload};
use crate::camera::View;
use crate::lod::desire::Forest;
use crate::residency::fetch::{Request, RequestId};
use crate::residency::ids::{IdMap, IdSet};
use crate::stats::TileStats;
use marquetry_format::{ColourIndex, Document, Error, ImageTask, Limits, NodeId, TileId};

/// Steps of the texel size to a factor of two, and the last of them.
const BUDGET_STEPS_PER_OCTAVE: f64 = 4.0;
const LAST_BUDGET_STEP: u32 = 60;
/// Requests for tiles that are always allowed, however many pages are under way.
const LEAST_REQUESTS: usize = 2;

/// The colour tiles of one file.
#[derive(Debug)]
pub struct ColourLayer {
    index: ColourIndex,
    scales: Scales,
    store: TileStore,
    stream: TileStream,
    wanted: WantedTiles,
    /// By tile: its place in `wanted`.
    places: IdMap<TileId, usize>,
    pinned: IdSet<TileId>,
    map: TileMap,
    fetched: u64,
    /// When the last tile came.
    changed_at: f64,
}

impl ColourLayer {
    /// The tiles of `document`; `None` where it has none.
    ///
    /// # Errors
    /// When its sections contradict each other.
    pub fn new(document: &Document) -> Result<Option<Self>, Error> {
        let index = ColourIndex::of(document, Limits::default())?;
        Ok(index.map(|index| Self {
            index,
            scales: Scales::new(document),
            store: TileStore::default(),
            stream: TileStream::default(),
            wanted: WantedTiles::default(),
            places: IdMap::default(),
            pinned: IdSet::default(),
            map: TileMap::default(),
            fetched: 0,
            changed_at: f64::NEG_INFINITY,
        }))
    }

    /// Finds the tiles that a view wants: the finest that fit `capacity_bytes`.
    pub fn plan(&mut self, document: &Document, forest: &Forest, view: &View, capacity_bytes: u64) {
        if !self.index.has_directory() {
            return;
        }
        for step in 0..=LAST_BUDGET_STEP {
            let coarser = (f64::from(step) / BUDGET_STEPS_PER_OCTAVE).exp2();
            self.wanted = want(document, &self.index, forest, &self.scales, view, coarser);
            let bytes =
                |wanted: &WantedTile| self.index.size(wanted.node.chart).map_or(0, tile_bytes);
            let total: u64 = self.wanted.tiles.iter().map(bytes).sum();
            if total <= capacity_bytes {
                break;
            }
        }
        self.fit(capacity_bytes);
        let tiles = self.wanted.tiles.iter().enumerate();
        self.places = tiles.map(|(place, wanted)| (wanted.tile, place)).collect();
        self.pinned = self.places.keys().copied().collect();
        self.store
            .touch(self.wanted.tiles.iter().map(|wanted| wanted.tile));
        let places = &self.places;
        self.stream.want_only(|tile| places.contains_key(&tile));
    }

    /// Leaves out what does not fit even at the coarsest: then not even all roots do.
    fn fit(&mut self, capacity_bytes: u64) {
        let (index, mut total) = (&self.index, 0);
        self.wanted.tiles.retain(|wanted| {
            let bytes = index.size(wanted.node.chart).map_or(0, tile_bytes);
            let fits = total + bytes <= capacity_bytes;
            total += if fits { bytes } else { 0 };
            fits
        });
    }

    /// The next tile to decode, room being made for it within `capacity_bytes`.
    pub fn next_task(&mut self, now: f64, capacity_bytes: u64) -> Option<(TileId, ImageTask)> {
        while let Some(tile) = self.stream.first_arrived() {
            let wanted = self
                .places
                .get(&tile)
                .and_then(|place| self.wanted.tiles.get(*place));
            let chart = wanted.map(|wanted| wanted.node.chart);
            let Some((chart, size)) =
                chart.and_then(|chart| Some((chart, self.index.size(chart)?)))
            else {
                self.stream.forget(tile);
                continue;
            };
            if !self.store.reserve(tile, size, capacity_bytes, &self.pinned) {
                return None;
            }
            let frame = self.stream.begin_decoding(tile);
            match self.index.task(chart, tile, frame) {
                Ok(task) => return Some((tile, task)),
                Err(error) => self.fail(now, tile, &error.to_string()),
            }
        }
        None
    }

    /// Takes what came of a tile; whether the picture changes. Dropped where it is not wanted any more.
    pub fn take_in(&mut self, now: f64, tile: TileId, decoded: Result<Vec<Mip>, String>) -> bool {
        if !self.places.contains_key(&tile) {
            self.let_go(tile);
            return false;
        }
        match decoded {
            Err(reason) => self.fail(now, tile, &reason),
            Ok(mips) => {
                self.store.insert(tile, mips, now);
                self.stream.end_decoding(tile);
                self.stream.succeed(Item::Tile(tile));
                self.fetched += 1;
                self.changed_at = now;
                return true;
            }
        }
        false
    }

    fn fail(&mut self, now: f64, tile: TileId, reason: &str) {
        self.let_go(tile);
        let words = format!("colour tile {}: {reason}", tile.0);
        self.stream.fail(now, &[Item::Tile(tile)], words);
    }

    fn let_go(&mut self, tile: TileId) {
        self.store.release(tile);
        self.stream.end_decoding(tile);
    }

    /// What to fetch now. `spare` requests are left by the pages.
    pub fn schedule(&mut self, now: f64, spare: usize) -> Vec<Request> {
        let mut missing: Vec<&WantedTile> = self.missing().collect();
        missing.sort_by(|a, b| {
            b.importance_px
                .total_cmp(&a.importance_px)
                .then_with(|| a.tile.cmp(&b.tile))
        });
        let tiles: Vec<TileId> = missing.into_iter().map(|wanted| wanted.tile).collect();
        let limit = spare.max(LEAST_REQUESTS);
        self.stream
            .schedule(now, limit, &self.index, &self.wanted.blocks, &tiles)
    }

    /// Takes the answer to a request of this layer; whether there is something new to plan.
    pub fn deliver(&mut self, now: f64, id: RequestId, answer: Result<Vec<u8>, String>) -> bool {
        let Some((item, bytes)) = self.stream.deliver(now, &self.index, id, answer) else {
            // It may have failed, and nobody wait for it any more.
            let places = &self.places;
            self.stream.want_only(|tile| places.contains_key(&tile));
            return false;
        };
        let taken = match item {
            Item::Directory => self.index.load_directory(&bytes),
            Item::Block(block) => self.index.load_block(block, &bytes),
            Item::Tile(_) => Ok(()),
        };
        match taken {
            Ok(()) => self.stream.succeed(item),
            Err(error) => self.stream.fail(now, &[item], error.to_string()),
        }
        true
    }

    /// Starts the map of a new picture.
    pub fn clear_map(&mut self) {
        self.map.entries.clear();
    }

    /// Adds what a drawn node shows to the map.
    pub fn add_to_map(&mut self, node: NodeId, now: f64, fade_seconds: f64) -> MapPlace {
        let mut map = std::mem::take(&mut self.map);
        let shown = Shown {
            index: &self.index,
            store: &self.store,
            is_wanted: |tile| self.places.contains_key(&tile),
            now,
            fade_seconds,
        };
        let place = shown.add(&mut map, node);
        self.map = map;
        place
    }

    /// The map of the present picture.
    pub fn map(&self) -> &TileMap {
        &self.map
    }

    /// Whether tiles are still fading in.
    pub fn is_fading(&self, now: f64, fade_seconds: f64) -> bool {
        now - self.changed_at <= fade_seconds
    }

    /// Whether nothing that the view wants is missing.
    pub fn is_complete(&self) -> bool {
        self.index.has_directory()
            && self.wanted.blocks.is_empty()
            && self.missing().next().is_none()
    }

    /// Whether tiles wait to be decoded.
    pub fn has_arrived(&self) -> bool {
        self.stream.has_arrived()
    }

    /// Whether something that failed is waiting to be asked for again.
    pub fn is_pausing(&self) -> bool {
        self.stream.is_pausing()
    }

    /// Tiles wanted, and how many of them are missing.
    pub fn progress(&self) -> (usize, usize) {
        let unknown = self.wanted.blocks.len() + usize::from(!self.index.has_directory());
        (
            self.wanted.tiles.len() + unknown,
            self.missing().count() + unknown,
        )
    }

    /// Failures in words, oldest first.
    pub fn take_failures(&mut self) -> Vec<String> {
        self.stream.take_failures()
    }

    /// Uploads since this was last called.
    pub fn take_uploads(&mut self) -> Vec<TileUpload> {
        self.store.take_uploads()
    }

    /// Layers that the texture needs.
    pub fn layers(&self) -> u32 {
        self.store.layers()
    }

    /// What it took.
    pub fn stats(&self) -> TileStats {
        TileStats {
            requested: self.stream.requested(),
            fetched: self.fetched,
            bytes: self.stream.received_bytes(),
            missing: self.missing().count() as u64,
            used_bytes: self.store.used_bytes(),
            evictions: self.store.evictions(),
            failures: self.stream.failure_count(),
        }
    }

    fn missing(&self) -> impl Iterator<Item = &WantedTile> {
        self.wanted
            .tiles
            .iter()
            .filter(|wanted| self.store.get(wanted.tile).is_none())
    }
}
