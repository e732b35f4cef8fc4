//! One cluster in place of several.
//!
//! Three ways are tried, and the one with the least distance to what it stands for is taken: quadric edge collapse that drops
//! whole parts as it goes (Garland & Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997; meshoptimizer),
//! vertex clustering (Rossignac & Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993;
//! meshoptimizer's sloppy simplification), and leaving out all but the largest triangles.
//! Vertices keep their positions, so all stay on the lattice. Where some of them are to stay, only the collapse will do.

use super::Room;
use super::bound::{distance, hausdorff};
use super::graph::Distance;
use super::shape::Shape;
use marquetry_format::LatticePoint;
use marquetry_format::cluster::MAX_CLUSTER_TRIANGLES;
use meshopt::{
    SimplifyOptions, VertexDataAdapter, simplify, simplify_sloppy, simplify_with_locks,
    typed_to_bytes,
};

/// Triangles asked for (all, where there are fewer), until few enough vertices are left as well.
const TARGETS: [usize; 6] = [MAX_CLUSTER_TRIANGLES, 192, 128, 96, 64, 32];

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

/// A mesh of about `target` triangles in place of `shape`, with every vertex whose place `is_held`, and the distance between them; `None`
/// where nothing is left.
pub(super) fn simplified_within(
    shape: &Shape,
    is_held: impl Fn(&LatticePoint) -> bool,
    target: usize,
) -> Option<(Shape, Distance)> {
    let held: Vec<bool> = shape.vertices.iter().map(|v| is_held(&v.0)).collect();
    let options = SimplifyOptions::Permissive | SimplifyOptions::ErrorAbsolute;
    let coarser = run(shape, |indices, vertices| {
        let count = (3 * target).min(indices.len());
        simplify_with_locks(indices, vertices, &held, count, f32::MAX, options, None)
    });
    if coarser.triangles.is_empty() {
        return None;
    }
    let (own, positions) = (coarser.positions(), shape.positions());
    let distance = distance(
        (&own, &coarser.triangles),
        (&positions, &shape.triangles),
        f64::INFINITY,
    );
    Some((coarser, distance))
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
