//! Which of a set of things was used longest ago.

use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;

/// Keys in the order of their last use. Every operation takes logarithmic time.
#[derive(Debug, Clone)]
pub struct Lru<K> {
    stamps: HashMap<K, u64>,
    by_stamp: BTreeMap<u64, K>,
    next: u64,
}

impl<K> Default for Lru<K> {
    fn default() -> Self {
        Self {
            stamps: HashMap::new(),
            by_stamp: BTreeMap::new(),
            next: 0,
        }
    }
}

impl<K: Copy + Eq + Hash> Lru<K> {
    /// Marks `key` as used now, adding it if it is new.
    pub fn touch(&mut self, key: K) {
        if let Some(old) = self.stamps.insert(key, self.next) {
            self.by_stamp.remove(&old);
        }
        self.by_stamp.insert(self.next, key);
        self.next += 1;
    }

    /// Forgets `key`.
    pub fn remove(&mut self, key: K) {
        if let Some(stamp) = self.stamps.remove(&key) {
            self.by_stamp.remove(&stamp);
        }
    }

    /// Keys, the longest unused first.
    pub fn oldest_first(&self) -> impl Iterator<Item = K> {
        self.by_stamp.values().copied()
    }

    /// Number of keys.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn order_is_that_of_a_list_moved_to_the_back() {
        let mut random = Random::new(3);
        let (mut lru, mut naive) = (Lru::default(), Vec::new());
        for _ in 0..2000 {
            let key = random.below(40);
            naive.retain(|other| *other != key);
            if random.below(4) == 0 {
                lru.remove(key);
            } else {
                lru.touch(key);
                naive.push(key);
            }
            assert_eq!(lru.oldest_first().collect::<Vec<_>>(), naive);
            assert_eq!(lru.len(), naive.len());
        }
    }
}
