//! An adaptive binary range coder.
//!
//! Bits are coded with what has been seen of bits like them (Martin, "Range encoding: an algorithm for removing redundancy from a digitised
//! message", 1979; carries as in LZMA). Probabilities are the estimator of Krichevsky & Trofimov ("The performance of universal encoding",
//! 1981) while little has been seen, so that pages of some hundred numbers need no tables. Writer and reader run the same model:
//! a [`Coder`] is told every value, which a reader does not look at.
//!
//! All is integer arithmetic on at most 64 bits, so that every machine decodes the same bytes to the same bits; any bytes decode to something.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "ranges are as said beside them, and indices are below the sizes of the arrays"
)]

use crate::Error;

/// Ranges are kept at least this.
const LEAST: u32 = 1 << 24;
/// Bits seen after which probabilities follow at a fixed rate.
const MOST_SEEN: u16 = 127;
/// By bits seen, how far a probability goes to what was found, of 2^16.
const RATES: [i32; MOST_SEEN as usize + 1] = {
    let mut rates = [0; MOST_SEEN as usize + 1];
    let (mut seen, mut all) = (0, 2);
    while seen < rates.len() {
        rates[seen] = (1 << 16) / all;
        seen += 1;
        all += 1;
    }
    rates
};
/// Least probability of either bit, of 2^16.
const RARE: i32 = 64;
/// Bits that are coded in one go, at most.
const AT_ONCE: u32 = 16;

/// What has been seen of one kind of bit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bit {
    /// Probability that it is not set, of 2^16.
    zero: u16,
    seen: u16,
}

impl Default for Bit {
    fn default() -> Self {
        Self {
            zero: 1 << 15,
            seen: 0,
        }
    }
}

impl Bit {
    /// The part of a range that stands for a bit that is not set: more than nothing, and not all.
    fn bound(self, range: u32) -> u32 {
        (range >> 16) * u32::from(self.zero)
    }

    fn learn(&mut self, bit: bool) {
        let target = if bit { 0 } else { 1 << 16 };
        let zero = i32::from(self.zero);
        // 17 bits with a sign times 15.
        let rate = RATES[usize::from(self.seen) % RATES.len()];
        let moved = zero + (((target - zero) * rate) >> 16);
        self.zero = moved.clamp(RARE, (1 << 16) - RARE).unsigned_abs() as u16;
        self.seen = (self.seen + 1).min(MOST_SEEN);
    }
}

/// A writer or a reader of bits.
pub(crate) trait Coder {
    /// The next bit.
    fn bit(&mut self, model: &mut Bit, told: bool) -> bool;

    /// The next `count` bits, at most 16, all values of which are as likely.
    fn even(&mut self, count: u32, told: u32) -> u32;

    /// The next `count` bits, at most 30, all values of which are as likely.
    fn bits(&mut self, count: u32, told: u32) -> u32 {
        let low = count.min(AT_ONCE);
        let high = self.even(count - low, told >> low);
        high << low | self.even(low, told & ((1 << low) - 1))
    }
}

/// Numbers of one kind: the length in bits by a tree of bits, the second highest bit by length, the others as they are (Elias gamma codes with
/// an adaptive prefix).
#[derive(Debug, Clone)]
pub(crate) struct Number {
    lengths: [Bit; 32],
    seconds: [Bit; 32],
    depth: u32,
}

impl Number {
    /// Of numbers below 2^(2^`depth` − 1); `depth` is 1 to 5.
    pub(crate) fn new(depth: u32) -> Self {
        Self {
            lengths: [Bit::default(); 32],
            seconds: [Bit::default(); 32],
            depth: depth.clamp(1, 5),
        }
    }

    /// A number of at most 31 bits.
    pub(crate) fn unsigned(&mut self, coder: &mut impl Coder, told: u32) -> u32 {
        let told_length = u32::BITS - told.leading_zeros();
        let mut node = 1usize;
        for level in (0..self.depth).rev() {
            let bit = coder.bit(&mut self.lengths[node], told_length >> level & 1 == 1);
            node = node << 1 | usize::from(bit);
        }
        let length = node as u32 - (1 << self.depth);
        if length < 2 {
            return length;
        }
        let second = &mut self.seconds[length as usize];
        let rest = length - 2;
        let second = coder.bit(second, told >> rest & 1 == 1);
        let low = coder.bits(rest, told & ((1 << rest) - 1));
        (2 | u32::from(second)) << rest | low
    }

