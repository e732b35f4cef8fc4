//! What goes to the GPU, and where in the sample textures it goes.
//!
//! The textures are layers of [`LAYER_SIZE`]² texels, cut into bands of [`BAND_ROWS`] rows. A band holds squares of one
//! size, so that small root pages do not take the room of full ones; a band whose squares are all free serves any size
//! again. At most half of a band is lost (17² squares), one row in 34 for full pages.

use crate::lod::cluster::target::Targets;
use marquetry_format::{ClusterMesh, PageSamples};
use std::collections::BTreeSet;

/// Texels a side of one layer.
pub const LAYER_SIZE: u32 = 1024;
/// Rows of a band: one row of 33² squares, two of 17², …
pub const BAND_ROWS: u32 = 34;
const BANDS_PER_LAYER: u32 = LAYER_SIZE / BAND_ROWS;
/// Layers that WebGPU guarantees.
pub const MAX_LAYERS: u32 = 256;

/// Bytes of one sample on the GPU: position with target, normal with target.
pub const SAMPLE_BYTES: u64 = 20;
/// The same with colour and target.
pub const COLOURED_SAMPLE_BYTES: u64 = 28;

/// A square of texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Slot {
    /// Column of its first texel.
    pub x: u32,
    /// Row of its first texel.
    pub y: u32,
    /// Layer.
    pub layer: u32,
    /// log2 of the cells a side; 2^resolution + 1 texels.
    pub resolution: u8,
}

impl Slot {
    /// Texels a side.
    pub fn side(self) -> u32 {
        (1 << self.resolution) + 1
    }

    fn band(self) -> u32 {
        self.layer * BANDS_PER_LAYER + self.y / BAND_ROWS
    }
}

#[derive(Debug, Clone)]
struct Band {
    /// Free squares, by number; the last is taken first.
    free: Vec<u32>,
    total: usize,
}

/// Hands out slots.
#[derive(Debug, Clone, Default)]
pub struct SlotAllocator {
    bands: Vec<Option<Band>>,
    /// Bands with a free square, by resolution.
    open: BTreeSet<(u8, u32)>,
    empty: Vec<u32>,
}

impl SlotAllocator {
    /// A free slot of that resolution (0..=5); `None` when the textures are full.
    pub fn allocate(&mut self, resolution: u8) -> Option<Slot> {
        let open = self
            .open
            .range((resolution, 0)..=(resolution, u32::MAX))
            .next()
            .map(|(_, band)| *band);
        let index = match open {
            Some(band) => band,
            None => self.new_band(resolution)?,
        };
        let band = self.bands.get_mut(usize::try_from(index).ok()?)?.as_mut()?;
        let number = band.free.pop()?;
        if band.free.is_empty() {
            self.open.remove(&(resolution, index));
        }
        let side = (1 << resolution) + 1;
        let across = LAYER_SIZE / side;
        Some(Slot {
            x: number % across * side,
            y: index % BANDS_PER_LAYER * BAND_ROWS + number / across * side,
            layer: index / BANDS_PER_LAYER,
            resolution,
        })
    }

    /// Gives a slot back.
    pub fn free(&mut self, slot: Slot) {
        let index = slot.band();
        let Some(place) = usize::try_from(index)
            .ok()
            .and_then(|index| self.bands.get_mut(index))
        else {
            return;
        };
        let Some(band) = place.as_mut() else { return };
        let across = LAYER_SIZE / slot.side();
        band.free
            .push(slot.y % BAND_ROWS / slot.side() * across + slot.x / slot.side());
        self.open.insert((slot.resolution, index));
        if band.free.len() == band.total {
            *place = None;
            self.open.remove(&(slot.resolution, index));
            self.empty.push(index);
        }
    }

    /// Layers in use so far; never shrinks.
    pub fn layers(&self) -> u32 {
        u32::try_from(self.bands.len())
            .unwrap_or(u32::MAX)
            .div_ceil(BANDS_PER_LAYER)
    }

    fn new_band(&mut self, resolution: u8) -> Option<u32> {
        let index = self.empty.pop().or_else(|| {
            let new = u32::try_from(self.bands.len())
                .ok()
                .filter(|n| *n < MAX_LAYERS * BANDS_PER_LAYER)?;
            self.bands.push(None);
            Some(new)
        })?;
        let side = (1u32 << resolution) + 1;
        let free: Vec<u32> = (0..(LAYER_SIZE / side) * (BAND_ROWS / side))
            .rev()
            .collect();
        let total = free.len();
        *self.bands.get_mut(usize::try_from(index).ok()?)? = Some(Band { free, total });
        self.open.insert((resolution, index));
        Some(index)
    }
}

