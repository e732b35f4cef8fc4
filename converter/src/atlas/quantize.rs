//! From surface samples in world units to the integers that the file stores.

use crate::resample::Grid;
use glam::DVec3;
use marquetry_format::lattice::LATTICE_BITS;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::writer::{ChartInput, NodeInput};
use marquetry_format::{Lattice, PageSamples};

/// Distance between stored positions, in targets: rounding to it adds 0.29 of it along the normal to a sample and half
/// of that, squared, to the surface between; a finer one spends bytes on noise.
const STEP: f64 = 1.4;

/// The lattice of a model with bounds `min`..`max`, whose stored positions are `STEP` `target`s apart (a length), or as
/// far apart as the lattice is fine or coarse enough for.
pub fn lattice(min: DVec3, max: DVec3, target: f64) -> Lattice {
    let size = (max - min).max_element();
    let cells = f64::from((1u32 << LATTICE_BITS) - 1);
    // A model that is one point still needs a lattice with extent.
    let finest = if size > 0.0 {
        size / cells
    } else {
        1.0 / cells
    };
    let step = STEP * target;
    let mut shift = 0u8;
    while shift < 15 && finest * f64::from(2u32 << shift) <= step {
        shift += 1;
    }
    // Rounding up to a multiple of 2^shift must not leave the lattice.
    let cells = cells - f64::from(1u32 << shift);
    let finest = if size > 0.0 { size / cells } else { finest };
    // A lattice may be larger than the model.
    let unit = finest.max(step / f64::from(1u32 << shift));
    Lattice {
        origin: min.to_array(),
        step: if shift < 15 { unit } else { finest },
        shift,
    }
}

/// The lattice point nearest to `position` among the multiples of `2^shift`.
pub fn lattice_from_world(lattice: &Lattice, position: DVec3) -> [u32; 3] {
    let coarse = f64::from(1u32 << lattice.shift);
    let most = f64::from(((1u32 << LATTICE_BITS) - 1) >> lattice.shift);
    let cell = (position - DVec3::from_array(lattice.origin)) / (lattice.step * coarse);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the lattice"
    )]
    let point = cell
        .to_array()
        .map(|c| ((c + 0.5).floor().clamp(0.0, most) as u32) << lattice.shift);
    point
}

/// Quantized samples of a grid of `cells` (a power of two, at most 32) cells a side; colours only when `colours`.
pub fn samples(grid: &Grid, cells: u32, lattice: &Lattice, colours: bool) -> PageSamples {
    PageSamples {
        resolution: u8::try_from(cells.trailing_zeros()).unwrap_or(u8::MAX),
        positions: grid
            .positions
            .iter()
            .map(|&p| lattice_from_world(lattice, p))
            .collect(),
        normals: grid
            .attributes
            .iter()
            .map(|a| marquetry_format::octahedral::encode(a.normal.to_array()))
            .collect(),
        colours: if colours {
            grid.attributes
                .iter()
                .map(|a| super::colour::srgb_from_linear(a.colour))
                .collect()
        } else {
            Vec::new()
        },
        ..PageSamples::default()
    }
}

/// World positions of quantized samples.
pub fn world_positions(samples: &PageSamples, lattice: &Lattice) -> Vec<DVec3> {
    samples
        .positions
        .iter()
        .map(|&p| lattice.world_from_lattice(p))
        .collect()
}

/// The samples of a node with children: their even ones.
pub fn from_children(children: &[NodeInput; 4]) -> PageSamples {
    fn pick<T: Copy + Default>(children: [&[T]; 4]) -> Vec<T> {
        if children[0].is_empty() {
            return Vec::new();
        }
        let (cells, half) = (1usize << PAGE_RESOLUTION, 1usize << (PAGE_RESOLUTION - 1));
        let side = cells + 1;
        (0..side * side)
            .map(|k| {
                let (i, j) = (k % side, k / side);
                let (right, upper) = (usize::from(i > half), usize::from(j > half));
                let (i, j) = (2 * (i - right * half), 2 * (j - upper * half));
                children[2 * upper + right]
                    .get(j * side + i)
                    .copied()
                    .unwrap_or_default()
            })
            .collect()
    }
    let [a, b, c, d] = children.each_ref().map(|child| &child.samples);
    PageSamples {
        resolution: PAGE_RESOLUTION,
        positions: pick([&a.positions, &b.positions, &c.positions, &d.positions]),
        normals: pick([&a.normals, &b.normals, &c.normals, &d.normals]),
        colours: pick([&a.colours, &b.colours, &c.colours, &d.colours]),
        ..PageSamples::default()
    }
}

/// Finest resolution at or below a node: log2 of the cells a chart side.
pub fn finest_resolution(node: &NodeInput) -> u8 {
    node.children
        .iter()
        .flat_map(|c| c.iter())
        .map(|child| 1 + finest_resolution(child))
        .max()
        .unwrap_or(0)
        .max(if node.children.is_some() {
            0
        } else {
            node.samples.resolution
        })
}

/// Appends a grid's triangles, in world units.
pub(super) fn append_mesh(
    samples: &PageSamples,
    lattice: &Lattice,
    positions: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
) {
    let first = u32::try_from(positions.len()).unwrap_or(u32::MAX);
    positions.extend(world_positions(samples, lattice));
    let side = u32::try_from(samples.side()).unwrap_or(u32::MAX);
    for j in 0..side - 1 {
        for i in 0..side - 1 {
            let a = first + j * side + i;
            triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
        }
    }
}

/// All leaf nodes as one triangle mesh in world units; borders between nodes are not joined.
pub fn finest_surface(charts: &[ChartInput], lattice: &Lattice) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut stack: Vec<&NodeInput> = charts.iter().map(|c| &c.root).collect();
    while let Some(node) = stack.pop() {
        if let Some(children) = &node.children {
            stack.extend(children.iter());
            continue;
        }
        append_mesh(&node.samples, lattice, &mut positions, &mut triangles);
    }
    (positions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_of_the_bounds_are_on_the_lattice() {
        for step in [0.0, 1e-4, 1e-3, 0.1] {
            let (min, max) = (DVec3::new(-3.0, 5.0, 1e7), DVec3::new(7.0, 6.0, 1e7 + 2.0));
            let lattice = lattice(min, max, step);
            for p in [min, max] {
                let q = lattice.world_from_lattice(lattice_from_world(&lattice, p));
                let slack = 0.5 * lattice.step * f64::from(1u32 << lattice.shift) + 1e-8;
                assert!((p - q).abs().max_element() <= slack, "{p} {q} {step}");
            }
        }
    }

    #[test]
    fn a_point_has_a_lattice() {
        let lattice = lattice(DVec3::ONE, DVec3::ONE, 0.0);
        assert!(lattice.step > 0.0);
        assert_eq!(lattice_from_world(&lattice, DVec3::ONE), [0, 0, 0]);
    }
}
