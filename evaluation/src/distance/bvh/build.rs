//! Building the tree: triangles sorted along a Morton curve, cut where the highest bit of their codes changes.
//!
//! Lauterbach, Garland, Sengupta, Luebke & Manocha, "Fast BVH Construction on GPUs", 2009. A tree by the surface-area
//! heuristic answers faster and takes much longer to build; the trees here answer less than one question a triangle.
//! Limit: triangles whose centres share a code of 48 bits are cut in halves in the order of the input.

use super::{Bvh, Frame, Node};
use crate::distance::MeshError;
use glam::DVec3;
use rayon::prelude::*;

/// Bits of a code, of each axis.
const AXIS_BITS: u32 = 16;
/// Deepest tree: one level a bit, then halves of what shares a code.
pub(super) const MAX_DEPTH: usize = 3 * AXIS_BITS as usize + 31;
/// Most triangles of a leaf.
const LEAF: usize = 4;
/// Ranges shorter than this are built by one thread.
const PARALLEL: usize = 8192;

/// A triangle while the tree is built: the Morton code of its centre, and its index in the input.
type Item = (u64, u32);

#[derive(Debug, Clone, Copy)]
struct Box3 {
    min: [f32; 3],
    max: [f32; 3],
}

impl Box3 {
    const EMPTY: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    fn around(corners: [DVec3; 3]) -> Self {
        let min = corners[0].min(corners[1]).min(corners[2]);
        let max = corners[0].max(corners[1]).max(corners[2]);
        Self {
            min: min.to_array().map(round_down),
            max: max.to_array().map(round_up),
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            min: std::array::from_fn(|axis| self.min[axis].min(other.min[axis])),
            max: std::array::from_fn(|axis| self.max[axis].max(other.max[axis])),
        }
    }
}

/// One step farther out than the nearest `f32`, so that the rounding of the frame change is covered too.
#[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
fn round_down(x: f64) -> f32 {
    (x as f32).next_down()
}

#[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
fn round_up(x: f64) -> f32 {
    (x as f32).next_up()
}

pub(super) fn build(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Bvh, MeshError> {
    let count = triangles.len().max(positions.len());
    if count >= 1 << 31 {
        return Err(MeshError::TooLarge { count });
    }
    let frame = frame(positions, triangles)?;
    let place = |&corners: &[u32; 3]| corners.map(|vertex| frame.apply(positions[vertex as usize]));
    let mut items: Vec<Item> = triangles
        .par_iter()
        .enumerate()
        .map(|(triangle, corners)| (code(place(corners)), id(triangle)))
        .collect();
    items.par_sort_unstable();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        let source = Source {
            items: &items,
            bounds: &|triangle| Box3::around(place(&triangles[triangle as usize])),
        };
        source.append(&mut nodes, 0, items.len());
    }

    let mut moved_to = vec![u32::MAX; positions.len()];
    let mut ordered = Vec::with_capacity(positions.len());
    let mut reordered = Vec::with_capacity(items.len());
    for &(_, triangle) in &items {
        reordered.push(triangles[triangle as usize].map(|vertex| {
            let place = &mut moved_to[vertex as usize];
            if *place == u32::MAX {
                *place = id(ordered.len());
                ordered.push(positions[vertex as usize]);
            }
            *place
        }));
    }
    let input_index = items.into_iter().map(|(_, triangle)| triangle).collect();
    Ok(Bvh {
        nodes,
        frame,
        positions: ordered,
        triangles: reordered,
        input_index,
    })
}

/// Checks the mesh and finds its frame.
fn frame(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Frame, MeshError> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (triangle, corners) in triangles.iter().enumerate() {
        for &vertex in corners {
            let Some(&position) = positions.get(vertex as usize) else {
                return Err(MeshError::IndexOutOfRange {
                    triangle,
                    vertex,
                    vertices: positions.len(),
                });
            };
            if !position.is_finite() {
                return Err(MeshError::NotFinite { triangle, vertex });
            }
            min = min.min(position);
            max = max.max(position);
        }
    }
    if triangles.is_empty() {
        return Ok(Frame {
            centre: DVec3::ZERO,
            scale: 1.0,
        });
    }
    let extent = (max - min).max_element();
    // The exponent alone: the power of two next below.
    let power = f64::from_bits(extent.to_bits() & (0x7ff << 52));
    let scale = if power.is_normal() {
        power.recip()
    } else {
        1.0
    };
    Ok(Frame {
        centre: min * 0.5 + max * 0.5,
        scale,
    })
}

