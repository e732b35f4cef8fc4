//! Where tiles lie in the layers of a texture.
//!
//! Layers of [`LAYER_SIZE`]² texels are cut into bands of [`BAND_ROWS`] rows; a band holds squares of one of four sizes, and any size
//! again once all are free. Every square starts at a multiple of 8 texels, so [`MIPS`] mips of it are whole.

use marquetry_format::TexelSize;
use std::collections::BTreeSet;

/// Texels that the edge of a tile is repeated by on each side, stored gutter included: what filtering along a pixel may touch.
pub const MARGIN: u32 = 8;
/// Mips of the texture.
pub const MIPS: u32 = 4;
/// Texels a side of a layer.
pub const LAYER_SIZE: u32 = 1008;
/// Rows of a band.
pub const BAND_ROWS: u32 = 144;
const BANDS_PER_LAYER: u32 = LAYER_SIZE / BAND_ROWS;
/// Sides of squares.
const SIDES: [u32; 4] = [24, 48, 72, 144];
/// Layers that WebGPU guarantees.
pub const MAX_LAYERS: u32 = 256;

/// A square of texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileSlot {
    /// Column of its first texel.
    pub x: u32,
    /// Row of its first texel.
    pub y: u32,
    /// Layer.
    pub layer: u32,
    /// Texels a side.
    pub side: u32,
}

impl TileSlot {
    fn band(self) -> u32 {
        self.layer * BANDS_PER_LAYER + self.y / BAND_ROWS
    }

    /// Bytes on the GPU, mips included.
    pub fn bytes(self) -> u64 {
        bytes_of(self.side)
    }
}

/// Bytes of a square, mips included.
fn bytes_of(side: u32) -> u64 {
    u64::from(side) * u64::from(side) * 4 * 85 / 64
}

/// The smallest square that holds a tile.
fn side_for(size: TexelSize) -> u32 {
    let needed = size.width.max(size.height) + 2 * MARGIN;
    SIDES
        .into_iter()
        .find(|side| *side >= needed)
        .unwrap_or(BAND_ROWS)
}

/// Bytes that a tile takes on the GPU.
pub fn tile_bytes(size: TexelSize) -> u64 {
    bytes_of(side_for(size))
}

#[derive(Debug, Clone)]
struct Band {
    free: Vec<u32>,
    total: usize,
}

/// Hands out slots.
#[derive(Debug, Clone, Default)]
pub struct TileSlots {
    bands: Vec<Option<Band>>,
    /// Bands with a free square, by side.
    open: BTreeSet<(u32, u32)>,
    empty: Vec<u32>,
}

impl TileSlots {
    /// A free slot for a tile; `None` when all layers are full.
    pub fn allocate(&mut self, size: TexelSize) -> Option<TileSlot> {
        let side = side_for(size);
        let open = self.open.range((side, 0)..=(side, u32::MAX)).next();
        let index = match open.map(|(_, band)| *band) {
            Some(band) => band,
            None => self.new_band(side)?,
        };
        let band = self.bands.get_mut(usize::try_from(index).ok()?)?.as_mut()?;
        let number = band.free.pop()?;
        if band.free.is_empty() {
            self.open.remove(&(side, index));
        }
        let across = LAYER_SIZE / side;
        Some(TileSlot {
            x: number % across * side,
            y: index % BANDS_PER_LAYER * BAND_ROWS + number / across * side,
            layer: index / BANDS_PER_LAYER,
            side,
        })
    }

    /// Gives a slot back.
    pub fn free(&mut self, slot: TileSlot) {
        let index = slot.band();
        let place = usize::try_from(index)
            .ok()
            .and_then(|index| self.bands.get_mut(index));
        let Some(place) = place else { return };
        let Some(band) = place.as_mut() else { return };
        let across = LAYER_SIZE / slot.side;
        band.free
            .push(slot.y % BAND_ROWS / slot.side * across + slot.x / slot.side);
        self.open.insert((slot.side, index));
        if band.free.len() == band.total {
            *place = None;
            self.open.remove(&(slot.side, index));
            self.empty.push(index);
        }
    }

    /// Layers in use so far; never shrinks.
    pub fn layers(&self) -> u32 {
        u32::try_from(self.bands.len())
            .unwrap_or(u32::MAX)
            .div_ceil(BANDS_PER_LAYER)
    }

    fn new_band(&mut self, side: u32) -> Option<u32> {
        let index = self.empty.pop().or_else(|| {
            let new = u32::try_from(self.bands.len())
                .ok()
                .filter(|n| *n < MAX_LAYERS * BANDS_PER_LAYER)?;
            self.bands.push(None);
            Some(new)
        })?;
        let free: Vec<u32> = (0..(LAYER_SIZE / side) * (BAND_ROWS / side))
            .rev()
            .collect();
        let total = free.len();
        *self.bands.get_mut(usize::try_from(index).ok()?)? = Some(Band { free, total });
        self.open.insert((side, index));
        Some(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn slots_never_overlap_and_have_whole_mips() {
        let mut random = Random::new(5);
        let mut slots = TileSlots::default();
        let mut held: Vec<TileSlot> = Vec::new();
        for round in 0..3000 {
            if round > 1500 && random.below(3) > 0 && !held.is_empty() {
                let count = u32::try_from(held.len()).unwrap();
                slots.free(held.swap_remove(random.below(count) as usize));
            } else {
                let [width, height] = [0; 2].map(|_: u32| 8 + 8 * random.below(16));
                held.push(slots.allocate(TexelSize { width, height }).unwrap());
            }
        }
        for (k, a) in held.iter().enumerate() {
            assert!(a.x + a.side <= LAYER_SIZE && a.y + a.side <= LAYER_SIZE);
            assert_eq!((a.x | a.y | a.side) % (1 << (MIPS - 1)), 0);
            for b in &held[..k] {
                let apart = a.layer != b.layer
                    || a.x + a.side <= b.x
                    || b.x + b.side <= a.x
                    || a.y + a.side <= b.y
                    || b.y + b.side <= a.y;
                assert!(apart, "{a:?} {b:?}");
            }
        }
    }
}
