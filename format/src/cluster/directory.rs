//! The cluster section: the facts of all nodes, and the mesh of the root.

use super::graph::{JOINS, graph};
use super::mesh::{self, Counts};
use super::{ClusterMesh, ClusterNode, Clusters};
use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::codec::page::Coding;
use crate::codec::payload::unzigzag;
use crate::header::{Section, checksum};
use crate::index::quantize::BoundsCode;
use crate::{Bounds, Error, LatticePoint, Limits};

const WHAT: &str = "clusters";
/// Bytes before the checksums.
pub(crate) const HEAD_BYTES: usize = 36;
/// Bytes of the facts of one node that every file has.
const FACT_BYTES: usize = 21;
/// Set where the upper bytes of the numbers of children follow these.
const MORE_CHILDREN: u8 = 1;
/// Set where the lengths of texels follow.
const TEXELS: u8 = 2;
/// Set where it follows which group a node joins, three bytes each.
const GROUPS: u8 = 4;
/// Codes of a length of texels to a factor of two.
const TEXEL_STEPS: f32 = 8.0;
/// log2 of the length, in lattice units, that the first code stands for.
const LEAST_TEXEL: f32 = -6.0;

/// The stored facts of one node, beside its checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Facts {
    /// [`JOINS`] for a node that joins a group.
    pub(crate) children: u16,
    /// With [`JOINS`], the groups that were begun after the one that it joins, 24 bits; else 0.
    pub(crate) back: u32,
    /// 24 bits; 0 for the root, whose mesh ends the section.
    pub(crate) length: u32,
    /// Less 1.
    pub(crate) vertices: u8,
    /// Less 1.
    pub(crate) triangles: u8,
    pub(crate) error: u16,
    pub(crate) bounds: BoundsCode,
    /// As [`texel_code`] makes it; 0 without a texture.
    pub(crate) texel: u8,
}

/// The code of the least length of texels that is not below `texel`, lattice units.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn texel_code(texel: f32) -> u8 {
    let steps = ((texel.log2() - LEAST_TEXEL) * TEXEL_STEPS).ceil();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped; NaN becomes 0"
    )]
    let code = (steps + 1.0).clamp(1.0, 255.0) as u8;
    code.max(1)
}

pub(super) fn texel_from_code(code: u8) -> Option<f32> {
    let steps = code.checked_sub(1)?;
    Some((f32::from(steps) / TEXEL_STEPS + LEAST_TEXEL).exp2())
}

/// The parts of `section` that the content id covers: everything but the checksums, which depend on it.
pub(crate) fn content_of(section: &[u8]) -> [&[u8]; 2] {
    let count = section
        .first_chunk::<4>()
        .map_or(0, |count| u32::from_le_bytes(*count));
    let checksums = usize::try_from(count)
        .unwrap_or(usize::MAX)
        .saturating_mul(4);
    let head = HEAD_BYTES.min(section.len());
    let rest = head.saturating_add(checksums).min(section.len());
    [
        section.get(..head).unwrap_or_default(),
        section.get(rest..).unwrap_or_default(),
    ]
}

/// Reads `bytes`, those of the section `own`, whose other meshes are in `pages`.
pub(crate) fn decode(
    coding: Coding,
    bytes: &[u8],
    own: &Section,
    pages: &Section,
    content_id: &[u8; 16],
    limits: &Limits,
) -> Result<Clusters, Error> {
    let mut cursor = Cursor::new(WHAT, bytes);
    let count = cursor.u32()?;
    let packed_length = cursor.u32()?;
    let part_bytes = [cursor.u64()?, cursor.u64()?, cursor.u64()?];
    let method = Method::from_code(WHAT, cursor.u8()?)?;
    let more_planes = cursor.u8()?;
    let reserved = [cursor.u8()?, cursor.u8()?];
    if more_planes & !(MORE_CHILDREN | TEXELS | GROUPS) != 0 || reserved != [0; 2] {
        let [b, c] = reserved;
        return Err(Error::Reserved {
            what: WHAT,
            value: u64::from(u32::from_le_bytes([more_planes, b, c, 0])),
        });
    }
    let fact_bytes = planes(more_planes);
    if count == 0 {
        return Err(Error::Value {
            what: "number of clusters",
            found: 0,
        });
    }
    if count > limits.clusters {
        return Err(Error::Limit {
            what: WHAT,
            limit: u64::from(limits.clusters),
            found: u64::from(count),
        });
    }
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    let checksums = cursor.take(count.saturating_mul(4))?;
    let packed = cursor.take(usize::try_from(packed_length).unwrap_or(usize::MAX))?;
    let root_bytes = cursor.rest();
    let data = packing::unpack(WHAT, method, packed, count.saturating_mul(fact_bytes))?;
    let facts = read_facts(&data, count, more_planes)?;

    let (mut nodes, groups) = graph(&facts, checksums)?;
    let root_start = own.range.end.saturating_sub(root_bytes.len() as u64);
    let mut offset = pages.range.start;
    for (index, (node, facts)) in nodes.iter_mut().zip(&facts).enumerate() {
        if index == 0 {
            node.range = root_start..own.range.end;
            if facts.length != 0 {
                return Err(Error::Value {
                    what: "length of the root cluster",
                    found: u64::from(facts.length),
                });
            }
            continue;
        }
        if facts.length == 0 || facts.length > limits.page_bytes {
            return Err(Error::Limit {
                what: "bytes of a cluster",
                limit: u64::from(limits.page_bytes),
                found: u64::from(facts.length),
            });
        }
        node.range = offset..offset.saturating_add(u64::from(facts.length));
        offset = node.range.end;
    }
    if offset != pages.range.end {
        return Err(Error::Mismatch {
            what: "end of the clusters",
            expected: pages.range.end,
            found: offset,
        });
    }
    let stored = pages.length().saturating_add(root_bytes.len() as u64);
    let parts = part_bytes
        .iter()
        .fold(0u64, |sum, &part| sum.saturating_add(part));
    if parts != stored {
        return Err(Error::Mismatch {
            what: "bytes of all clusters",
            expected: stored,
            found: parts,
        });
    }
    let Some(root) = nodes.first() else {
        return Err(Error::Value {
            what: "number of clusters",
            found: 0,
        });
    };
    let root = decode_node(coding, root, content_id, root_bytes)?;
    Ok(Clusters {
        nodes,
        groups,
        root,
        part_bytes,
    })
}