    /// A number of at most 30 bits and its sign.
    pub(crate) fn signed(&mut self, coder: &mut impl Coder, told: i32) -> i32 {
        let magnitude = self.unsigned(coder, told.unsigned_abs());
        if magnitude == 0 {
            return 0;
        }
        let magnitude = magnitude.cast_signed();
        if coder.even(1, u32::from(told < 0)) == 1 {
            -magnitude
        } else {
            magnitude
        }
    }
}

/// Writes bits.
#[cfg(any(test, not(target_arch = "wasm32")))]
#[derive(Debug)]
pub(crate) struct Encoder {
    low: u64,
    range: u32,
    /// The byte that a carry may still reach, and how many of 255 follow it.
    last: u8,
    full: usize,
    /// The first byte is always zero.
    bytes: Vec<u8>,
}

#[cfg(any(test, not(target_arch = "wasm32")))]
impl Encoder {
    pub(crate) fn new() -> Self {
        Self {
            low: 0,
            range: u32::MAX,
            last: 0,
            full: 0,
            bytes: Vec::new(),
        }
    }

    /// Bytes so far, about.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len() + self.full
    }

    fn shift(&mut self) {
        let (carry, high) = ((self.low >> 32) as u8, (self.low >> 24) as u8);
        if carry == 0 && high == u8::MAX {
            self.full += 1;
        } else {
            self.bytes.push(self.last.wrapping_add(carry));
            let full = u8::MAX.wrapping_add(carry);
            self.bytes.extend(std::iter::repeat_n(full, self.full));
            self.full = 0;
            self.last = high;
        }
        self.low = (self.low & u64::from(LEAST - 1)) << 8;
    }

    fn narrow(&mut self, from: u32, range: u32) {
        self.low += u64::from(from);
        self.range = range;
        while self.range < LEAST {
            self.range <<= 8;
            self.shift();
        }
    }

    /// All bytes; the last is not zero.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        // Of the numbers in the range one with many zeros at its end.
        let last = self.low + u64::from(self.range) - 1;
        let rounded = [32, 24, 16, 8].map(|bits| (self.low + ((1u64 << bits) - 1)) >> bits << bits);
        let found = rounded.into_iter().find(|&number| number <= last);
        self.low = found.unwrap_or(self.low);
        for _ in 0..5 {
            self.shift();
        }
        while self.bytes.last() == Some(&0) {
            self.bytes.pop();
        }
        self.bytes.drain(..self.bytes.len().min(1));
        self.bytes
    }
}

#[cfg(any(test, not(target_arch = "wasm32")))]
impl Coder for Encoder {
    fn bit(&mut self, model: &mut Bit, told: bool) -> bool {
        let bound = model.bound(self.range);
        if told {
            self.narrow(bound, self.range - bound);
        } else {
            self.narrow(0, bound);
        }
        model.learn(told);
        told
    }

    fn even(&mut self, count: u32, told: u32) -> u32 {
        let range = self.range >> count;
        self.narrow(told * range, range);
        told
    }
}

/// Reads bits; after the last byte come zeros.
#[derive(Debug)]
pub(crate) struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: &'a [u8],
    /// Bytes read, zeros after the last among them.
    at: usize,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self {
            code: 0,
            range: u32::MAX,
            bytes,
            at: 0,
        };
        for _ in 0..4 {
            decoder.code = decoder.code << 8 | decoder.next();
        }
        decoder
    }

    fn next(&mut self) -> u32 {
        let byte = self.bytes.get(self.at).copied().unwrap_or_default();
        self.at = self.at.saturating_add(1);
        u32::from(byte)
    }

    fn widen(&mut self) {
        while self.range < LEAST {
            self.range <<= 8;
            self.code = self.code << 8 | self.next();
        }
    }

    /// Refuses bytes that were not read, and zeros at the end, which take no bytes.
    pub(crate) fn finish(self, what: &'static str) -> Result<(), Error> {
        let trimmed = self.bytes.iter().rposition(|&byte| byte != 0);
        let expected = self.at.min(trimmed.map_or(0, |last| last + 1));
        if expected == self.bytes.len() {
            return Ok(());
        }
        Err(Error::TrailingBytes {
            what,
            expected: expected as u64,
            found: self.bytes.len() as u64,
        })
    }
}

