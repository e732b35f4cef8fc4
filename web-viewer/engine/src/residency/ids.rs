//! Maps and sets by the number of a page, tile or slot.
//!
//! They are looked into tens of thousands of times a frame, and nobody chooses the numbers to collide: a multiplication
//! spreads them well enough, at a fraction of what the standard hash takes.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

/// A map by number.
pub type IdMap<K, V> = HashMap<K, V, BuildHasherDefault<IdHasher>>;
/// A set of numbers.
pub type IdSet<K> = HashSet<K, BuildHasherDefault<IdHasher>>;

/// 2^64 over the golden ratio, odd.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// Hashes a number, or a few.
#[derive(Debug, Clone, Copy, Default)]
pub struct IdHasher(u64);

impl Hasher for IdHasher {
    fn finish(&self) -> u64 {
        // Tables take their place from the low bits, which a product mixes least.
        self.0.rotate_left(26)
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }

    fn write_u32(&mut self, number: u32) {
        self.write_u64(u64::from(number));
    }

    fn write_u64(&mut self, number: u64) {
        self.0 = (self.0.rotate_left(5) ^ number).wrapping_mul(FACTOR);
    }

    fn write_isize(&mut self, number: isize) {
        self.write_u64(number.cast_unsigned() as u64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hash::BuildHasher;

    /// Filled as a table of 2^16 places would be, at half load.
    #[test]
    fn neighbours_and_strides_spread_over_the_table() {
        let hasher = BuildHasherDefault::<IdHasher>::default();
        for stride in [1, 4, 32, 1 << 12, 1 << 16] {
            let mut places = vec![0; 1 << 16];
            for number in 0..1u32 << 15 {
                let hash = hasher.hash_one(number.wrapping_mul(stride));
                places[usize::try_from(hash & 0xffff).unwrap()] += 1;
            }
            assert!(*places.iter().max().unwrap() <= 12, "stride {stride}");
        }
    }
}
