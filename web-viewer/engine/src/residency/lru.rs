//! Which of a set of things was used longest ago.
//!
//! A list that is linked both ways through places of one array, and a map to the place of every key: all operations take
//! constant time, since thousands of keys are touched in every frame.

use super::ids::IdMap;
use std::hash::Hash;

/// The end of the list, in both directions; its own links lead to the oldest and to the latest.
const END: usize = 0;

/// Keys in the order of their last use.
#[derive(Debug, Clone)]
pub struct Lru<K> {
    places: IdMap<K, usize>,
    links: Vec<Link<K>>,
    free: Vec<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Link<K> {
    /// `None` at the end and where there is nothing.
    key: Option<K>,
    older: usize,
    newer: usize,
}

impl<K> Default for Lru<K> {
    fn default() -> Self {
        let end = Link {
            key: None,
            older: END,
            newer: END,
        };
        Self {
            places: IdMap::default(),
            links: vec![end],
            free: Vec::new(),
        }
    }
}

impl<K: Copy + Eq + Hash> Lru<K> {
    /// Marks `key` as used now, adding it if it is new.
    pub fn touch(&mut self, key: K) {
        let place = if let Some(place) = self.places.get(&key) {
            let place = *place;
            self.unlink(place);
            place
        } else {
            let place = self.free.pop().unwrap_or(self.links.len());
            self.places.insert(key, place);
            place
        };
        let latest = self.links[END].older;
        let link = Link {
            key: Some(key),
            older: latest,
            newer: END,
        };
        if place == self.links.len() {
            self.links.push(link);
        } else {
            self.links[place] = link;
        }
        self.links[latest].newer = place;
        self.links[END].older = place;
    }

    /// Marks `key` as used now, if it is there.
    pub fn touch_known(&mut self, key: K) {
        if self.places.contains_key(&key) {
            self.touch(key);
        }
    }

    /// Forgets `key`.
    pub fn remove(&mut self, key: K) {
        if let Some(place) = self.places.remove(&key) {
            self.unlink(place);
            self.links[place].key = None;
            self.free.push(place);
        }
    }

    /// Keys, the longest unused first.
    pub fn oldest_first(&self) -> impl Iterator<Item = K> {
        let mut place = END;
        std::iter::from_fn(move || {
            place = self.links[place].newer;
            self.links[place].key
        })
    }

    /// Number of keys.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Links the neighbours of `place` to each other.
    fn unlink(&mut self, place: usize) {
        let Link { older, newer, .. } = self.links[place];
        self.links[older].newer = newer;
        self.links[newer].older = older;
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
            let was_there = naive.contains(&key);
            naive.retain(|other| *other != key);
            match random.below(4) {
                0 => lru.remove(key),
                1 => {
                    naive.extend(was_there.then_some(key));
                    lru.touch_known(key);
                }
                _ => {
                    naive.push(key);
                    lru.touch(key);
                }
            }
            assert_eq!(lru.oldest_first().collect::<Vec<_>>(), naive);
            assert_eq!(lru.len(), naive.len());
        }
    }
}
