//! One cluster in place of several.
//!
//! Three ways are tried, and the one with the least distance to what it stands for is taken: quadric edge collapse that drops
//! whole parts as it goes (Garland & Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997; meshoptimizer),
//! vertex clustering (Rossignac & Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993;
//! meshoptimizer's sloppy simplification), and leaving out all but the largest triangles.
//! Vertices keep their positions, so all stay on the lattice. Where some of them are to stay, only the collapse will do, which then minds
//! normals as well (Hoppe, "New Quadric Metric for Simplifying Meshes with Appearance Attributes", 1999; meshoptimizer); the others are
//! fitted afterwards to what they stand for ([`mod@crate::mesh::refit`]), up to the lattice.

use super::Room;
use super::became::Became;
use super::bound::{self, Target, hausdorff};
use super::local::Link;
use super::shape::{Shape, point};
use super::trace::traced;
use crate::mesh::refit::{Cloud, Refit, refit};
use crate::mesh::{WeldedMesh, bounds};
use glam::DVec3;
use marquetry_evaluation::distance::Mesh;
use marquetry_format::cluster::MAX_CLUSTER_TRIANGLES;
use marquetry_format::{LatticePoint, octahedral};
use meshopt::{
    SimplifyOptions, VertexDataAdapter, simplify, simplify_sloppy,
    simplify_with_attributes_and_locks, typed_to_bytes,
};
use std::collections::HashMap;

/// Triangles asked for (all, where there are fewer), until few enough vertices are left as well.
const TARGETS: [usize; 6] = [MAX_CLUSTER_TRIANGLES, 192, 128, 96, 64, 32];

/// Points that what stands for a group is fitted to, by its triangles.
const FITTED_TO: usize = 16;

/// A mesh that fits a cluster in place of `shape`, and the bound of the distance between them, lattice units.
pub fn simplified(shape: &Shape, room: Room) -> (Shape, f64) {
    if shape.fits(room) {
        return (shape.clone(), 0.0);
    }
    let positions = shape.positions();
    let mut best: Option<(Shape, f64)> = None;
    let ways: [fn(&Shape, usize) -> Shape; 3] = [collapse, merge_cells, largest];
    for way in ways {
        let fitting = TARGETS
            .iter()
            .map(|&target| way(shape, target))
            .find(|shape| shape.fits(room));
        let Some(candidate) = fitting else { continue };
        let most = best.as_ref().map_or(f64::INFINITY, |(_, error)| *error);
        let own = candidate.positions();
        let error = hausdorff(
            (&own, &candidate.triangles),
            (&positions, &shape.triangles),
            most,
        );
        if best.is_none() || error < most {
            best = Some((candidate, error));
        }
    }
    // The largest triangle alone always fits.
    best.unwrap_or_else(|| (largest(shape, 1), f64::INFINITY))
}

/// What stands for a shape.
pub(super) struct Simplified {
    pub(super) shape: Shape,
    /// Integral of the squared distance over the shape, lattice units to the fourth power.
    pub(super) squares: f64,
    /// How far its triangles are from those of the shape, which are the children's.
    pub(super) links: Vec<Link>,
    /// What the shape's vertices have become.
    pub(super) became: Became,
}

/// A mesh of about `target` triangles in place of `shape`, with every vertex whose place `is_held` and the others at multiples of `unit`; `None` where nothing is left.
pub(super) fn simplified_within(
    shape: &Shape,
    is_held: impl Fn(&LatticePoint) -> bool,
    target: usize,
    unit: u32,
    room: Room,
) -> Option<Simplified> {
    let collapsed = collapse_within(shape, &is_held, target, room);
    let (coarser, moved) = fitted(&collapsed, shape, is_held, unit);
    let (own, positions) = (coarser.positions(), shape.positions());
    let to = Target::new(&own, &coarser.triangles)?;
    let from = Target::new(&positions, &shape.triangles)?;
    let (distance, links) = bound::linked(&to, &from);
    let mut became = traced(shape, &collapsed);
    became.and_moved(&moved);
    became.keep_within(shape, &from, &to, distance.bound);
    Some(Simplified {
        shape: coarser,
        squares: distance.squares,
        links,
        became,
    })
}

