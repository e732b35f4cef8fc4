//! Textures of clusters on the GPU: parts of layers, lent to the clusters that are seen.
//!
//! A part has 256, 128 or 64 texels a side, as many as the picture shows of it. The compressed image stays with its cluster, so
//! a part that is lost costs decoding, not fetching. A part is lent before the image is decoded; until that is done the cluster shows what
//! it did before. A cluster without a part shows the colours of its vertices. Parts are lent in the order
//! in which they are asked for; when there are none left, those are taken back that were seen longest ago, then those that
//! are larger than they need be.

use super::ids::{IdMap, IdSet};
use super::lru::Lru;
use crate::colour::slots::MAX_LAYERS;
use crate::colour::upload::Mip;
use crate::decode::ImageWork;
use marquetry_format::PageId;
use marquetry_format::cluster::ClusterTexture;
use std::collections::BTreeSet;

/// Texels a side of the largest part.
pub const TEXTURE_SIDE: u32 = 256;
/// Largest parts a side of a layer.
pub const TEXTURES_ACROSS: u32 = 8;
/// Largest parts of a layer.
pub const PARTS_A_LAYER: u32 = TEXTURES_ACROSS * TEXTURES_ACROSS;
/// Sizes of parts, each half as long as the one before.
pub const SIZES: u8 = 3;
/// Largest parts that the layers that WebGPU guarantees have.
const MAX_PARTS: u64 = MAX_LAYERS as u64 * PARTS_A_LAYER as u64;
/// Bytes of the largest part, mips included.
pub const TEXTURE_BYTES: u64 = 4 * TEXTURE_SIDE as u64 * TEXTURE_SIDE as u64 * 85 / 64;

/// Bytes of the part that is lent to a cluster whose image is seen with its sides halved so often.
pub fn bytes_of_texture(halvings: u8) -> u64 {
    TEXTURE_BYTES >> (2 * halvings.min(SIZES - 1))
}

/// A part of the textures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Part {
    /// How often its sides are halved.
    pub halvings: u8,
    /// Its number among those of its size: the four of a larger one follow each other.
    number: u32,
}

impl Part {
    /// Column, row and layer of its first texel.
    pub fn corner(self) -> [u32; 3] {
        let largest = self.number >> (2 * self.halvings);
        let place = largest % PARTS_A_LAYER;
        let mut corner =
            [place % TEXTURES_ACROSS, place / TEXTURES_ACROSS].map(|k| k * TEXTURE_SIDE);
        for level in 1..=self.halvings {
            let quarter = self.number >> (2 * (self.halvings - level)) & 3;
            let side = TEXTURE_SIDE >> level;
            corner[0] += (quarter & 1) * side;
            corner[1] += (quarter >> 1) * side;
        }
        [corner[0], corner[1], largest / PARTS_A_LAYER]
    }

    /// As the shader takes it, not 0: corner in steps of the smallest part, layer, halvings.
    pub fn code(self) -> u32 {
        let [x, y, layer] = self.corner();
        let step = TEXTURE_SIDE >> (SIZES - 1);
        1 << 31 | u32::from(self.halvings) << 24 | layer << 16 | (y / step) << 8 | (x / step)
    }

    fn bytes(self) -> u64 {
        bytes_of_texture(self.halvings)
    }
}

/// Hands out parts.
#[derive(Debug, Default)]
struct Parts {
    free: [BTreeSet<u32>; SIZES as usize],
    /// Largest parts in use so far.
    count: u32,
}

impl Parts {
    /// A free part with sides halved so often; `None` where `most` of the largest are in use.
    fn allocate(&mut self, halvings: u8, most: u32) -> Option<Part> {
        let level = usize::from(halvings);
        let number = if let Some(number) = self.free.get_mut(level)?.pop_first() {
            number
        } else if let Some(larger) = halvings.checked_sub(1) {
            let first = 4 * self.allocate(larger, most)?.number;
            self.free.get_mut(level)?.extend(first + 1..first + 4);
            first
        } else {
            if self.count >= most {
                return None;
            }
            self.count += 1;
            self.count - 1
        };
        Some(Part { halvings, number })
    }

    fn free(&mut self, part: Part) {
        let Some(free) = self.free.get_mut(usize::from(part.halvings)) else {
            return;
        };
        free.insert(part.number);
        let first = part.number / 4 * 4;
        if let Some(halvings) = part.halvings.checked_sub(1)
            && (first..first + 4).all(|number| free.contains(&number))
        {
            (first..first + 4).for_each(|number| {
                free.remove(&number);
            });
            self.free(Part {
                halvings,
                number: first / 4,
            });
        }
    }
}

