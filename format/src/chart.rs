//! Charts and the glue between their sides.

use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::codec::payload::unzigzag;
use crate::index::quantize::error_from_code;
use crate::quadtree::PAGE_RESOLUTION;
use crate::{Error, Limits};

/// Index of a chart; also the [`PageId`](crate::PageId) of its root page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChartId(pub u32);

/// A side of the parameter square, `0..4`: side s runs from corner s to corner (s + 1) mod 4.
///
/// Corners: 0 = (0,0), 1 = (1,0), 2 = (1,1), 3 = (0,1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side(pub u8);

/// What a chart's side is glued to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Glue {
    /// The neighbour (may be the chart itself).
    pub chart: ChartId,
    /// The neighbour's side.
    pub side: Side,
    /// Whether position t here is 1 − t there (the usual case on an oriented surface).
    pub reversed: bool,
}

/// What the front of the file says of one chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Glue by side; `None` is an open border.
    pub glue: [Option<Glue>; 4],
    /// Finest resolution of the root node, `0..=5`.
    pub resolution: u8,
    /// Geometric error (lattice units, upper bound) at resolutions `0..=min(resolution, base_resolution)`.
    pub base_errors: Vec<f32>,
}

const WHAT: &str = "charts";
/// Code of an open border; a glued side is 1 + side + 4 · reversed.
const OPEN: u8 = 0;

/// Reads the charts section; also gives the base resolution.
pub(crate) fn decode_charts(bytes: &[u8], limits: &Limits) -> Result<(Vec<Chart>, u8), Error> {
    let mut cursor = Cursor::new(WHAT, bytes);
    let count = cursor.u32()?;
    let base_resolution = cursor.u8()?;
    let method = Method::from_code(WHAT, cursor.u8()?)?;
    let reserved = cursor.u16()?;
    let error_bytes = cursor.u32()?;
    if reserved != 0 {
        return Err(Error::Reserved {
            what: WHAT,
            value: u64::from(reserved),
        });
    }
    // A file without charts has none of what belongs to them.
    if count == 0 && error_bytes != 0 {
        return Err(Error::Value {
            what: "number of charts",
            found: 0,
        });
    }
    if count > limits.charts {
        return Err(Error::Limit {
            what: WHAT,
            limit: u64::from(limits.charts),
            found: u64::from(count),
        });
    }
    if base_resolution > PAGE_RESOLUTION {
        return Err(Error::Value {
            what: "base resolution",
            found: u64::from(base_resolution),
        });
    }
    let decoded = u64::from(count)
        .saturating_mul(21)
        .saturating_add(u64::from(error_bytes));
    if decoded > limits.section_bytes {
        return Err(Error::Limit {
            what: WHAT,
            limit: limits.section_bytes,
            found: decoded,
        });
    }
    let data = packing::unpack(
        WHAT,
        method,
        cursor.rest(),
        usize::try_from(decoded).unwrap_or(usize::MAX),
    )?;
    let mut cursor = Cursor::new(WHAT, &data);
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    let codes = cursor.take(count.saturating_mul(4))?;
    let deltas = cursor.take(count.saturating_mul(16))?;
    let resolutions = cursor.take(count)?;
    let errors = cursor.rest();

    let glue = read_glue(count, codes, deltas)?;
    let error_count = errors.len() / 2;
    let (low, high) = errors.split_at(error_count);
    let mut errors = low
        .iter()
        .zip(high)
        .map(|(&low, &high)| u16::from_le_bytes([low, high]));
    let mut charts = Vec::with_capacity(count);
    let mut read_errors = 0usize;
    for (glue, &resolution) in glue.into_iter().zip(resolutions) {
        if resolution > PAGE_RESOLUTION {
            return Err(Error::Value {
                what: "resolution of a chart",
                found: u64::from(resolution),
            });
        }
        let wanted = usize::from(resolution.min(base_resolution)).saturating_add(1);
        let base_errors: Vec<f32> = errors.by_ref().take(wanted).map(error_from_code).collect();
        read_errors = read_errors.saturating_add(wanted);
        charts.push(Chart {
            glue,
            resolution,
            base_errors,
        });
    }
    let expected = read_errors.saturating_mul(2) as u64;
    if expected != u64::from(error_bytes) {
        return Err(Error::Mismatch {
            what: "errors of the charts",
            expected,
            found: u64::from(error_bytes),
        });
    }
    Ok((charts, base_resolution))
}

