//! The numbers of a PLY body, ASCII or binary.

use super::header::{Property, Scalar};
use crate::error::{ParseError, Place};
use crate::import::text::{Words, number, quoted};

/// A sequence of numbers. Integers up to 32 bits are exact in `f64`.
pub(super) trait Body {
    fn scalar(&mut self, scalar: Scalar) -> Result<f64, ParseError>;

    fn place(&self) -> Place;

    /// The place of the number that comes next.
    fn next_place(&mut self) -> Place {
        self.place()
    }

    /// Bytes not yet read.
    fn remaining(&self) -> u64;

    /// Bytes that one value of this property takes at least.
    fn least_bytes(&self, property: &Property) -> u64;

    /// Reads the number of items of a list and checks that so many can follow.
    fn list_length(&mut self, length: Scalar, item: Scalar) -> Result<u64, ParseError> {
        let place = self.next_place();
        let n = self.scalar(length)?;
        if !(n >= 0.0 && n.fract() == 0.0) {
            return Err(ParseError::syntax(
                place,
                format!("{n} is no length for a list"),
            ));
        }
        let item = Property {
            name: String::new(),
            scalar: item,
            list: None,
        };
        if n * self.least_bytes(&item) as f64 > self.remaining() as f64 + 1.0 {
            let missing = format!(
                "a list of {n} numbers follows, but {} bytes are left",
                self.remaining()
            );
            return Err(ParseError::truncated(place, missing));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked: an integer, no more than the bytes left"
        )]
        let n = n as u64;
        Ok(n)
    }

    /// Reads an integer, such as the index of a vertex.
    fn index(&mut self, scalar: Scalar) -> Result<i64, ParseError> {
        let place = self.next_place();
        let value = self.scalar(scalar)?;
        // Also keeps the cast below exact.
        if value.fract() != 0.0 || value.abs() > 1e15 || !value.is_finite() {
            return Err(ParseError::syntax(
                place,
                format!("{value} is no index of a vertex"),
            ));
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "checked: an integer below 2^53"
        )]
        let index = value as i64;
        Ok(index)
    }
}

/// The number in `bytes`, which are as many as `scalar` takes.
#[inline]
pub(super) fn decode<const BIG_ENDIAN: bool>(scalar: Scalar, bytes: &[u8]) -> Option<f64> {
    fn array<const BIG_ENDIAN: bool, const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
        let mut bytes: [u8; N] = bytes.try_into().ok()?;
        if BIG_ENDIAN {
            bytes.reverse();
        }
        Some(bytes)
    }
    Some(match scalar {
        Scalar::I8 => i8::from_le_bytes(array::<BIG_ENDIAN, 1>(bytes)?).into(),
        Scalar::U8 => u8::from_le_bytes(array::<BIG_ENDIAN, 1>(bytes)?).into(),
        Scalar::I16 => i16::from_le_bytes(array::<BIG_ENDIAN, 2>(bytes)?).into(),
        Scalar::U16 => u16::from_le_bytes(array::<BIG_ENDIAN, 2>(bytes)?).into(),
        Scalar::I32 => i32::from_le_bytes(array::<BIG_ENDIAN, 4>(bytes)?).into(),
        Scalar::U32 => u32::from_le_bytes(array::<BIG_ENDIAN, 4>(bytes)?).into(),
        Scalar::F32 => f32::from_le_bytes(array::<BIG_ENDIAN, 4>(bytes)?).into(),
        Scalar::F64 => f64::from_le_bytes(array::<BIG_ENDIAN, 8>(bytes)?),
    })
}

#[derive(Clone)]
pub(super) struct Ascii<'a> {
    words: Words<'a>,
}

impl<'a> Ascii<'a> {
    pub(super) fn new(text: &'a [u8], line: u64) -> Self {
        Self {
            words: Words::new(text, line),
        }
    }

    /// What is left, from the next word on.
    pub(super) fn next_words(&self) -> &'a [u8] {
        let mut words = self.words.clone();
        words.skip_space();
        words.rest()
    }

    /// Steps over `length` bytes of what [`Self::next_words`] gives, which are `lines` lines.
    pub(super) fn skip(&mut self, length: usize, lines: u64) {
        self.words.skip_space();
        self.words.skip_lines(length, lines);
    }

    /// Words left over mean that some record had more than its properties.
    pub(super) fn expect_end(&mut self) -> Result<(), ParseError> {
        match self.words.next() {
            None => Ok(()),
            Some(word) => {
                let cause = format!(
                    "{} follows the last element that the header announces",
                    quoted(word)
                );
                Err(ParseError::syntax(self.place(), cause))
            }
        }
    }
}

impl Body for Ascii<'_> {
    fn scalar(&mut self, _: Scalar) -> Result<f64, ParseError> {
        match self.words.next() {
            Some(word) => number(word, self.words.place(), "a property"),
            None => Err(ParseError::truncated(
                self.place(),
                "elements that the header announces are missing",
            )),
        }
    }

    fn place(&self) -> Place {
        self.words.place()
    }

    fn next_place(&mut self) -> Place {
        self.words.skip_space();
        self.words.place()
    }

    fn remaining(&self) -> u64 {
        self.words.remaining()
    }

    fn least_bytes(&self, _: &Property) -> u64 {
        2
    }
}

#[derive(Clone)]
pub(super) struct Binary<'a, const BIG_ENDIAN: bool> {
    file: &'a [u8],
    at: usize,
}

impl<'a, const BIG_ENDIAN: bool> Binary<'a, BIG_ENDIAN> {
    pub(super) fn new(file: &'a [u8], at: usize) -> Self {
        Self { file, at }
    }

    /// Bytes not yet read.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.file.get(self.at..).unwrap_or_default()
    }

    /// Steps over bytes of [`Self::rest`].
    pub(super) fn skip(&mut self, length: usize) {
        self.at += length;
    }
}

impl<const BIG_ENDIAN: bool> Body for Binary<'_, BIG_ENDIAN> {
    #[inline]
    fn scalar(&mut self, scalar: Scalar) -> Result<f64, ParseError> {
        let value = self
            .rest()
            .get(..scalar.size())
            .and_then(|bytes| decode::<BIG_ENDIAN>(scalar, bytes))
            .ok_or_else(|| {
                ParseError::truncated(
                    self.place(),
                    "elements that the header announces are missing",
                )
            })?;
        self.at += scalar.size();
        Ok(value)
    }

    fn place(&self) -> Place {
        Place::Byte(self.at as u64)
    }

    fn remaining(&self) -> u64 {
        self.file.len().saturating_sub(self.at) as u64
    }

    fn least_bytes(&self, property: &Property) -> u64 {
        property.list.unwrap_or(property.scalar).size() as u64
    }
}