/// The cluster whose mesh a page holds; the root for `None`.
pub type Key = Option<PageId>;

/// What changes on the GPU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TextureChange {
    /// The cluster in this slot shows a part, which gets a new image.
    Shown {
        /// Slot of the cluster.
        slot: u32,
        /// The part.
        part: Part,
        /// Fine to coarse.
        mips: Vec<Mip>,
    },
    /// The cluster in this slot shows the colours of its vertices.
    Gone {
        /// Slot of the cluster.
        slot: u32,
    },
}

/// A cluster that is seen.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Which.
    pub key: Key,
    /// Slot of its mesh.
    pub slot: u32,
    /// How often the sides of its image are halved in the picture; at least the smallest part is lent.
    pub halvings: u8,
    /// Its image.
    pub texture: &'a ClusterTexture,
}

/// Names one decoding of the image of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ticket {
    key: Key,
    number: u64,
}

/// What [`TexturePool::lend`] did.
#[derive(Debug)]
pub struct Lending {
    /// Images to decode for parts that were lent.
    pub(crate) images: Vec<(Ticket, ImageWork)>,
    /// Whether some that are seen still wait.
    pub(crate) waits: bool,
}

#[derive(Debug, Clone, Copy)]
struct Lent {
    part: Part,
    slot: u32,
}

/// The parts, and who has them.
#[derive(Debug, Default)]
pub struct TexturePool {
    parts: Parts,
    lent: IdMap<Key, Lent>,
    /// Who gets a part when its image is decoded, and the number of that decoding.
    decoding: IdMap<Key, (u64, Lent)>,
    next_number: u64,
    lru: Lru<Key>,
    /// Whose images do not decode.
    damaged: IdSet<Key>,
    failures: Vec<String>,
    changes: Vec<TextureChange>,
    used_bytes: u64,
}

impl TexturePool {
    /// Whether a texture has a part that is large enough, or will have none, as its image does not decode.
    pub fn is_served(&self, key: Key, halvings: u8) -> bool {
        let lent = self.lent.get(&key);
        lent.is_some_and(|lent| lent.part.halvings <= halvings.min(SIZES - 1))
            || self.damaged.contains(&key)
    }

    /// Marks a texture as used, where it has a part.
    pub fn touch(&mut self, key: Key) {
        self.lru.touch_known(key);
    }