/// Checks and decodes the mesh of `node`.
pub(crate) fn decode_node(
    coding: Coding,
    node: &ClusterNode,
    content_id: &[u8; 16],
    bytes: &[u8],
) -> Result<ClusterMesh, Error> {
    check_node(node, content_id, bytes)?;
    let counts = Counts {
        vertices: usize::from(node.vertices),
        triangles: usize::from(node.triangles),
    };
    let mesh = mesh::decode(coding, counts, bytes)?;
    if mesh.texture.is_some() != node.texel.is_some() {
        return Err(Error::Value {
            what: "texture of a cluster",
            found: u64::from(mesh.texture.is_some()),
        });
    }
    match mesh
        .positions
        .iter()
        .find(|point| !holds(&node.bounds, point))
    {
        None => Ok(mesh),
        Some([x, _, _]) => Err(Error::Value {
            what: "vertex outside the bounds of its cluster",
            found: u64::from(*x),
        }),
    }
}

/// Refuses bytes that are not those of `node`.
pub(crate) fn check_node(
    node: &ClusterNode,
    content_id: &[u8; 16],
    bytes: &[u8],
) -> Result<(), Error> {
    let expected = node.range.end.saturating_sub(node.range.start);
    let found = bytes.len() as u64;
    match found.cmp(&expected) {
        std::cmp::Ordering::Less => {
            return Err(Error::Truncated {
                what: "cluster",
                expected,
                found,
            });
        }
        std::cmp::Ordering::Greater => {
            return Err(Error::TrailingBytes {
                what: "cluster",
                expected,
                found,
            });
        }
        std::cmp::Ordering::Equal => {}
    }
    let computed = checksum(content_id, bytes) & u64::from(u32::MAX);
    let stored = u64::from(node.checksum);
    if computed == stored {
        return Ok(());
    }
    Err(Error::Checksum {
        what: "cluster",
        offset: node.range.start,
        stored,
        computed,
    })
}

pub(super) fn holds(bounds: &Bounds, point: &LatticePoint) -> bool {
    let (min, max) = (bounds.min.iter(), bounds.max.iter());
    min.zip(max)
        .zip(point)
        .all(|((min, max), c)| min <= c && c <= max)
}

/// Planes of the facts where these bits are set.
fn planes(flags: u8) -> usize {
    [(MORE_CHILDREN, 1), (TEXELS, 1), (GROUPS, 3)]
        .iter()
        .filter(|(flag, _)| flags & flag != 0)
        .fold(FACT_BYTES, |sum, &(_, planes)| sum.saturating_add(planes))
}