/// `codes` by chart and side; `deltas` in four byte planes of the same order.
fn read_glue(count: usize, codes: &[u8], deltas: &[u8]) -> Result<Vec<[Option<Glue>; 4]>, Error> {
    let mut all = Vec::with_capacity(count);
    let plane = |plane: usize, at: usize| {
        let index = plane.saturating_mul(codes.len()).saturating_add(at);
        deltas.get(index).copied().unwrap_or_default()
    };
    for (chart, codes) in codes.chunks_exact(4).enumerate() {
        let mut glue = [None; 4];
        for (side, (&code, slot)) in codes.iter().zip(&mut glue).enumerate() {
            let at = chart.saturating_mul(4).saturating_add(side);
            let delta =
                u32::from_le_bytes([plane(0, at), plane(1, at), plane(2, at), plane(3, at)]);
            *slot = match code {
                OPEN if delta == 0 => None,
                1..=8 => {
                    let neighbour = i64::try_from(chart)
                        .unwrap_or(i64::MAX)
                        .saturating_add(i64::from(unzigzag(delta)));
                    let chart = u32::try_from(neighbour).unwrap_or(u32::MAX);
                    if usize::try_from(chart).unwrap_or(usize::MAX) >= count {
                        return Err(Error::Value {
                            what: "chart of a glue",
                            found: u64::from(chart),
                        });
                    }
                    let code = code.saturating_sub(1);
                    Some(Glue {
                        chart: ChartId(chart),
                        side: Side(code & 3),
                        reversed: code & 4 != 0,
                    })
                }
                _ => {
                    return Err(Error::Value {
                        what: "glue",
                        found: u64::from(code),
                    });
                }
            };
        }
        all.push(glue);
    }
    Ok(all)
}

/// Writes the charts section; `errors` are coded base errors, chart after chart.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "no bytes of a file come here"
)]
pub(crate) fn encode_charts(
    glue: &[[Option<Glue>; 4]],
    resolutions: &[u8],
    errors: &[u16],
    base_resolution: u8,
) -> Result<Vec<u8>, Error> {
    use crate::codec::payload::zigzag;
    let mut data = Vec::new();
    let sides = || glue.iter().flatten();
    data.extend(sides().map(|glue| match glue {
        Some(glue) => 1 + glue.side.0 + 4 * u8::from(glue.reversed),
        None => OPEN,
    }));
    let deltas: Vec<[u8; 4]> = (0u32..)
        .zip(glue)
        .flat_map(|(own, glue)| {
            glue.map(|glue| {
                let delta = glue.map_or(0, |glue| {
                    zigzag(glue.chart.0.wrapping_sub(own).cast_signed())
                });
                delta.to_le_bytes()
            })
        })
        .collect();
    for plane in 0..4 {
        data.extend(deltas.iter().map(|delta| delta[plane]));
    }
    data.extend(resolutions);
    data.extend(errors.iter().map(|error| error.to_le_bytes()[0]));
    data.extend(errors.iter().map(|error| error.to_le_bytes()[1]));
    let (method, packed) = packing::pack(&data)?;
    let mut out = u32::try_from(glue.len())
        .unwrap_or(u32::MAX)
        .to_le_bytes()
        .to_vec();
    out.extend([base_resolution, method as u8, 0, 0]);
    out.extend(
        u32::try_from(2 * errors.len())
            .unwrap_or(u32::MAX)
            .to_le_bytes(),
    );
    out.extend(packed);
    Ok(out)
}
