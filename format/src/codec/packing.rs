//! One byte stream of known length: all zero, raw, or one zstd frame.
//!
//! A frame is stored without its magic number, carries its content size, no checksum and no dictionary, and
//! needs a window of at most [`MAX_WINDOW_BYTES`]. The frame is walked here block by block before a decoder
//! sees it, so the native and the wasm decoder refuse the same bytes.

use crate::Error;
use crate::bytes::Cursor;

/// Most memory that a frame may ask of its decoder, bytes.
pub(crate) const MAX_WINDOW_BYTES: u64 = 8 << 20;
/// zstd level of the writer; pages are too small for higher ones to gain.
#[cfg(not(target_arch = "wasm32"))]
const LEVEL: i32 = 3;
const FRAME_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// How a stream is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// Nothing is stored: all bytes are zero.
    Zero = 0,
    /// As it is.
    Raw = 1,
    /// A zstd frame without magic.
    Zstd = 2,
}

impl Method {
    /// The method numbered `code`.
    pub(crate) fn from_code(what: &'static str, code: u8) -> Result<Self, Error> {
        match code {
            0 => Ok(Self::Zero),
            1 => Ok(Self::Raw),
            2 => Ok(Self::Zstd),
            _ => Err(Error::Value {
                what,
                found: u64::from(code),
            }),
        }
    }
}

/// Packs `data` by whichever method is smallest.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn pack(data: &[u8]) -> Result<(Method, Vec<u8>), Error> {
    use std::cell::RefCell;
    thread_local! {
        static COMPRESSOR: RefCell<Option<zstd::bulk::Compressor<'static>>> = const { RefCell::new(None) };
    }
    if data.iter().all(|&byte| byte == 0) {
        return Ok((Method::Zero, Vec::new()));
    }
    let frame = COMPRESSOR.with_borrow_mut(|slot| match slot {
        Some(compressor) => compressor.compress(data),
        None => slot
            .insert(zstd::bulk::Compressor::new(LEVEL)?)
            .compress(data),
    });
    let frame = frame.map_err(Error::Output)?;
    match frame.strip_prefix(&FRAME_MAGIC) {
        Some(body) if body.len() < data.len() => Ok((Method::Zstd, body.to_vec())),
        _ => Ok((Method::Raw, data.to_vec())),
    }
}

/// Unpacks a stream of exactly `expected` bytes. The caller bounds `expected`.
pub(crate) fn unpack(
    what: &'static str,
    method: Method,
    bytes: &[u8],
    expected: usize,
) -> Result<Vec<u8>, Error> {
    let exact = |found: usize, wanted: usize| match found.cmp(&wanted) {
        std::cmp::Ordering::Less => Err(Error::Truncated {
            what,
            expected: wanted as u64,
            found: found as u64,
        }),
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Greater => Err(Error::TrailingBytes {
            what,
            expected: wanted as u64,
            found: found as u64,
        }),
    };
    match method {
        Method::Zero => exact(bytes.len(), 0).map(|()| vec![0; expected]),
        Method::Raw => exact(bytes.len(), expected).map(|()| bytes.to_vec()),
        Method::Zstd => {
            check_frame(what, bytes, expected as u64)?;
            let mut frame = Vec::with_capacity(bytes.len().saturating_add(FRAME_MAGIC.len()));
            frame.extend_from_slice(&FRAME_MAGIC);
            frame.extend_from_slice(bytes);
            let data = decompress(&frame, expected)
                .map_err(|reason| Error::Compression { what, reason })?;
            exact(data.len(), expected).map(|()| data)
        }
    }
}

/// Walks a frame (RFC 8878, section 3.1.1) without decoding it.
fn check_frame(what: &'static str, bytes: &[u8], expected: u64) -> Result<(), Error> {
    let refuse = |reason: &str| Error::Compression {
        what,
        reason: reason.to_owned(),
    };
    let mut cursor = Cursor::new(what, bytes);
    let descriptor = cursor.u8()?;
    if descriptor & 0b0001_1111 != 0 {
        return Err(refuse(
            "the frame has a dictionary, a checksum or reserved bits",
        ));
    }
    let single_segment = descriptor & 0b0010_0000 != 0;
    let mut window = 0;
    if !single_segment {
        let byte = cursor.u8()?;
        let base = 1u64 << (10 + u32::from(byte >> 3));
        window = base.saturating_add((base >> 3).saturating_mul(u64::from(byte & 7)));
    }
    let content = match descriptor >> 6 {
        0 if single_segment => u64::from(cursor.u8()?),
        0 => return Err(refuse("the frame does not state its content size")),
        1 => u64::from(cursor.u16()?).saturating_add(256),
        2 => u64::from(cursor.u32()?),
        _ => cursor.u64()?,
    };
    if single_segment {
        window = content;
    }
    if window > MAX_WINDOW_BYTES {
        return Err(Error::Limit {
            what: "zstd window",
            limit: MAX_WINDOW_BYTES,
            found: window,
        });
    }
    if content != expected {
        return Err(Error::Mismatch {
            what,
            expected,
            found: content,
        });
    }
    loop {
        let [low, middle, high] = [cursor.u8()?, cursor.u8()?, cursor.u8()?];
        let header = u32::from_le_bytes([low, middle, high, 0]);
        let stored = match header >> 1 & 3 {
            0 | 2 => header >> 3,
            1 => 1,
            _ => return Err(refuse("the frame has a block of a reserved type")),
        };
        cursor.take(usize::try_from(stored).unwrap_or(usize::MAX))?;
        if header & 1 == 1 {
            return cursor.finish();
        }
    }
}