fn read_facts(data: &[u8], count: usize, more_planes: u8) -> Result<Vec<Facts>, Error> {
    let at = |plane: usize, node: usize| {
        let index = plane.saturating_mul(count).saturating_add(node);
        data.get(index).copied().unwrap_or_default()
    };
    let has_more_children = more_planes & MORE_CHILDREN != 0;
    let texel_plane = planes(more_planes & MORE_CHILDREN);
    let has_groups = more_planes & GROUPS != 0;
    let group_plane = planes(more_planes & (MORE_CHILDREN | TEXELS));
    let mut facts = Vec::with_capacity(count);
    let mut error = 0u16;
    let mut near = [0u32; 3];
    for node in 0..count {
        let more_children = if has_more_children {
            at(FACT_BYTES, node)
        } else {
            0
        };
        let children = u16::from_le_bytes([at(0, node), more_children]);
        if children == JOINS && !has_groups {
            return Err(Error::Value {
                what: "children of a cluster",
                found: u64::from(children),
            });
        }
        let back = [0, 1, 2].map(|byte: usize| at(group_plane.saturating_add(byte), node));
        let [low, middle, high] = if has_groups { back } else { [0; 3] };
        let code = u16::from_le_bytes([at(6, node), at(7, node)]);
        let difference = (code >> 1) ^ (code & 1).wrapping_neg();
        error = error.wrapping_add(difference);
        let shift = at(8, node);
        if shift > 20 {
            return Err(Error::Value {
                what: "bounds shift of a cluster",
                found: u64::from(shift),
            });
        }
        let mut min = [0u32; 3];
        for (axis, (min, near)) in min.iter_mut().zip(&near).enumerate() {
            let plane = |byte: usize| at(axis.saturating_add(byte).saturating_add(9), node);
            let delta = unzigzag(u32::from_le_bytes([plane(0), plane(3), plane(6), 0]));
            let cell = (near >> shift).cast_signed().saturating_add(delta);
            *min = u32::try_from(cell).unwrap_or(u32::MAX);
        }
        let bounds = BoundsCode {
            shift,
            min,
            size: [at(18, node), at(19, node), at(20, node)],
        };
        near = match bounds.bounds() {
            Some(bounds) => bounds.min,
            None => {
                return Err(Error::Value {
                    what: "bounds of a cluster",
                    found: node as u64,
                });
            }
        };
        facts.push(Facts {
            children,
            back: u32::from_le_bytes([low, middle, high, 0]),
            length: u32::from_le_bytes([at(1, node), at(2, node), at(3, node), 0]),
            vertices: at(4, node),
            triangles: at(5, node),
            error,
            bounds,
            texel: if more_planes & TEXELS != 0 {
                at(texel_plane, node)
            } else {
                0
            },
        });
    }
    Ok(facts)
}

pub(super) fn at(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

/// The section up to the checksums, and what follows them.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "no bytes of a file come here"
)]
pub(crate) fn encode(
    facts: &[Facts],
    root: &[u8],
    part_bytes: [u64; 3],
) -> Result<[Vec<u8>; 2], Error> {
    use crate::codec::payload::zigzag;
    let mut planes: [Vec<u8>; FACT_BYTES + 5] = Default::default();
    let mut error = 0u16;
    let mut near = [0u32; 3];
    for facts in facts {
        let [a, b, c, _] = facts.length.to_le_bytes();
        let difference = facts.error.wrapping_sub(error).cast_signed();
        error = facts.error;
        let code = ((difference << 1) ^ (difference >> 15)).cast_unsigned();
        let [e, f] = code.to_le_bytes();
        let shift = facts.bounds.shift;
        let cells: [[u8; 4]; 3] = [0, 1, 2].map(|axis: usize| {
            let before = (near[axis] >> shift).cast_signed();
            zigzag(facts.bounds.min[axis].cast_signed() - before).to_le_bytes()
        });
        near = facts.bounds.min.map(|c| c << shift);
        let [sx, sy, sz] = facts.bounds.size;
        let [children, more_children] = facts.children.to_le_bytes();
        let [low, middle, high, _] = facts.back.to_le_bytes();
        let bytes = [
            children,
            a,
            b,
            c,
            facts.vertices,
            facts.triangles,
            e,
            f,
            shift,
            cells[0][0],
            cells[1][0],
            cells[2][0],
            cells[0][1],
            cells[1][1],
            cells[2][1],
            cells[0][2],
            cells[1][2],
            cells[2][2],
            sx,
            sy,
            sz,
            more_children,
            facts.texel,
            low,
            middle,
            high,
        ];
        for (plane, byte) in planes.iter_mut().zip(bytes) {
            plane.push(byte);
        }
    }
    let mut flags = 0;
    let mut stored = planes[..FACT_BYTES].concat();
    for (plane, flag) in planes[FACT_BYTES..].iter().zip([MORE_CHILDREN, TEXELS]) {
        if plane.iter().any(|&byte| byte > 0) {
            flags |= flag;
            stored.extend(plane);
        }
    }
    if facts.iter().any(|facts| facts.children == JOINS) {
        flags |= GROUPS;
        stored.extend(planes[FACT_BYTES + 2..].concat());
    }
    let (method, packed) = packing::pack(&stored)?;
    let mut head = (facts.len() as u32).to_le_bytes().to_vec();
    head.extend((packed.len() as u32).to_le_bytes());
    head.extend(part_bytes.iter().flat_map(|part| part.to_le_bytes()));
    head.extend([method as u8, flags, 0, 0]);
    debug_assert_eq!(head.len(), HEAD_BYTES);
    Ok([head, [&packed, root].concat()])
}
