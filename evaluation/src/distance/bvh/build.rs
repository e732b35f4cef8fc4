//! Building the tree: binned surface-area heuristic along the longest axis, top down.
//!
//! Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007.
//! Differs: below [`HEURISTIC_DEPTH`] levels it splits at the median, which bounds the depth for any input.

use super::{Bvh, Frame, Node};
use crate::distance::MeshError;
use glam::DVec3;
use rayon::prelude::*;

/// Levels that the heuristic may use; a balanced tree over 2^31 triangles needs fewer.
const HEURISTIC_DEPTH: u32 = 40;
/// Deepest tree: median splits from 2^31 triangles down to a leaf come below the heuristic's levels.
pub(super) const MAX_DEPTH: usize = HEURISTIC_DEPTH as usize + 31;
/// Most triangles of a leaf.
const LEAF: usize = 4;
const BINS: usize = 16;
/// Ranges shorter than this are built by one thread.
const PARALLEL: usize = 8192;

/// A triangle while the tree is built: its box in the frame, and its index in the input.
#[derive(Debug, Clone, Copy)]
struct Item {
    bounds: Box3,
    triangle: u32,
}

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

    /// Half the surface; 0 when empty.
    fn area(self) -> f32 {
        let [x, y, z] = std::array::from_fn(|axis| (self.max[axis] - self.min[axis]).max(0.0));
        x * y + y * z + z * x
    }

    /// Twice the centre.
    fn centre2(self, axis: usize) -> f32 {
        self.min[axis] + self.max[axis]
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
    let mut items: Vec<Item> = triangles
        .par_iter()
        .enumerate()
        .map(|(triangle, corners)| {
            let corners = corners.map(|vertex| frame.apply(positions[vertex as usize]));
            Item {
                bounds: Box3::around(corners),
                triangle: id(triangle),
            }
        })
        .collect();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        append(&mut nodes, &mut items, 0, HEURISTIC_DEPTH);
    }

    let mut moved_to = vec![u32::MAX; positions.len()];
    let mut ordered = Vec::with_capacity(positions.len());
    let mut reordered = Vec::with_capacity(items.len());
    for item in &items {
        reordered.push(triangles[item.triangle as usize].map(|vertex| {
            let place = &mut moved_to[vertex as usize];
            if *place == u32::MAX {
                *place = id(ordered.len());
                ordered.push(positions[vertex as usize]);
            }
            *place
        }));
    }
    let input_index = items.iter().map(|item| item.triangle).collect();
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

/// Appends the tree over `items`, which are not empty, at the end of `nodes`; `offset` is the place of the
/// first item among all.
fn append(nodes: &mut Vec<Node>, items: &mut [Item], offset: usize, depth: u32) {
    let root = nodes.len();
    nodes.push(Node::default());
    let middle = if items.len() > 1 {
        split(items, depth)
    } else {
        0
    };
    let parallel = items.len() > PARALLEL;
    let depth = depth.saturating_sub(1);
    let (left, right) = items.split_at_mut(middle);
    if left.is_empty() {
        // A single triangle fills both children; looking at it twice does no harm.
        set_leaf(&mut nodes[root], 0, right, offset);
        set_leaf(&mut nodes[root], 1, right, offset);
        return;
    }
    if parallel {
        let build = |items: &mut [Item], offset| {
            let mut nodes = Vec::new();
            let bounds = subtree(&mut nodes, items, offset, depth);
            (nodes, bounds)
        };
        let (left, right) = rayon::join(|| build(left, offset), || build(right, offset + middle));
        for (child, (mut subtree, reference)) in [left, right].into_iter().enumerate() {
            let shift = id(nodes.len());
            for (first, count) in subtree
                .iter_mut()
                .flat_map(|node| node.first.iter_mut().zip(node.count))
            {
                *first += if count == 0 { shift } else { 0 };
            }
            let first = if reference.count == 0 {
                reference.first + shift
            } else {
                reference.first
            };
            set_child(&mut nodes[root], child, Reference { first, ..reference });
            nodes.append(&mut subtree);
        }
    } else {
        let reference = subtree(nodes, left, offset, depth);
        set_child(&mut nodes[root], 0, reference);
        let reference = subtree(nodes, right, offset + middle, depth);
        set_child(&mut nodes[root], 1, reference);
    }
}

