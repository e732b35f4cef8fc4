//! One index block: up to 1024 entries, checksums first, then the packed facts.
//!
//! The checksums depend on the content id and do not compress; the facts are part of what the content id is
//! computed from, so they lie apart.

use crate::bytes::Cursor;
use crate::codec::octahedral;
use crate::codec::packing::{self, Method};
use crate::codec::payload::unzigzag;
use crate::index::quantize::{BoundsCode, cosine_from_code, error_from_code};
use crate::index::{NormalCone, PageEntry};
use crate::lattice::LATTICE_BITS;
use crate::quadtree::PAGE_RESOLUTION;
use crate::{Error, Limits};

const WHAT: &str = "index block";
/// Planes of one byte a page: lengths 3, cone 3, bounds shift 1, bounds minimum 9, bounds size 3.
const BYTE_PLANES: usize = 19;

/// What a block's place in the file says about it.
#[derive(Debug, Clone)]
pub(crate) struct BlockPlace<'a> {
    /// First page.
    pub(crate) first_page: u32,
    /// Pages.
    pub(crate) page_count: usize,
    /// Resolutions of those of its pages that are roots; they come first.
    pub(crate) root_resolutions: &'a [u8],
    /// Where its first page starts.
    pub(crate) first_page_offset: u64,
    /// Where its last page ends.
    pub(crate) end_offset: u64,
    /// First child of its first page with children.
    pub(crate) first_child: u32,
    /// One past the last child of its last page with children.
    pub(crate) end_child: u32,
}

/// A decoded block.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) entries: Vec<PageEntry>,
    /// By page: its first child, if it has children.
    pub(crate) first_children: Vec<Option<u32>>,
}

/// Bytes of the facts, decoded.
fn facts_length(place: &BlockPlace<'_>) -> usize {
    let roots = place.root_resolutions.len();
    let root_errors: usize = place
        .root_resolutions
        .iter()
        .map(|&r| usize::from(r) + 1)
        .sum();
    let errors = place
        .page_count
        .saturating_sub(roots)
        .saturating_add(root_errors);
    let bits = place.page_count.div_ceil(8);
    bits.saturating_add(place.page_count.saturating_mul(BYTE_PLANES))
        .saturating_add(errors.saturating_mul(2))
}

/// The part of a block's bytes that the content id covers.
pub(crate) fn facts_of(page_count: usize, bytes: &[u8]) -> &[u8] {
    bytes
        .get(page_count.saturating_mul(4)..)
        .unwrap_or_default()
}

