//! Reading little-endian values from a slice, without panics.

use crate::Error;

/// A slice being read from its start.
#[derive(Debug)]
pub(crate) struct Cursor<'a> {
    what: &'static str,
    bytes: &'a [u8],
    total: usize,
}

impl<'a> Cursor<'a> {
    /// Reads `bytes`; `what` names them in errors.
    pub(crate) fn new(what: &'static str, bytes: &'a [u8]) -> Self {
        Self {
            what,
            bytes,
            total: bytes.len(),
        }
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let Some((taken, rest)) = self.bytes.split_at_checked(count) else {
            let before = self.total.saturating_sub(self.bytes.len());
            return Err(Error::Truncated {
                what: self.what,
                expected: before.saturating_add(count) as u64,
                found: self.total as u64,
            });
        };
        self.bytes = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Error> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Error> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Error> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Error> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn bytes16(&mut self) -> Result<[u8; 16], Error> {
        self.array()
    }

    /// A LEB128 number below 2^32, in its shortest form.
    pub(crate) fn leb128(&mut self) -> Result<u32, Error> {
        let mut value = 0u64;
        for shift in (0..35).step_by(7) {
            let byte = self.u8()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                if byte == 0 && shift > 0 {
                    return Err(Error::Value {
                        what: self.what,
                        found: value,
                    });
                }
                let out_of_range = Error::Value {
                    what: self.what,
                    found: value,
                };
                return u32::try_from(value).ok().ok_or(out_of_range);
            }
        }
        Err(Error::Value {
            what: self.what,
            found: value,
        })
    }

    /// Everything that is left.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.bytes)
    }

    /// Nothing may be left.
    pub(crate) fn finish(self) -> Result<(), Error> {
        if self.bytes.is_empty() {
            return Ok(());
        }
        Err(Error::TrailingBytes {
            what: self.what,
            expected: self.total.saturating_sub(self.bytes.len()) as u64,
            found: self.total as u64,
        })
    }
}

/// Appends `value` in LEB128.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn push_leb128(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push(value.to_le_bytes()[0] | 0x80);
        value >>= 7;
    }
    out.push(value.to_le_bytes()[0]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leb128_returns_what_was_written() {
        for value in [0, 1, 127, 128, 300, 16_383, 16_384, u32::MAX] {
            let mut out = Vec::new();
            push_leb128(&mut out, value);
            let mut cursor = Cursor::new("test", &out);
            assert_eq!(cursor.leb128().unwrap(), value);
            cursor.finish().unwrap();
        }
    }

    #[test]
    fn long_leb128_is_refused() {
        assert!(Cursor::new("test", &[0x80, 0x00]).leb128().is_err());
        assert!(Cursor::new("test", &[0xff; 6]).leb128().is_err());
        assert!(
            Cursor::new("test", &[0xff, 0xff, 0xff, 0xff, 0x1f])
                .leb128()
                .is_err()
        );
    }

    #[test]
    fn reading_past_the_end_is_an_error() {
        let mut cursor = Cursor::new("test", &[1, 2, 3]);
        assert_eq!(cursor.u16().unwrap(), 0x0201);
        assert!(matches!(
            cursor.u16(),
            Err(Error::Truncated {
                expected: 4,
                found: 3,
                ..
            })
        ));
        assert!(matches!(
            cursor.finish(),
            Err(Error::TrailingBytes {
                expected: 2,
                found: 3,
                ..
            })
        ));
    }
}