/// What a node says of one child.
#[derive(Debug, Clone, Copy)]
struct Reference {
    bounds: Box3,
    first: u32,
    count: u32,
}

fn subtree(nodes: &mut Vec<Node>, items: &mut [Item], offset: usize, depth: u32) -> Reference {
    if items.len() <= LEAF {
        return Reference {
            bounds: bounds(items),
            first: id(offset),
            count: id(items.len()),
        };
    }
    let reference = Reference {
        bounds: bounds(items),
        first: id(nodes.len()),
        count: 0,
    };
    append(nodes, items, offset, depth);
    reference
}

fn set_leaf(node: &mut Node, child: usize, items: &[Item], offset: usize) {
    let reference = Reference {
        bounds: bounds(items),
        first: id(offset),
        count: id(items.len()),
    };
    set_child(node, child, reference);
}

fn set_child(node: &mut Node, child: usize, reference: Reference) {
    for axis in 0..3 {
        node.min[axis][child] = reference.bounds.min[axis];
        node.max[axis][child] = reference.bounds.max[axis];
    }
    node.first[child] = reference.first;
    node.count[child] = reference.count;
}

fn bounds(items: &[Item]) -> Box3 {
    items
        .iter()
        .fold(Box3::EMPTY, |all, item| all.union(item.bounds))
}

/// Reorders at least two items and says where to cut them; both parts hold at least one.
fn split(items: &mut [Item], depth: u32) -> usize {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for item in items.iter() {
        for axis in 0..3 {
            let centre = item.bounds.centre2(axis);
            min[axis] = min[axis].min(centre);
            max[axis] = max[axis].max(centre);
        }
    }
    let extent: [f32; 3] = std::array::from_fn(|axis| max[axis] - min[axis]);
    let axis = (0..3)
        .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
        .unwrap_or(0);
    let median = items.len() / 2;
    if depth == 0 || extent[axis] <= 0.0 {
        let key = |item: &Item| item.bounds.centre2(axis);
        items.select_nth_unstable_by(median, |a, b| {
            key(a).total_cmp(&key(b)).then(a.triangle.cmp(&b.triangle))
        });
        return median;
    }

    let bins_per_length = BINS as f32 / extent[axis];
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, then clamped"
    )]
    let bin = |item: &Item| {
        (((item.bounds.centre2(axis) - min[axis]) * bins_per_length) as usize).min(BINS - 1)
    };
    let mut bins = [(Box3::EMPTY, 0_usize); BINS];
    for item in items.iter() {
        let (bounds, count) = &mut bins[bin(item)];
        *bounds = bounds.union(item.bounds);
        *count += 1;
    }
    let cut = cheapest_cut(&bins);
    let middle = partition(items, |item| bin(item) < cut);
    // The first and the last bin are never empty, but bins of a denormal extent are not to be trusted.
    if middle == 0 || middle == items.len() {
        median
    } else {
        middle
    }
}

/// First bin of the right part.
fn cheapest_cut(bins: &[(Box3, usize); BINS]) -> usize {
    let mut right_cost = [0.0; BINS];
    let (mut all, mut count) = (Box3::EMPTY, 0);
    for cut in (1..BINS).rev() {
        all = all.union(bins[cut].0);
        count += bins[cut].1;
        right_cost[cut] = all.area() * count as f32;
    }
    let (mut best, mut best_cost) = (BINS / 2, f32::INFINITY);
    let (mut all, mut count) = (Box3::EMPTY, 0);
    for cut in 1..BINS {
        all = all.union(bins[cut - 1].0);
        count += bins[cut - 1].1;
        let cost = all.area() * count as f32 + right_cost[cut];
        if cost < best_cost {
            (best, best_cost) = (cut, cost);
        }
    }
    best
}

/// Moves the items that are `left` to the front and counts them.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for index in 0..items.len() {
        if left(&items[index]) {
            items.swap(index, middle);
            middle += 1;
        }
    }
    middle
}

/// An index below 2^31, as [`build`] has checked.
#[expect(
    clippy::cast_possible_truncation,
    reason = "checked where the build starts"
)]
fn id(index: usize) -> u32 {
    index as u32
}