/// Samples as texels, row by row, on their way to a slot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Upload {
    /// Where they go.
    pub slot: Slot,
    /// Position and target, 3×21 bits each.
    pub positions: Vec<[u32; 4]>,
    /// Normal in the low half, target in the high half.
    pub normals: Vec<u32>,
    /// Colour and target, one byte a channel from the lowest; empty when the file has none.
    pub colours: Vec<[u32; 2]>,
}

impl Upload {
    /// Packs `samples` for `slot`, which has their resolution.
    pub fn pack(slot: Slot, samples: &PageSamples) -> Self {
        let positions =
            samples
                .positions
                .iter()
                .zip(&samples.position_targets)
                .map(|(own, target)| {
                    let ([a, b], [c, d]) = (pack_point(*own), pack_point(*target));
                    [a, b, c, d]
                });
        let normals = samples.normals.iter().zip(&samples.normal_targets);
        let colours = samples.colours.iter().zip(&samples.colour_targets);
        let pack_colour = |[r, g, b]: [u8; 3]| u32::from_le_bytes([r, g, b, 0]);
        Self {
            slot,
            positions: positions.collect(),
            normals: normals
                .map(|([a, b], [c, d])| u32::from_le_bytes([*a, *b, *c, *d]))
                .collect(),
            colours: colours
                .map(|(own, target)| [pack_colour(*own), pack_colour(*target)])
                .collect(),
        }
    }
}

/// 3×21 bits in two words: x in bits 0..21, y in 21..42, z in 42..63.
pub fn pack_point([x, y, z]: [u32; 3]) -> [u32; 2] {
    [x | y << 21, y >> 11 | z << 10]
}

/// Vertices that a cluster's slot has room for, and triangles.
pub const CLUSTER_VERTICES: u32 = 256;
/// Corners that a cluster's slot has room for.
pub const CLUSTER_CORNERS: u32 = 3 * 256;
/// Bytes of a vertex on its way to a slot: what it is, and what it is on the surface that its group takes the place of.
pub const CLUSTER_VERTEX_BYTES: u64 = 32;
/// Bytes of a cluster's slot (vertices with the number of their texture, corners, and the ends of lines, two a corner) and of what is kept for picking
/// and for children to move to.
pub const CLUSTER_SLOT_BYTES: u64 = (CLUSTER_VERTEX_BYTES + 4 + 12 + 2 + 3)
    * CLUSTER_VERTICES as u64
    + 4 * CLUSTER_CORNERS as u64
    + 8 * CLUSTER_CORNERS as u64
    + CLUSTER_CORNERS as u64;
/// Slots that buffers of the size that WebGPU guarantees have room for.
pub const MAX_CLUSTER_SLOTS: u32 = 1 << 14;

/// A cluster on its way to its slot, filled up with triangles without extent so that neighbouring slots are drawn as one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClusterUpload {
    /// Number of the slot.
    pub slot: u32,
    /// Position (two words, as in an [`Upload`]), normal with the level and the column on the texture above it, colour with the row;
    /// then position, normal and colour of the target.
    pub vertices: Vec<[u32; 8]>,
    /// Corners, numbered over all slots.
    pub corners: Vec<u32>,
    /// Ends of lines, numbered alike.
    pub line_ends: Vec<u32>,
}