impl Coder for Decoder<'_> {
    fn bit(&mut self, model: &mut Bit, _: bool) -> bool {
        let bound = model.bound(self.range);
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        self.widen();
        bit
    }

    fn even(&mut self, count: u32, _: u32) -> u32 {
        self.range >>= count;
        // The division's remainder belongs to the last value; no writer gets there.
        let value = (self.code / self.range).min((1 << count) - 1);
        self.code -= value * self.range;
        self.widen();
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Debug, Clone, Copy)]
    enum Item {
        Bit(usize, bool),
        Bits(u32, u32),
        Signed(usize, i32),
    }

    fn item() -> impl Strategy<Value = Item> {
        prop_oneof![
            (0..3usize, prop::bool::weighted(0.97)).prop_map(|(kind, bit)| Item::Bit(kind, bit)),
            (0..=30u32, any::<u32>())
                .prop_map(|(count, value)| Item::Bits(count, value & ((1 << count) - 1))),
            (0..2usize, -300..300i32).prop_map(|(kind, value)| Item::Signed(kind, value)),
            (0..2usize, -(1 << 30) + 1..1 << 30)
                .prop_map(|(kind, value)| Item::Signed(kind, value)),
        ]
    }

    /// What the items are, by a coder that is told them.
    fn run(coder: &mut impl Coder, items: &[Item]) -> Vec<i64> {
        let mut bits = [Bit::default(); 3];
        let mut numbers = [Number::new(5), Number::new(5)];
        let of = |item: &Item| match *item {
            Item::Bit(kind, bit) => i64::from(coder.bit(&mut bits[kind], bit)),
            Item::Bits(count, value) => i64::from(coder.bits(count, value)),
            Item::Signed(kind, value) => i64::from(numbers[kind].signed(coder, value)),
        };
        items.iter().map(of).collect()
    }

    fn blank(item: &Item) -> Item {
        match *item {
            Item::Bit(kind, _) => Item::Bit(kind, false),
            Item::Bits(count, _) => Item::Bits(count, 0),
            Item::Signed(kind, _) => Item::Signed(kind, 0),
        }
    }

    #[test]
    fn bits_that_are_nearly_always_alike_take_next_to_nothing() {
        let mut encoder = Encoder::new();
        let mut model = Bit::default();
        for k in 0..8000 {
            encoder.bit(&mut model, k % 100 == 50);
        }
        // The entropy is 0.081 bits.
        let length = encoder.finish().len();
        assert!((80..100).contains(&length), "{length}");
    }

    #[test]
    fn zeros_take_no_bytes() {
        let mut encoder = Encoder::new();
        encoder.bits(30, 0);
        assert_eq!(encoder.finish(), Vec::<u8>::new());
    }

    proptest! {
        #[test]
        fn what_is_told_is_read(items in prop::collection::vec(item(), 0..400)) {
            let mut encoder = Encoder::new();
            let told = run(&mut encoder, &items);
            let bytes = encoder.finish();
            let blank: Vec<Item> = items.iter().map(blank).collect();
            let mut decoder = Decoder::new(&bytes);
            prop_assert_eq!(run(&mut decoder, &blank), told);
            prop_assert!(decoder.finish("test").is_ok());
        }

        #[test]
        fn any_bytes_are_something(bytes in prop::collection::vec(any::<u8>(), 0..60), items in prop::collection::vec(item(), 0..200)) {
            run(&mut Decoder::new(&bytes), &items);
        }

        #[test]
        fn what_comes_after_the_last_bit_is_refused(items in prop::collection::vec(item(), 0..50), more in prop::collection::vec(any::<u8>(), 1..9)) {
            let mut encoder = Encoder::new();
            run(&mut encoder, &items);
            let length = encoder.len() + 5;
            let mut bytes = encoder.finish();
            bytes.resize(length, 0);
            bytes.extend(&more);
            let mut decoder = Decoder::new(&bytes);
            run(&mut decoder, &items);
            prop_assert!(decoder.finish("test").is_err());
        }
    }
}