/// `coarser` with vertices moved to where it is nearest to `shape`, all at one place together; those whose place `is_held` stay,
/// the others get to multiples of `unit`. And where each place has gone.
fn fitted(
    coarser: &Shape,
    shape: &Shape,
    is_held: impl Fn(&LatticePoint) -> bool,
    unit: u32,
) -> (Shape, HashMap<LatticePoint, LatticePoint>) {
    let (places, number_of) = coarser.places();
    let corners = |t: &[u32; 3]| t.map(|v| number_of[v as usize]);
    let mut mesh = WeldedMesh {
        positions: places.iter().map(|&place| point(place)).collect(),
        colours: Vec::new(),
        triangles: coarser.triangles.iter().map(corners).collect(),
    };
    let positions = shape.positions();
    let source = Mesh {
        positions: &positions,
        triangles: &shape.triangles,
    };
    let mut normals = coarser.normals();
    let count = FITTED_TO * mesh.triangles.len();
    if let Ok(cloud) = Cloud::on(source, &shape.normals(), count as u64) {
        let Refit { shading, .. } = refit(&mut mesh, &cloud, |v| is_held(&places[v as usize]));
        shading.fit(&coarser.triangles, &mut normals, |v| {
            is_held(&coarser.vertices[v as usize].0)
        });
    }
    let (low, high) = bounds(&positions);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to what the lattice has"
    )]
    let rounded = |p: DVec3| {
        let steps = p.clamp(low, high) / f64::from(unit);
        steps.round().to_array().map(|c| c as u32 * unit)
    };
    let moved: Vec<LatticePoint> = mesh.positions.iter().map(|&p| rounded(p)).collect();
    let mut fitted = Shape::default();
    for t in &coarser.triangles {
        fitted.triangle(t.map(|v| {
            let (place, own, colour) = coarser.vertices[v as usize];
            let normal = if is_held(&place) {
                own
            } else {
                octahedral::encode(normals[v as usize].as_vec3().to_array())
            };
            (moved[number_of[v as usize] as usize], normal, colour)
        }));
    }
    (fitted, places.into_iter().zip(moved).collect())
}