    /// Lends parts that are large enough to those of `seen` that have none, `most` of them now, within `capacity_bytes`.
    pub fn lend(&mut self, seen: &[Seen<'_>], capacity_bytes: u64, most: usize) -> Lending {
        let wanted: IdMap<Key, u8> = seen
            .iter()
            .map(|seen| (seen.key, seen.halvings.min(SIZES - 1)))
            .collect();
        for key in seen.iter().map(|seen| seen.key) {
            self.lru.touch_known(key);
        }
        let capacity = (capacity_bytes / TEXTURE_BYTES).min(MAX_PARTS);
        let capacity = u32::try_from(capacity).unwrap_or(u32::MAX);
        let mut images = Vec::new();
        for seen in seen {
            let halvings = seen.halvings.min(SIZES - 1);
            let has = self.lent.get(&seen.key).map(|lent| lent.part.halvings);
            if has.is_some_and(|has| has <= halvings)
                || self.decoding.contains_key(&seen.key)
                || self.damaged.contains(&seen.key)
            {
                continue;
            }
            if images.len() == most {
                let waits = true;
                return Lending { images, waits };
            }
            // A smaller one is better than none.
            let smallest = if has.is_none() { SIZES } else { halvings + 1 };
            let part = (halvings..smallest).find_map(|size| self.part(size, capacity, &wanted));
            let Some(part) = part else {
                if has.is_some() {
                    continue;
                }
                break;
            };
            match seen.texture.task() {
                Ok(task) => {
                    let work = ImageWork {
                        task,
                        margin: 0,
                        skipped: part.halvings,
                    };
                    images.push((self.begin(seen, part), work));
                }
                Err(error) => {
                    self.parts.free(part);
                    self.give_up(seen.key, &error.to_string());
                }
            }
        }
        let waits = !self.decoding.is_empty();
        Lending { images, waits }
    }

    fn begin(&mut self, seen: &Seen<'_>, part: Part) -> Ticket {
        let (key, slot, number) = (seen.key, seen.slot, self.next_number);
        self.next_number += 1;
        self.used_bytes += part.bytes();
        self.decoding.insert(key, (number, Lent { part, slot }));
        Ticket { key, number }
    }

    /// Takes what came of an image. Dropped where its cluster has left meanwhile.
    pub fn finish(&mut self, ticket: Ticket, decoded: Result<Vec<Mip>, String>) {
        let Ticket { key, number } = ticket;
        let Some((_, lent)) = self.decoding.get(&key).filter(|(own, _)| *own == number) else {
            return;
        };
        let lent @ Lent { part, slot } = *lent;
        self.decoding.remove(&key);
        match decoded {
            Ok(mips) => {
                // Where it had a smaller one.
                self.give_back(key);
                self.changes.push(TextureChange::Shown { slot, part, mips });
                self.lent.insert(key, lent);
                self.lru.touch(key);
            }
            Err(reason) => {
                self.used_bytes -= part.bytes();
                self.parts.free(part);
                self.give_up(key, &reason);
            }
        }
    }

    /// Notes that an image does not decode.
    fn give_up(&mut self, key: Key, reason: &str) {
        let page = key.map_or_else(|| "the front".to_owned(), |page| format!("page {}", page.0));
        self.failures.push(format!("{page}: {reason}"));
        self.damaged.insert(key);
    }

    /// A part with sides halved so often, if need be of what others give back: who is not `wanted`, then who has more than wanted.
    fn part(&mut self, halvings: u8, capacity: u32, wanted: &IdMap<Key, u8>) -> Option<Part> {
        loop {
            if let Some(part) = self.parts.allocate(halvings, capacity) {
                return Some(part);
            }
            let too_large = |key: &Key| {
                let has = self.lent.get(key).map(|lent| lent.part.halvings);
                has.zip(wanted.get(key))
                    .is_some_and(|(has, wanted)| has < *wanted)
            };
            let victim = self
                .lru
                .oldest_first()
                .find(|key| !wanted.contains_key(key))
                .or_else(|| self.lru.oldest_first().find(too_large))?;
            if let Some(lent) = self.give_back(victim) {
                self.changes.push(TextureChange::Gone { slot: lent.slot });
            }
        }
    }

    fn give_back(&mut self, key: Key) -> Option<Lent> {
        self.lru.remove(key);
        let lent = self.lent.remove(&key)?;
        self.used_bytes -= lent.part.bytes();
        self.parts.free(lent.part);
        Some(lent)
    }

    /// The mesh of a cluster has left its slot.
    pub fn forget(&mut self, key: Key) {
        if let Some((_, Lent { part, .. })) = self.decoding.remove(&key) {
            self.used_bytes -= part.bytes();
            self.parts.free(part);
        }
        if let Some(lent) = self.give_back(key) {
            // What comes to the slot next must not get what was meant for this one.
            self.changes.retain(|change| match change {
                TextureChange::Shown { slot, .. } | TextureChange::Gone { slot } => {
                    *slot != lent.slot
                }
            });
        }
    }

    /// Whether there are changes to take.
    pub fn has_changes(&self) -> bool {
        !self.changes.is_empty()
    }

    /// Changes since this was last called, in order.
    pub fn take_changes(&mut self) -> Vec<TextureChange> {
        std::mem::take(&mut self.changes)
    }

    /// What could not be decoded since this was last called, in words.
    pub fn take_failures(&mut self) -> Vec<String> {
        std::mem::take(&mut self.failures)
    }

    /// Largest parts in use so far; never shrinks.
    pub fn count(&self) -> u32 {
        self.parts.count
    }

    /// Bytes of the parts that are lent, also those whose images are being decoded.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture() -> ClusterTexture {
        ClusterTexture {
            places: vec![[0, 0]; 3],
            frame: include_bytes!("../../../../format/tests/data/texture_16x24.vp8").to_vec(),
        }
    }

