//! Resident tiles: which slot each has, since when, and which was used longest ago.

use super::slots::{TileSlot, TileSlots, tile_bytes};
use super::upload::{Mip, TileUpload};
use crate::residency::ids::{IdMap, IdSet};
use crate::residency::lru::Lru;
use marquetry_format::{TexelSize, TileId};

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
    resident: IdMap<TileId, Resident>,
    /// Slots of tiles that are being decoded.
    reserved: IdMap<TileId, TileSlot>,
    lru: Lru<TileId>,
    uploads: Vec<TileUpload>,
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
            self.lru.touch_known(tile);
        }
    }

    /// Makes room within `capacity_bytes` for a tile that is to be decoded, without evicting what is pinned; whether there
    /// is room.
    pub fn reserve(
        &mut self,
        tile: TileId,
        size: TexelSize,
        capacity_bytes: u64,
        pinned: &IdSet<TileId>,
    ) -> bool {
        if !self.make_room(tile_bytes(size), capacity_bytes, pinned) {
            return false;
        }
        let Some(slot) = self.slots.allocate(size) else {
            return false;
        };
        self.used_bytes += slot.bytes();
        self.reserved.insert(tile, slot);
        true
    }

    /// Gives up the room of a tile that is not to come.
    pub fn release(&mut self, tile: TileId) {
        if let Some(slot) = self.reserved.remove(&tile) {
            self.used_bytes -= slot.bytes();
            self.slots.free(slot);
        }
    }

    fn make_room(&mut self, bytes: u64, capacity_bytes: u64, pinned: &IdSet<TileId>) -> bool {
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

    /// Takes a decoded tile to the room that was reserved for it.
    pub fn insert(&mut self, tile: TileId, mips: Vec<Mip>, now: f64) {
        let Some(slot) = self.reserved.remove(&tile) else {
            return;
        };
        self.uploads.push(TileUpload { slot, mips });
        self.resident.insert(tile, Resident { slot, since: now });
        self.lru.touch(tile);
    }

    /// Uploads since this was last called.
    pub fn take_uploads(&mut self) -> Vec<TileUpload> {
        std::mem::take(&mut self.uploads)
    }

    /// Layers that the texture needs.
    pub fn layers(&self) -> u32 {
        self.slots.layers()
    }

    /// Bytes on the GPU, those of tiles that are being decoded included.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// Tiles evicted so far.
    pub fn evictions(&self) -> u64 {
        self.evictions
    }
}
