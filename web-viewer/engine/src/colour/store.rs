//! Resident tiles: which slot each has, since when, and which was used longest ago.

use super::slots::{TileSlot, TileSlots};
use super::upload::{LightTables, TileUpload};
use crate::residency::lru::Lru;
use marquetry_format::{TexelSize, TileId, TileTexels};
use std::collections::{HashMap, HashSet};

/// A tile in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resident {
    /// Where its texels are.
    pub slot: TileSlot,
    /// When it came, on the viewer's clock, seconds.
    pub since: f64,
}

/// The tiles in memory.
#[derive(Debug, Default)]
pub struct TileStore {
    slots: TileSlots,
    resident: HashMap<TileId, Resident>,
    lru: Lru<TileId>,
    uploads: Vec<TileUpload>,
    tables: LightTables,
    used_bytes: u64,
    evictions: u64,
}

impl TileStore {
    /// A tile, if it is resident.
    pub fn get(&self, tile: TileId) -> Option<Resident> {
        self.resident.get(&tile).copied()
    }

    /// Marks tiles as used now.
    pub fn touch(&mut self, tiles: impl Iterator<Item = TileId>) {
        for tile in tiles {
            if self.resident.contains_key(&tile) {
                self.lru.touch(tile);
            }
        }
    }

    /// Makes room for `bytes` within `capacity_bytes`, without evicting what is pinned; whether there is room.
    pub fn make_room(&mut self, bytes: u64, capacity_bytes: u64, pinned: &HashSet<TileId>) -> bool {
        while self.used_bytes + bytes > capacity_bytes {
            let oldest = self.lru.oldest_first().find(|tile| !pinned.contains(tile));
            let Some(tile) = oldest else { return false };
            self.lru.remove(tile);
            if let Some(resident) = self.resident.remove(&tile) {
                self.used_bytes -= resident.slot.bytes();
                self.slots.free(resident.slot);
                // What was never drawn need not be uploaded over what comes to its place.
                self.uploads.retain(|upload| upload.slot != resident.slot);
                self.evictions += 1;
            }
        }
        true
    }

    /// Takes a decoded tile; whether there was a slot for it.
    pub fn insert(&mut self, tile: TileId, size: TexelSize, texels: &TileTexels, now: f64) -> bool {
        let Some(slot) = self.slots.allocate(size) else {
            return false;
        };
        self.uploads
            .push(TileUpload::new(slot, texels, &self.tables));
        self.used_bytes += slot.bytes();
        self.resident.insert(tile, Resident { slot, since: now });
        self.lru.touch(tile);
        true
    }

    /// Uploads since this was last called.
    pub fn take_uploads(&mut self) -> Vec<TileUpload> {
        std::mem::take(&mut self.uploads)
    }

    /// Layers that the texture needs.
    pub fn layers(&self) -> u32 {
        self.slots.layers()
    }

    /// Bytes on the GPU.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// Tiles evicted so far.
    pub fn evictions(&self) -> u64 {
        self.evictions
    }
}