/// The facts, plane by plane.
struct Planes<'a> {
    children: &'a [u8],
    lengths: [&'a [u8]; 3],
    errors: [&'a [u8]; 2],
    axes: [&'a [u8]; 2],
    cosines: &'a [u8],
    shifts: &'a [u8],
    minima: [[&'a [u8]; 3]; 3],
    sizes: [&'a [u8]; 3],
}

impl<'a> Planes<'a> {
    fn new(place: &BlockPlace<'_>, facts: &'a [u8]) -> Result<Self, Error> {
        let n = place.page_count;
        let mut cursor = Cursor::new(WHAT, facts);
        let bits = n.div_ceil(8);
        let other = bits.saturating_add(n.saturating_mul(BYTE_PLANES));
        let errors = facts.len().saturating_sub(other) / 2;
        let children = cursor.take(bits)?;
        let lengths = [cursor.take(n)?, cursor.take(n)?, cursor.take(n)?];
        let errors = [cursor.take(errors)?, cursor.take(errors)?];
        let axes = [cursor.take(n)?, cursor.take(n)?];
        let (cosines, shifts) = (cursor.take(n)?, cursor.take(n)?);
        let mut three = || -> Result<[&'a [u8]; 3], Error> {
            Ok([cursor.take(n)?, cursor.take(n)?, cursor.take(n)?])
        };
        let minima = [three()?, three()?, three()?];
        let sizes = three()?;
        cursor.finish()?;
        Ok(Self {
            children,
            lengths,
            errors,
            axes,
            cosines,
            shifts,
            minima,
            sizes,
        })
    }

    fn has_children(&self, at: usize) -> bool {
        byte(self.children, at / 8) >> (at % 8) & 1 == 1
    }

    fn length(&self, at: usize) -> u32 {
        let [low, middle, high] = self.lengths.map(|plane| byte(plane, at));
        u32::from_le_bytes([low, middle, high, 0])
    }

    fn minimum_delta(&self, at: usize, axis: usize) -> u32 {
        let [low, middle, high] = self
            .minima
            .map(|planes| planes.get(axis).map_or(0, |plane| byte(plane, at)));
        u32::from_le_bytes([low, middle, high, 0])
    }
}

fn byte(plane: &[u8], at: usize) -> u8 {
    plane.get(at).copied().unwrap_or_default()
}

impl Block {
    /// Reads a block whose checksum was checked.
    pub(crate) fn parse(
        place: &BlockPlace<'_>,
        bytes: &[u8],
        limits: &Limits,
    ) -> Result<Self, Error> {
        let n = place.page_count;
        let mut cursor = Cursor::new(WHAT, bytes);
        let checksums = cursor.take(n.saturating_mul(4))?;
        let method = Method::from_code(WHAT, cursor.u8()?)?;
        let facts = packing::unpack(WHAT, method, cursor.rest(), facts_length(place))?;
        let planes = Planes::new(place, &facts)?;
        let unused = place.page_count % 8;
        if unused != 0
            && planes
                .children
                .last()
                .is_some_and(|&last| last >> unused != 0)
        {
            return Err(Error::Reserved {
                what: WHAT,
                value: u64::from(byte(planes.children, n / 8)),
            });
        }
        let mut checksums = Cursor::new(WHAT, checksums);
        let mut block = Self {
            entries: Vec::with_capacity(n),
            first_children: Vec::with_capacity(n),
        };
        let (mut offset, mut child) = (place.first_page_offset, place.first_child);
        let mut errors = ErrorReader {
            planes: planes.errors,
            next: 0,
            before: 0,
        };
        let mut boxes = BoxReader { before: [0; 3] };
        let mut axis = [0u8; 2];
        for at in 0..n {
            let root = place.root_resolutions.get(at).copied();
            let resolution = root.unwrap_or(PAGE_RESOLUTION);
            let length = planes.length(at);
            if length > limits.page_bytes {
                let (limit, found) = (u64::from(limits.page_bytes), u64::from(length));
                return Err(Error::Limit {
                    what: "bytes of a page",
                    limit,
                    found,
                });
            }
            let [u, v] = axis;
            axis = [
                u.wrapping_add(byte(planes.axes[0], at)),
                v.wrapping_add(byte(planes.axes[1], at)),
            ];
            let has_children = planes.has_children(at);
            let page = place
                .first_page
                .saturating_add(u32::try_from(at).unwrap_or(u32::MAX));
            if has_children && (resolution < PAGE_RESOLUTION || child <= page) {
                return Err(Error::Value {
                    what: "page with children",
                    found: u64::from(page),
                });
            }
            block.first_children.push(has_children.then_some(child));
            block.entries.push(PageEntry {
                offset,
                length,
                checksum: checksums.u32()?,
                resolution,
                errors: errors.page(root.map_or(1, |r| usize::from(r).saturating_add(1))),
                cone: NormalCone {
                    axis: octahedral::decode(axis),
                    cos: cosine_from_code(byte(planes.cosines, at)),
                },
                bounds: boxes.page(&planes, at)?,
                has_children,
            });
            offset = offset.saturating_add(u64::from(length));
            child = if has_children {
                child.saturating_add(4)
            } else {
                child
            };
        }
        if offset != place.end_offset {
            return Err(Error::Mismatch {
                what: "end of a block's pages",
                expected: place.end_offset,
                found: offset,
            });
        }
        if child != place.end_child {
            let (expected, found) = (u64::from(place.end_child), u64::from(child));
            return Err(Error::Mismatch {
                what: "end of a block's children",
                expected,
                found,
            });
        }
        Ok(block)
    }
}

/// Errors: each against the one before in the same page, the first against the first of the page before.
struct ErrorReader<'a> {
    planes: [&'a [u8]; 2],
    next: usize,
    before: u16,
}

impl ErrorReader<'_> {
    fn page(&mut self, count: usize) -> Vec<f32> {
        let mut code = self.before;
        let mut errors = Vec::with_capacity(count);
        for k in 0..count {
            let [low, high] = self.planes.map(|plane| byte(plane, self.next));
            let delta = unzigzag(u32::from(u16::from_le_bytes([low, high])));
            // A 16-bit code unfolds to 16 bits.
            code = code.wrapping_add_signed(i16::try_from(delta).unwrap_or_default());
            self.next = self.next.saturating_add(1);
            if k == 0 {
                self.before = code;
            }
            errors.push(error_from_code(code));
        }
        errors
    }
}

/// Bounds: the minimum against that of the page before.
struct BoxReader {
    before: [u32; 3],
}

impl BoxReader {
    fn page(&mut self, planes: &Planes<'_>, at: usize) -> Result<crate::Bounds, Error> {
        let shift = byte(planes.shifts, at);
        let outside = Error::Value {
            what: "bounds of a page",
            found: u64::from(shift),
        };
        if u32::from(shift) >= LATTICE_BITS {
            return Err(outside);
        }
        let mut code = BoundsCode {
            shift,
            min: [0; 3],
            size: planes.sizes.map(|plane| byte(plane, at)),
        };
        for (axis, (min, before)) in code.min.iter_mut().zip(&mut self.before).enumerate() {
            let delta = unzigzag(planes.minimum_delta(at, axis));
            let Some(cell) = (*before >> shift)
                .checked_add_signed(delta)
                .filter(|&cell| cell < 1 << LATTICE_BITS)
            else {
                return Err(outside);
            };
            *min = cell;
            *before = cell.checked_shl(u32::from(shift)).unwrap_or_default();
        }
        code.bounds().ok_or(outside)
    }
}

/// The coded facts of one page.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Debug, Clone)]
pub(crate) struct PageFacts {
    pub(crate) length: u32,
    /// Codes, coarse to fine.
    pub(crate) errors: Vec<u16>,
    pub(crate) axis: [u8; 2],
    pub(crate) cosine: u8,
    pub(crate) bounds: BoundsCode,
    pub(crate) has_children: bool,
}

/// Packs the facts of a block's pages.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "no bytes of a file come here"
)]
pub(crate) fn encode_facts(pages: &[PageFacts]) -> Result<Vec<u8>, Error> {
    use crate::codec::payload::zigzag;
    let mut facts = vec![0u8; pages.len().div_ceil(8)];
    for (at, page) in pages.iter().enumerate() {
        facts[at / 8] |= u8::from(page.has_children) << (at % 8);
    }
    for plane in 0..3 {
        facts.extend(pages.iter().map(|page| page.length.to_le_bytes()[plane]));
    }
    let mut deltas = Vec::new();
    let mut before = 0u16;
    for page in pages {
        let mut code = before;
        for (k, &error) in page.errors.iter().enumerate() {
            // Wraps to 16 bits, as the reader does.
            let delta = error.wrapping_sub(code).cast_signed();
            deltas.push((zigzag(i32::from(delta)) as u16).to_le_bytes());
            code = error;
            if k == 0 {
                before = error;
            }
        }
    }
    for plane in 0..2 {
        facts.extend(deltas.iter().map(|delta| delta[plane]));
    }
    for component in 0..2 {
        let mut before = 0u8;
        facts.extend(pages.iter().map(|page| {
            let delta = page.axis[component].wrapping_sub(before);
            before = page.axis[component];
            delta
        }));
    }
    facts.extend(pages.iter().map(|page| page.cosine));
    facts.extend(pages.iter().map(|page| page.bounds.shift));
    let mut before = [0u32; 3];
    let mut minima = Vec::new();
    for page in pages {
        let BoundsCode { shift, min, .. } = page.bounds;
        minima.push([0, 1, 2].map(|axis: usize| {
            let delta = min[axis].wrapping_sub(before[axis] >> shift).cast_signed();
            zigzag(delta).to_le_bytes()
        }));
        before = min.map(|cell| cell << shift);
    }
    for plane in 0..3 {
        for axis in 0..3 {
            facts.extend(minima.iter().map(|delta| delta[axis][plane]));
        }
    }
    for axis in 0..3 {
        facts.extend(pages.iter().map(|page| page.bounds.size[axis]));
    }
    let (method, packed) = packing::pack(&facts)?;
    let mut out = vec![method as u8];
    out.extend(packed);
    Ok(out)
}
