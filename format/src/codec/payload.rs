//! The stored form of a set of residuals: geometry, normals and colours, each a packed stream of byte planes.
//!
//! Byte planes put the nearly always zero high bytes together, which zstd then stores in a few bytes.

use super::packing::{self, Method};
use super::shading::Prediction;
use crate::Error;
use crate::bytes::Cursor;

/// Residuals of a page or of the base.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Residuals {
    pub(crate) positions: Vec<[i32; 3]>,
    /// What the odd normals were predicted from.
    pub(crate) prediction: Prediction,
    /// Two components each.
    pub(crate) normals: Vec<[i32; 3]>,
    /// Empty in files without colours.
    pub(crate) colours: Vec<[i32; 3]>,
}

/// Residuals to be encoded: of normals, one set by [`Prediction`].
#[cfg(not(target_arch = "wasm32"))]
#[derive(Debug, Default)]
pub(crate) struct Alternatives {
    pub(crate) positions: Vec<[i32; 3]>,
    pub(crate) normals: [Vec<[i32; 3]>; 3],
    /// Empty in files without colours.
    pub(crate) colours: Vec<[i32; 3]>,
}

/// How many residuals a payload holds; both are bounded by the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) positions: usize,
    /// As many colours, in files with colours.
    pub(crate) normals: usize,
}

/// Stored bytes of a payload by part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct PartBytes {
    /// Positions and the payload's own header.
    pub(crate) geometry: u64,
    pub(crate) normals: u64,
    pub(crate) colours: u64,
}

/// First byte: methods, two bits each.
const NORMALS_SHIFT: u32 = 2;
const COLOURS_SHIFT: u32 = 4;
const METHODS_RESERVED: u8 = 0b1100_0000;
/// Second byte: planes of the positions less one, prediction of the normals.
const PREDICTION_SHIFT: u32 = 2;
const CODING_RESERVED: u8 = 0b1111_0000;

/// The payload's header.
struct PayloadHeader {
    planes: usize,
    prediction: Prediction,
    methods: [Method; 3],
    geometry_length: usize,
    normals_length: usize,
}

impl PayloadHeader {
    fn parse(
        what: &'static str,
        has_colours: bool,
        cursor: &mut Cursor<'_>,
    ) -> Result<Self, Error> {
        let (methods, coding) = (cursor.u8()?, cursor.u8()?);
        if methods & METHODS_RESERVED != 0 || coding & CODING_RESERVED != 0 {
            return Err(Error::Reserved {
                what,
                value: u64::from(u16::from_le_bytes([methods, coding])),
            });
        }
        let code = |shift: u32| Method::from_code(what, methods >> shift & 3);
        let methods = [code(0)?, code(NORMALS_SHIFT)?, code(COLOURS_SHIFT)?];
        let planes = usize::from(coding & 3).saturating_add(1);
        if planes > 3 {
            return Err(Error::Value {
                what,
                found: planes as u64,
            });
        }
        let prediction = Prediction::from_code(what, coding >> PREDICTION_SHIFT & 3)?;
        let [_, _, colours] = methods;
        if !has_colours && colours != Method::Zero {
            return Err(Error::Value {
                what,
                found: colours as u64,
            });
        }
        let geometry_length = usize::try_from(cursor.leb128()?).unwrap_or(usize::MAX);
        let normals_length = usize::try_from(cursor.leb128()?).unwrap_or(usize::MAX);
        Ok(Self {
            planes,
            prediction,
            methods,
            geometry_length,
            normals_length,
        })
    }
}

/// Sizes of the parts of a stored payload, without decoding it.
pub(crate) fn parts(
    what: &'static str,
    has_colours: bool,
    bytes: &[u8],
) -> Result<PartBytes, Error> {
    let mut cursor = Cursor::new(what, bytes);
    let header = PayloadHeader::parse(what, has_colours, &mut cursor)?;
    cursor.take(header.geometry_length)?;
    cursor.take(header.normals_length)?;
    let (normals, colours) = (header.normals_length as u64, cursor.rest().len() as u64);
    let geometry = (bytes.len() as u64)
        .saturating_sub(normals)
        .saturating_sub(colours);
    Ok(PartBytes {
        geometry,
        normals,
        colours,
    })
}