/// The Morton code of a triangle's centre, in the frame, where coordinates are within -1..=1.
fn code(corners: [DVec3; 3]) -> u64 {
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    let cells = f64::from((1_u32 << AXIS_BITS) - 1);
    let axis = |c: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a cell"
        )]
        let cell = (f64::midpoint(c, 1.0) * cells).clamp(0.0, cells) as u64;
        spread(cell)
    };
    axis(centre.x) << 2 | axis(centre.y) << 1 | axis(centre.z)
}

/// The lowest 16 bits, with two zeros before each.
fn spread(bits: u64) -> u64 {
    let mut x = bits & 0xffff;
    x = (x | x << 16) & 0x0000_0000_ff00_00ff;
    x = (x | x << 8) & 0x0000_00f0_0f00_f00f;
    x = (x | x << 4) & 0x0000_0c30_c30c_30c3;
    (x | x << 2) & 0x0000_2492_4924_9249
}

/// What the tree is built over.
struct Source<'a> {
    /// In the order of their codes.
    items: &'a [Item],
    bounds: &'a (dyn Fn(u32) -> Box3 + Sync),
}

impl Source<'_> {
    /// Appends the tree over the items `from..to`, which are not empty, at the end of `nodes`.
    fn append(&self, nodes: &mut Vec<Node>, from: usize, to: usize) -> Box3 {
        let root = nodes.len();
        nodes.push(Node::default());
        if to - from == 1 {
            // A single triangle fills both children; looking at it twice does no harm.
            let leaf = self.leaf(from, to);
            set_child(&mut nodes[root], 0, leaf);
            set_child(&mut nodes[root], 1, leaf);
            return leaf.bounds;
        }
        let middle = self.split(from, to);
        let references = if to - from > PARALLEL {
            let build = |from, to| {
                let mut nodes = Vec::new();
                let reference = self.subtree(&mut nodes, from, to);
                (nodes, reference)
            };
            let (left, right) = rayon::join(|| build(from, middle), || build(middle, to));
            [left, right].map(|(mut subtree, mut reference)| {
                let shift = id(nodes.len());
                for (first, count) in subtree
                    .iter_mut()
                    .flat_map(|node| node.first.iter_mut().zip(node.count))
                {
                    *first += if count == 0 { shift } else { 0 };
                }
                reference.first += if reference.count == 0 { shift } else { 0 };
                nodes.append(&mut subtree);
                reference
            })
        } else {
            [
                self.subtree(nodes, from, middle),
                self.subtree(nodes, middle, to),
            ]
        };
        for (child, reference) in references.into_iter().enumerate() {
            set_child(&mut nodes[root], child, reference);
        }
        references[0].bounds.union(references[1].bounds)
    }

    fn subtree(&self, nodes: &mut Vec<Node>, from: usize, to: usize) -> Reference {
        if to - from <= LEAF {
            return self.leaf(from, to);
        }
        let first = id(nodes.len());
        let bounds = self.append(nodes, from, to);
        Reference {
            bounds,
            first,
            count: 0,
        }
    }

    fn leaf(&self, from: usize, to: usize) -> Reference {
        let boxes = self.items[from..to]
            .iter()
            .map(|item| (self.bounds)(item.1));
        Reference {
            bounds: boxes.fold(Box3::EMPTY, Box3::union),
            first: id(from),
            count: id(to - from),
        }
    }

    /// Where to cut at least two items; both parts hold at least one.
    fn split(&self, from: usize, to: usize) -> usize {
        let items = &self.items[from..to];
        let (first, last) = (items[0].0, items[items.len() - 1].0);
        if first == last {
            return usize::midpoint(from, to);
        }
        let highest = (first ^ last).ilog2();
        from + items.partition_point(|item| item.0 >> highest & 1 == 0)
    }
}

/// What a node says of one child.
#[derive(Debug, Clone, Copy)]
struct Reference {
    bounds: Box3,
    first: u32,
    count: u32,
}

fn set_child(node: &mut Node, child: usize, reference: Reference) {
    for axis in 0..3 {
        node.min[axis][child] = reference.bounds.min[axis];
        node.max[axis][child] = reference.bounds.max[axis];
    }
    node.first[child] = reference.first;
    node.count[child] = reference.count;
}

/// An index below 2^31, as [`build`] has checked.
#[expect(
    clippy::cast_possible_truncation,
    reason = "checked where the build starts"
)]
fn id(index: usize) -> u32 {
    index as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_all_bits() {
        for bit in 0..AXIS_BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(u64::MAX).count_ones(), AXIS_BITS);
        assert_eq!(code([DVec3::ONE; 3]), (1 << (3 * AXIS_BITS)) - 1);
        assert_eq!(code([DVec3::NEG_ONE; 3]), 0);
    }
}