#[cfg(not(target_arch = "wasm32"))]
fn decompress(frame: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    use std::cell::RefCell;
    thread_local! {
        static DECOMPRESSOR: RefCell<Option<zstd::bulk::Decompressor<'static>>> = const { RefCell::new(None) };
    }
    DECOMPRESSOR
        .with_borrow_mut(|slot| match slot {
            Some(decompressor) => decompressor.decompress(frame, expected),
            None => slot
                .insert(zstd::bulk::Decompressor::new()?)
                .decompress(frame, expected),
        })
        .map_err(|error| error.to_string())
}

#[cfg(target_arch = "wasm32")]
fn decompress(frame: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    decompress_pure(frame, expected)
}

/// The pure-Rust decoder of wasm builds; tests hold it against the native one.
#[cfg(any(test, target_arch = "wasm32"))]
fn decompress_pure(frame: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    let mut data = vec![0; expected];
    let mut decoder = ruzstd::decoding::FrameDecoder::new();
    decoder.set_max_window_size(MAX_WINDOW_BYTES);
    let written = decoder
        .decode_all(frame, &mut data)
        .map_err(|error| error.to_string())?;
    data.truncate(written);
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame_of(body: &[u8]) -> Vec<u8> {
        [&FRAME_MAGIC, body].concat()
    }

    proptest! {
        #[test]
        fn pack_and_unpack_return_the_data(
            data in prop::collection::vec(prop_oneof![Just(0u8), 0..4u8, any::<u8>()], 0..5000)
        ) {
            let (method, bytes) = pack(&data).unwrap();
            prop_assert_eq!(unpack("test", method, &bytes, data.len()).unwrap(), data);
        }

        #[test]
        fn both_decoders_return_the_data(
            data in prop::collection::vec(prop_oneof![Just(0u8), 0..4u8, any::<u8>()], 0..5000)
        ) {
            let (method, bytes) = pack(&data).unwrap();
            prop_assume!(method == Method::Zstd);
            for decode in [decompress, decompress_pure] {
                prop_assert_eq!(&decode(&frame_of(&bytes), data.len()), &Ok(data.clone()));
            }
        }

        /// What they make of one may differ where lengths of streams of literals do not add up (a bit of their table was wrong). Checksums
        /// tell damage, before anything is decoded.
        #[test]
        fn neither_decoder_gives_more_than_asked_for_from_damaged_frames(
            data in prop::collection::vec(0..6u8, 300..2000), at in any::<prop::sample::Index>(), bit in 0..8u8
        ) {
            let (method, mut bytes) = pack(&data).unwrap();
            prop_assume!(method == Method::Zstd);
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
            for decode in [decompress, decompress_pure] {
                if let Ok(decoded) = decode(&frame_of(&bytes), data.len()) {
                    prop_assert!(decoded.len() <= data.len());
                }
            }
        }

        #[test]
        fn unpack_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..200), expected in 0..1000usize) {
            let _ = unpack("test", Method::Zstd, &bytes, expected);
        }
    }

    #[test]
    fn the_pure_decoder_reads_what_the_native_one_writes() {
        let data: Vec<u8> = (0..300_000u32)
            .map(|i| (i.wrapping_mul(i) >> 7) as u8 & 15)
            .collect();
        let (method, bytes) = pack(&data).unwrap();
        assert_eq!(method, Method::Zstd);
        assert_eq!(
            decompress_pure(&frame_of(&bytes), data.len()).unwrap(),
            data
        );
    }

    #[test]
    fn zeros_take_no_bytes() {
        assert_eq!(pack(&[0; 1000]).unwrap(), (Method::Zero, Vec::new()));
    }

    #[test]
    fn a_second_frame_is_refused() {
        let data = vec![7; 500];
        let (_, body) = pack(&data).unwrap();
        let twice = [&body[..], &FRAME_MAGIC, &body].concat();
        assert!(matches!(
            unpack("test", Method::Zstd, &twice, 500),
            Err(Error::TrailingBytes { .. })
        ));
    }

    #[test]
    fn a_large_window_is_refused() {
        // Not single segment, window exponent 14: 16 MiB.
        let bytes = [0b0100_0000, 14 << 3, 0xff, 0xff];
        assert!(matches!(
            unpack("test", Method::Zstd, &bytes, 65_791),
            Err(Error::Limit { .. })
        ));
    }
}