    fn seen<'a>(pages: &[u32], texture: &'a ClusterTexture) -> Vec<Seen<'a>> {
        let one = |&page: &u32| Seen {
            key: Some(PageId(page)),
            slot: 100 + page,
            halvings: 0,
            texture,
        };
        pages.iter().map(one).collect()
    }

    /// Lends and decodes at once.
    fn show(pool: &mut TexturePool, seen: &[Seen<'_>], capacity: u64, most: usize) -> bool {
        let Lending { images, waits } = pool.lend(seen, capacity, most);
        for (ticket, work) in images {
            pool.finish(ticket, work.run().map_err(|error| error.to_string()));
        }
        waits
    }

    fn shown(pool: &mut TexturePool) -> Vec<(u32, Option<u32>)> {
        let change = |change| match change {
            TextureChange::Shown { slot, part, mips } => {
                assert_eq!((mips[0].width, mips[0].height, mips.len()), (16, 24, 4));
                assert_eq!(part.halvings, 0);
                (slot, Some(part.number))
            }
            TextureChange::Gone { slot } => (slot, None),
        };
        pool.take_changes().into_iter().map(change).collect()
    }

    #[test]
    fn those_seen_longest_ago_give_way() {
        let texture = texture();
        let mut pool = TexturePool::default();
        let capacity = 3 * TEXTURE_BYTES;
        assert!(show(&mut pool, &seen(&[1, 2, 3], &texture), capacity, 2));
        assert!(show(&mut pool, &seen(&[1, 2, 3], &texture), capacity, 2));
        assert!(!show(&mut pool, &seen(&[1, 2, 3], &texture), capacity, 2));
        assert_eq!(
            shown(&mut pool),
            [(101, Some(0)), (102, Some(1)), (103, Some(2))]
        );
        assert!(show(&mut pool, &seen(&[2, 3, 4], &texture), capacity, 9));
        assert_eq!(shown(&mut pool), [(101, None), (104, Some(0))]);
        // More are seen than there are parts: nothing moves to and fro.
        for _ in 0..3 {
            assert!(!show(
                &mut pool,
                &seen(&[2, 3, 4, 5, 6], &texture),
                capacity,
                9
            ));
            assert_eq!(shown(&mut pool), []);
        }
        assert_eq!(pool.used_bytes(), capacity);
    }

    #[test]
    fn a_mesh_that_leaves_takes_its_texture_along() {
        let texture = texture();
        let mut pool = TexturePool::default();
        show(&mut pool, &seen(&[1, 2], &texture), u64::MAX, 9);
        pool.forget(Some(PageId(1)));
        pool.forget(Some(PageId(7)));
        assert_eq!(shown(&mut pool), [(102, Some(1))]);
        show(&mut pool, &seen(&[2, 1], &texture), u64::MAX, 9);
        assert_eq!(shown(&mut pool), [(101, Some(0))]);
        assert_eq!(pool.count(), 2);
    }

    #[test]
    fn small_parts_share_the_room_of_a_large_one() {
        let texture = texture();
        let mut pool = TexturePool::default();
        let pages: Vec<u32> = (0..17).collect();
        let mut small = seen(&pages, &texture);
        for seen in &mut small {
            seen.halvings = 5;
        }
        assert!(show(&mut pool, &small, TEXTURE_BYTES, 99));
        assert!(!show(&mut pool, &small, TEXTURE_BYTES, 99));
        let mut corners = Vec::new();
        for change in pool.take_changes() {
            let TextureChange::Shown { part, mips, .. } = change else {
                panic!("all fit");
            };
            assert_eq!((part.halvings, mips[0].width, mips.len()), (2, 4, 2));
            corners.push(part.corner());
            let code = part.code();
            let read = [
                code & 0xff,
                code >> 8 & 0xff,
                code >> 16 & 0xff,
                code >> 24 & 3,
            ];
            assert_eq!(read, [part.corner()[0] / 64, part.corner()[1] / 64, 0, 2]);
        }
        corners.sort_unstable();
        let expected = (0..16).map(|k| [k / 4 * 64, k % 4 * 64, 0]);
        assert_eq!(corners, expected.collect::<Vec<_>>());
        assert_eq!(pool.used_bytes(), TEXTURE_BYTES);
        // One comes near, and gets a large part of what is free or not seen.
        let large = seen(&[3], &texture);
        assert!(show(&mut pool, &large, 2 * TEXTURE_BYTES, 99));
        let last = pool.take_changes().pop();
        assert!(
            matches!(last, Some(TextureChange::Shown { slot: 103, part, .. }) if part.halvings == 0)
        );
        // It goes away again, and what is too large for it is taken back for others.
        let mut many = seen(&(0..32).collect::<Vec<_>>(), &texture);
        for seen in &mut many {
            seen.halvings = 2;
        }
        while show(&mut pool, &many, 2 * TEXTURE_BYTES, 99) {}
        assert!(!show(&mut pool, &many, 2 * TEXTURE_BYTES, 99));
        assert_eq!(pool.lent.len(), 32);
        assert_eq!(pool.used_bytes(), 2 * TEXTURE_BYTES);
    }

    #[test]
    fn damage_is_reported_once_and_costs_nothing() {
        let damaged = ClusterTexture {
            places: Vec::new(),
            frame: vec![0; 40],
        };
        let mut pool = TexturePool::default();
        for _ in 0..2 {
            assert!(!show(&mut pool, &seen(&[1], &damaged), TEXTURE_BYTES, 9));
        }
        assert_eq!(pool.take_failures().len(), 1);
        let whole = texture();
        assert!(show(&mut pool, &seen(&[2], &whole), TEXTURE_BYTES, 9));
        assert_eq!(shown(&mut pool), [(102, Some(0))]);
    }
}