impl ClusterUpload {
    /// Packs `mesh`, a node of that level, for `slot`; vertices without a target stay where they are.
    pub fn pack(slot: u32, level: u8, mesh: &ClusterMesh, targets: &Targets) -> Self {
        let places = mesh.texture.as_ref().map(|texture| &texture.places);
        let first = slot * CLUSTER_VERTICES;
        let vertices = mesh.positions.iter().zip(&mesh.normals).enumerate();
        let vertices = vertices
            .map(|(index, (point, [a, b]))| {
                let [low, high] = pack_point(*point);
                let [red, green, blue] = mesh.colours.get(index).copied().unwrap_or([255; 3]);
                let place = places.and_then(|places| places.get(index)).copied();
                let [column, row] = place.unwrap_or_default();
                let target = targets.positions.get(index).unwrap_or(point);
                let [target_low, target_high] = pack_point(*target);
                let [c, d] = targets.normals.get(index).copied().unwrap_or([*a, *b]);
                let colour = targets.colours.get(index).copied();
                let [target_red, target_green, target_blue] = colour.unwrap_or([red, green, blue]);
                [
                    low,
                    high,
                    u32::from_le_bytes([*a, *b, level, column]),
                    u32::from_le_bytes([red, green, blue, row]),
                    target_low,
                    target_high,
                    u32::from_le_bytes([c, d, 0, 0]),
                    u32::from_le_bytes([target_red, target_green, target_blue, 0]),
                ]
            })
            .collect();
        let room = usize::try_from(CLUSTER_CORNERS).unwrap_or(usize::MAX);
        let mut corners: Vec<u32> = mesh
            .triangles
            .as_flattened()
            .iter()
            .map(|corner| first + u32::from(*corner))
            .collect();
        let mut line_ends: Vec<u32> = corners
            .chunks_exact(3)
            .flat_map(|t| [t[0], t[1], t[1], t[2], t[2], t[0]])
            .collect();
        corners.resize(room, first);
        line_ends.resize(2 * room, first);
        Self {
            slot,
            vertices,
            corners,
            line_ends,
        }
    }
}

/// Hands out the slots of clusters, the lowest first, so that runs of neighbours form.
#[derive(Debug, Clone, Default)]
pub struct ClusterSlots {
    free: BTreeSet<u32>,
    used: u32,
}

impl ClusterSlots {
    /// A free slot; `None` where the buffers are full.
    pub fn allocate(&mut self) -> Option<u32> {
        self.free.pop_first().or_else(|| {
            let slot = self.used;
            (slot < MAX_CLUSTER_SLOTS).then(|| {
                self.used += 1;
                slot
            })
        })
    }

    /// Gives a slot back.
    pub fn free(&mut self, slot: u32) {
        self.free.insert(slot);
    }

    /// Slots in use so far; never shrinks.
    pub fn count(&self) -> u32 {
        self.used
    }
}

/// The inverse of [`pack_point`].
pub fn unpack_point([low, high]: [u32; 2]) -> [u32; 3] {
    const MASK: u32 = (1 << 21) - 1;
    [
        low & MASK,
        low >> 21 | (high & 0x3ff) << 11,
        high >> 10 & MASK,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use std::collections::HashSet;

    #[test]
    fn points_survive_packing() {
        let mut random = Random::new(4);
        let extremes = [
            [0; 3],
            [(1 << 21) - 1; 3],
            [(1 << 21) - 1, 0, (1 << 21) - 1],
            [0, (1 << 21) - 1, 0],
        ];
        let others = (0..1000).map(|_| [0; 3].map(|_: u32| random.below(1 << 21)));
        for point in extremes.into_iter().chain(others.collect::<Vec<_>>()) {
            assert_eq!(unpack_point(pack_point(point)), point);
        }
    }

    #[test]
    fn slots_never_overlap_and_stay_inside() {
        let mut random = Random::new(8);
        let mut allocator = SlotAllocator::default();
        let mut held: Vec<Slot> = Vec::new();
        for round in 0..3000 {
            if round > 1500 && random.below(3) > 0 && !held.is_empty() {
                allocator.free(
                    held.swap_remove(random.below(u32::try_from(held.len()).unwrap()) as usize),
                );
            } else {
                held.push(
                    allocator
                        .allocate(u8::try_from(random.below(6)).unwrap())
                        .unwrap(),
                );
            }
        }
        let mut texels = HashSet::new();
        for slot in &held {
            assert!(slot.x + slot.side() <= LAYER_SIZE && slot.y + slot.side() <= LAYER_SIZE);
            for n in 0..slot.side() * slot.side() {
                assert!(texels.insert((
                    slot.layer,
                    slot.x + n % slot.side(),
                    slot.y + n / slot.side()
                )));
            }
        }
    }

    #[test]
    fn a_freed_band_serves_another_size() {
        let mut allocator = SlotAllocator::default();
        let full: Vec<Slot> = (0..31).map(|_| allocator.allocate(5).unwrap()).collect();
        assert!(full.iter().all(|slot| slot.band() == 0));
        for slot in full {
            allocator.free(slot);
        }
        assert_eq!(allocator.allocate(2).unwrap().band(), 0);
        assert_eq!(allocator.layers(), 1);
    }
}
