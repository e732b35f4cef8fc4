//! Sets of small numbers, and maps by them, as arrays: nodes, groups and pages are numbered from 0 on, and thousands are looked up,
//! added and gone through in every frame.

/// A set, a bit a number.
#[derive(Debug, Clone, Default)]
pub struct NumberSet {
    words: Vec<u64>,
}

impl NumberSet {
    /// Whether `number` is in it.
    pub fn contains(&self, number: u32) -> bool {
        let (word, bit) = place(number);
        self.words.get(word).is_some_and(|word| word & bit != 0)
    }

    /// Adds `number`; whether it is new.
    pub fn insert(&mut self, number: u32) -> bool {
        let (word, bit) = place(number);
        if word >= self.words.len() {
            self.words.resize(word + 1, 0);
        }
        let is_new = self.words[word] & bit == 0;
        self.words[word] |= bit;
        is_new
    }

    /// Takes `number` out; whether it was there.
    pub fn remove(&mut self, number: u32) -> bool {
        let (word, bit) = place(number);
        let Some(word) = self.words.get_mut(word) else {
            return false;
        };
        let was_there = *word & bit != 0;
        *word &= !bit;
        was_there
    }

    /// Whether all of its numbers are in `other`.
    pub fn is_in(&self, other: &Self) -> bool {
        let others = other.words.iter().copied().chain(std::iter::repeat(0));
        let mut words = self.words.iter().zip(others);
        words.all(|(own, others)| own & !others == 0)
    }

    /// Takes out all numbers.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// The numbers, ascending.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = u32> + '_ {
        let words = self.words.iter().enumerate();
        words.flat_map(|(index, &word)| Bits {
            // As numbers have 32 bits, so have the first ones of words.
            first: u32::try_from(64 * index).unwrap_or(u32::MAX),
            word,
        })
    }
}

impl PartialEq for NumberSet {
    fn eq(&self, other: &Self) -> bool {
        let common = self.words.len().min(other.words.len());
        let (own, rest) = self.words.split_at(common);
        let (others, others_rest) = other.words.split_at(common);
        own == others && rest.iter().chain(others_rest).all(|word| *word == 0)
    }
}

impl Eq for NumberSet {}

impl Extend<u32> for NumberSet {
    fn extend<T: IntoIterator<Item = u32>>(&mut self, numbers: T) {
        for number in numbers {
            self.insert(number);
        }
    }
}

impl FromIterator<u32> for NumberSet {
    fn from_iter<T: IntoIterator<Item = u32>>(numbers: T) -> Self {
        let mut set = Self::default();
        set.extend(numbers);
        set
    }
}

/// A map from numbers to numbers below `u32::MAX`.
#[derive(Debug, Clone, Default)]
pub struct NumberMap {
    /// `u32::MAX` where there is none.
    values: Vec<u32>,
}

impl NumberMap {
    const NONE: u32 = u32::MAX;

    /// The value of `number`.
    pub fn get(&self, number: u32) -> Option<u32> {
        let value = *self.values.get(number as usize)?;
        (value != Self::NONE).then_some(value)
    }

    /// Gives `number` a value, in place of the one that it may have.
    pub fn insert(&mut self, number: u32, value: u32) {
        let index = number as usize;
        if index >= self.values.len() {
            self.values.resize(index + 1, Self::NONE);
        }
        self.values[index] = value;
    }

    /// Takes out `number`.
    pub fn remove(&mut self, number: u32) {
        if let Some(value) = self.values.get_mut(number as usize) {
            *value = Self::NONE;
        }
    }
}

/// The numbers of one word.
#[derive(Debug)]
struct Bits {
    first: u32,
    word: u64,
}

impl Iterator for Bits {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let bit = (self.word != 0).then(|| self.word.trailing_zeros())?;
        self.word &= self.word - 1;
        Some(self.first + bit)
    }
}

impl DoubleEndedIterator for Bits {
    fn next_back(&mut self) -> Option<u32> {
        let bit = self.word.checked_ilog2()?;
        self.word &= !(1 << bit);
        Some(self.first + bit)
    }
}

fn place(number: u32) -> (usize, u64) {
    (number as usize / 64, 1 << (number % 64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use std::collections::{BTreeMap, BTreeSet};

    #[test]
    fn does_as_a_tree_does() {
        let mut random = Random::new(5);
        let (mut set, mut tree) = (NumberSet::default(), BTreeSet::new());
        for _ in 0..2000 {
            let number = random.below(300);
            match random.below(3) {
                0 => assert_eq!(set.remove(number), tree.remove(&number)),
                _ => assert_eq!(set.insert(number), tree.insert(number)),
            }
            assert_eq!(set.contains(number), tree.contains(&number));
            assert!(set.iter().eq(tree.iter().copied()));
            assert!(set.iter().rev().eq(tree.iter().rev().copied()));
        }
        assert!(!set.contains(u32::MAX) && !set.remove(u32::MAX));
        assert_eq!(tree.iter().copied().collect::<NumberSet>(), set);
        for fewer in [0, 1, 299] {
            let part: NumberSet = tree.iter().copied().filter(|k| *k != fewer).collect();
            assert!(part.is_in(&set));
            assert_eq!(set.is_in(&part), !tree.contains(&fewer));
        }
        set.clear();
        assert!(set.is_in(&NumberSet::default()));
        assert_eq!(set.iter().next(), None);
    }

    #[test]
    fn maps_do_as_trees_do() {
        let mut random = Random::new(6);
        let (mut map, mut tree) = (NumberMap::default(), BTreeMap::new());
        for value in 0..2000 {
            let number = random.below(100);
            if random.below(3) == 0 {
                map.remove(number);
                tree.remove(&number);
            } else {
                map.insert(number, value);
                tree.insert(number, value);
            }
            let looked_up = random.below(120);
            assert_eq!(map.get(looked_up), tree.get(&looked_up).copied());
        }
    }

    #[test]
    fn sets_are_equal_whatever_was_in_them() {
        let mut grown = NumberSet::from_iter([3, 1000]);
        assert_ne!(grown, NumberSet::from_iter([3]));
        grown.remove(1000);
        assert_eq!(grown, NumberSet::from_iter([3]));
        assert_eq!(NumberSet::from_iter([3]), grown);
    }
}