/// Decodes a payload of exactly `counts` residuals.
pub(crate) fn decode(
    what: &'static str,
    counts: Counts,
    has_colours: bool,
    bytes: &[u8],
) -> Result<Residuals, Error> {
    let mut cursor = Cursor::new(what, bytes);
    let header = PayloadHeader::parse(what, has_colours, &mut cursor)?;
    let [geometry, normals, colours] = header.methods;
    let colour_count = if has_colours { counts.normals } else { 0 };
    let stream = |cursor_bytes: &[u8], method, count: usize, planes: usize| {
        packing::unpack(what, method, cursor_bytes, count.saturating_mul(planes))
    };
    let positions = stream(
        cursor.take(header.geometry_length)?,
        geometry,
        counts.positions,
        header.planes.saturating_mul(3),
    )?;
    let normals = stream(
        cursor.take(header.normals_length)?,
        normals,
        counts.normals,
        2,
    )?;
    let colours = stream(cursor.rest(), colours, colour_count, 3)?;
    Ok(Residuals {
        positions: unzigzag_planes(&positions, counts.positions),
        prediction: header.prediction,
        normals: two_byte_planes(&normals, counts.normals),
        colours: three_byte_planes(&colours, colour_count),
    })
}

/// From planes (plane by plane, low byte first, component by component) to signed residuals.
fn unzigzag_planes(bytes: &[u8], count: usize) -> Vec<[i32; 3]> {
    let mut codes = vec![[0u32; 3]; count];
    let planes = bytes.chunks_exact(count.saturating_mul(3).max(1));
    for (plane, shift) in planes.zip((0u32..).step_by(8)) {
        for ([a, b, c], bytes) in codes.iter_mut().zip(three_planes(plane, count)) {
            let [x, y, z] = bytes.map(|byte| u32::from(byte) << shift);
            *a |= x;
            *b |= y;
            *c |= z;
        }
    }
    codes.into_iter().map(|code| code.map(unzigzag)).collect()
}

/// Residuals of two components of a byte each.
fn two_byte_planes(bytes: &[u8], count: usize) -> Vec<[i32; 3]> {
    let (first, second) = bytes.split_at_checked(count).unwrap_or_default();
    let both = first.iter().zip(second);
    both.map(|(&a, &b)| [i32::from(a), i32::from(b), 0])
        .collect()
}

/// Residuals of three components of a byte each.
fn three_byte_planes(bytes: &[u8], count: usize) -> Vec<[i32; 3]> {
    three_planes(bytes, count)
        .map(|bytes| bytes.map(i32::from))
        .collect()
}

/// The bytes of three planes of `count` side by side.
fn three_planes(bytes: &[u8], count: usize) -> impl Iterator<Item = [u8; 3]> {
    let (first, rest) = bytes.split_at_checked(count).unwrap_or_default();
    let (second, third) = rest.split_at_checked(count).unwrap_or_default();
    let all = first.iter().zip(second).zip(third);
    all.map(|((&a, &b), &c)| [a, b, c])
}

/// Signed to unsigned: 0, −1, 1, −2, … become 0, 1, 2, 3, …
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)).cast_unsigned()
}

/// Inverse of `zigzag`.
pub(crate) fn unzigzag(code: u32) -> i32 {
    (code >> 1).cast_signed() ^ (code & 1).cast_signed().wrapping_neg()
}