/// Runs one of meshoptimizer's simplifiers on `shape`, moved to the origin so that `f32` is exact.
fn run(shape: &Shape, simplifier: impl Fn(&[u32], &VertexDataAdapter<'_>) -> Vec<u32>) -> Shape {
    let mut floor = [u32::MAX; 3];
    for vertex in &shape.vertices {
        for (low, &c) in floor.iter_mut().zip(&vertex.0) {
            *low = (*low).min(c);
        }
    }
    let mut places: Vec<f32> = Vec::with_capacity(3 * shape.vertices.len());
    for vertex in &shape.vertices {
        for (low, c) in floor.iter().zip(vertex.0) {
            // Less than 2^21.
            places.push((c - low) as f32);
        }
    }
    let Ok(vertices) = VertexDataAdapter::new(typed_to_bytes(&places), 12, 0) else {
        return Shape::default();
    };
    let indices = simplifier(shape.triangles.as_flattened(), &vertices);
    let (triangles, _) = indices.as_chunks::<3>();
    shape.part(triangles)
}

fn collapse(shape: &Shape, target: usize) -> Shape {
    let options =
        SimplifyOptions::Prune | SimplifyOptions::Permissive | SimplifyOptions::ErrorAbsolute;
    run(shape, |indices, vertices| {
        let count = (3 * target).min(indices.len());
        simplify(indices, vertices, count, f32::MAX, options, None)
    })
}

fn collapse_within(
    shape: &Shape,
    is_held: impl Fn(&LatticePoint) -> bool,
    target: usize,
    room: Room,
) -> Shape {
    let held: Vec<bool> = shape.vertices.iter().map(|v| is_held(&v.0)).collect();
    let normals: Vec<[f32; 3]> = (shape.vertices.iter())
        .map(|vertex| octahedral::decode(vertex.1))
        .collect();
    let options = SimplifyOptions::Permissive | SimplifyOptions::ErrorAbsolute;
    run(shape, |indices, vertices| {
        simplify_with_attributes_and_locks(
            indices,
            vertices,
            normals.as_flattened(),
            &[room.normals(); 3],
            size_of::<[f32; 3]>(),
            &held,
            (3 * target).min(indices.len()),
            f32::MAX,
            options,
            None,
        )
    })
}

fn merge_cells(shape: &Shape, target: usize) -> Shape {
    run(shape, |indices, vertices| {
        let count = (3 * target).min(indices.len());
        simplify_sloppy(indices, vertices, count, f32::MAX, None)
    })
}

fn largest(shape: &Shape, target: usize) -> Shape {
    let positions = shape.positions();
    let doubled_area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        (b - a).cross(c - a).length()
    };
    let mut order: Vec<(usize, f64)> = shape
        .triangles
        .iter()
        .map(doubled_area)
        .enumerate()
        .collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    order.truncate(target);
    order.sort_unstable_by_key(|&(t, _)| t);
    let triangles: Vec<[u32; 3]> = order.iter().map(|&(t, _)| shape.triangles[t]).collect();
    shape.part(&triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: u32 = 40;
    const UNIT: u32 = 8;

    /// A bowl; vertices on the middle line are there twice, with two normals.
    fn bowl() -> Shape {
        let vertex = |x: u32, y: u32, side: u8| {
            let from_middle = |c: u32| (f64::from(c) / f64::from(CELLS) - 0.5).powi(2);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0..=500"
            )]
            let height = (1000.0 * (from_middle(x) + from_middle(y))) as u32;
            (
                [100 * UNIT * x, 100 * UNIT * y, UNIT * height],
                [side, 0],
                [0; 3],
            )
        };
        let mut shape = Shape::default();
        for k in 0..CELLS.pow(2) {
            let (x, y) = (k % CELLS, k / CELLS);
            let at = |dx: u32, dy: u32| vertex(x + dx, y + dy, u8::from(2 * x >= CELLS));
            shape.triangle([at(0, 0), at(1, 0), at(1, 1)]);
            shape.triangle([at(0, 0), at(1, 1), at(0, 1)]);
        }
        shape
    }

    fn is_rim(p: &LatticePoint) -> bool {
        p[..2].iter().any(|&c| c == 0 || c == 100 * UNIT * CELLS)
    }

    #[test]
    fn what_stands_for_others_is_fitted_on_the_lattice_and_what_is_held_stays() {
        let bowl = bowl();
        let plain = collapse_within(&bowl, is_rim, 300, Room::Plain);
        let (own, positions) = (plain.positions(), bowl.positions());
        let to = Target::new(&own, &plain.triangles).unwrap();
        let from = Target::new(&positions, &bowl.triangles).unwrap();
        let (before, _) = bound::linked(&to, &from);
        let simplified = simplified_within(&bowl, is_rim, 300, UNIT, Room::Plain).unwrap();
        let Simplified {
            shape: fitted,
            squares,
            became,
            ..
        } = simplified;
        assert!(fitted.triangles.len() <= plain.triangles.len());
        // What everything has become is there, and is itself on the rim.
        let there: std::collections::BTreeSet<LatticePoint> =
            fitted.vertices.iter().map(|v| v.0).collect();
        for (place, ..) in &bowl.vertices {
            let became = became.of(*place).unwrap();
            assert!(there.contains(&became) && (!is_rim(place) || became == *place));
        }
        assert!(squares < 0.5 * before.squares, "{squares:?} {before:?}");
        let places: Vec<LatticePoint> = fitted.vertices.iter().map(|v| v.0).collect();
        assert!(places.as_flattened().iter().all(|c| c % UNIT == 0));
        let rim = |shape: &Shape| -> std::collections::BTreeSet<LatticePoint> {
            shape.vertices.iter().map(|v| v.0).filter(is_rim).collect()
        };
        assert_eq!(rim(&fitted), rim(&bowl));
        // Nothing comes apart between the two sides.
        let mut ends: HashMap<[LatticePoint; 2], i32> = HashMap::new();
        for t in &fitted.triangles {
            let [a, b, c] = t.map(|v| fitted.vertices[v as usize].0);
            for (a, b) in [(a, b), (b, c), (c, a)] {
                *ends.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let open = ends.iter().filter(|(_, count)| **count == 1);
        assert_eq!(open.clone().count(), 4 * CELLS as usize);
        assert!(open.flat_map(|(ends, _)| ends).all(is_rim));
    }
}