/// Encodes residuals, of the normals those that take the fewest bytes; colours are stored when `has_colours`.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "no bytes of a file come here"
)]
pub(crate) fn encode(
    residuals: &Alternatives,
    has_colours: bool,
) -> Result<(Vec<u8>, PartBytes), Error> {
    let codes: Vec<[u32; 3]> = residuals.positions.iter().map(|r| r.map(zigzag)).collect();
    let largest = codes.iter().flatten().copied().max().unwrap_or(0);
    let planes = match largest {
        0..0x100 => 1u8,
        0x100..0x1_0000 => 2,
        _ => 3,
    };
    let mut geometry = Vec::with_capacity(3 * usize::from(planes) * codes.len());
    for plane in 0..planes {
        for component in 0..3 {
            geometry.extend(
                codes
                    .iter()
                    .map(|code| (code[component] >> (8 * u32::from(plane))) as u8),
            );
        }
    }
    let bytes_of = |values: &[[i32; 3]], components: usize| {
        let mut bytes = Vec::with_capacity(components * values.len());
        for component in 0..components {
            bytes.extend(values.iter().map(|value| value[component] as u8));
        }
        bytes
    };
    let (geometry_method, geometry) = packing::pack(&geometry)?;
    let mut best: Option<(Prediction, (Method, Vec<u8>))> = None;
    for (prediction, normals) in Prediction::ALL.into_iter().zip(&residuals.normals) {
        let packed = packing::pack(&bytes_of(normals, 2))?;
        if best
            .as_ref()
            .is_none_or(|(_, (_, least))| packed.1.len() < least.len())
        {
            best = Some((prediction, packed));
        }
    }
    let (prediction, (normals_method, normals)) =
        best.unwrap_or((Prediction::Interpolated, (Method::Zero, Vec::new())));
    let (colours_method, colours) = if has_colours {
        packing::pack(&bytes_of(&residuals.colours, 3))?
    } else {
        (Method::Zero, Vec::new())
    };

    let mut out = vec![
        geometry_method as u8
            | (normals_method as u8) << NORMALS_SHIFT
            | (colours_method as u8) << COLOURS_SHIFT,
        (planes - 1) | (prediction as u8) << PREDICTION_SHIFT,
    ];
    crate::bytes::push_leb128(&mut out, u32::try_from(geometry.len()).unwrap_or(u32::MAX));
    crate::bytes::push_leb128(&mut out, u32::try_from(normals.len()).unwrap_or(u32::MAX));
    let parts = PartBytes {
        geometry: (out.len() + geometry.len()) as u64,
        normals: normals.len() as u64,
        colours: colours.len() as u64,
    };
    out.extend(geometry);
    out.extend(normals);
    out.extend(colours);
    Ok((out, parts))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn residuals() -> impl Strategy<Value = (Residuals, bool)> {
        let position = prop_oneof![
            Just([0i32; 3]),
            [-3..3, -300..300, -3..3],
            [-2_000_000..2_000_000, -5..5, 0..1]
        ];
        let bytes = |n: usize| prop::collection::vec([0..256i32, 0..256i32, 0..256i32], n);
        (
            prop::collection::vec(position, 0..400),
            0..400usize,
            any::<bool>(),
        )
            .prop_flat_map(move |(positions, n, has)| {
                (
                    Just(positions),
                    bytes(n),
                    bytes(if has { n } else { 0 }),
                    Just(has),
                )
                    .prop_map(|(positions, normals, colours, has)| {
                        let normals = normals.into_iter().map(|[a, b, _]| [a, b, 0]).collect();
                        (
                            Residuals {
                                positions,
                                prediction: Prediction::Mixed,
                                normals,
                                colours,
                            },
                            has,
                        )
                    })
            })
    }

    /// Alternatives of which those of `residuals` are the smallest, unless there is next to nothing to store.
    fn alternatives(residuals: &Residuals) -> Alternatives {
        let worse: Vec<[i32; 3]> = (0..4000)
            .map(|k: i32| [(k * k) >> 3, (k * k) >> 5, 0])
            .collect();
        let normals = [worse.clone(), residuals.normals.clone(), worse];
        Alternatives {
            positions: residuals.positions.clone(),
            normals,
            colours: residuals.colours.clone(),
        }
    }

    proptest! {
        #[test]
        fn residuals_survive_the_round_trip((residuals, has_colours) in residuals()) {
            let counts = Counts { positions: residuals.positions.len(), normals: residuals.normals.len() };
            let (bytes, sizes) = encode(&alternatives(&residuals), has_colours).unwrap();
            prop_assert_eq!(sizes.geometry + sizes.normals + sizes.colours, bytes.len() as u64);
            prop_assert_eq!(parts("test", has_colours, &bytes).unwrap(), sizes);
            prop_assert_eq!(decode("test", counts, has_colours, &bytes).unwrap(), residuals);
        }

        #[test]
        fn any_bytes_decode_or_fail_cleanly(bytes in prop::collection::vec(any::<u8>(), 0..300), n in 0..200usize) {
            if let Ok(residuals) = decode("test", Counts { positions: n, normals: n }, true, &bytes) {
                prop_assert_eq!(residuals.positions.len(), n);
                prop_assert_eq!(residuals.colours.len(), n);
            }
        }
    }

    #[test]
    fn zigzag_covers_all_numbers() {
        for value in [0, 1, -1, 2, -2, 4_194_303, -4_194_304, i32::MAX, i32::MIN] {
            assert_eq!(unzigzag(zigzag(value)), value);
        }
    }

    #[test]
    fn trailing_bytes_are_refused() {
        let residuals = Residuals {
            positions: vec![[1, 2, 3]; 5],
            normals: vec![[1, 2, 0]; 5],
            ..Residuals::default()
        };
        let (mut bytes, _) = encode(&alternatives(&residuals), false).unwrap();
        bytes.push(0);
        let counts = Counts {
            positions: 5,
            normals: 5,
        };
        assert!(matches!(
            decode("test", counts, false, &bytes),
            Err(Error::TrailingBytes { .. })
        ));
    }
}
