//! Cutting along loops of edges, and closing both openings by fans around the loop's centre.

use super::adjacency::{end, id, next, start};
use super::{ManifoldMesh, NONE};
use glam::DVec3;

/// A closed path of half-edges, each starting where the one before ends.
pub(super) type Loop = Vec<u32>;

/// The distance whose `squares` are these.
pub fn reach(squares: f64) -> f64 {
    (6.0 / std::f64::consts::PI * squares).powf(0.25)
}

/// What cutting along loops did to a mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Caps {
    /// Loops that were cut.
    pub loops: usize,
    /// Triangles added to close the openings; they come last.
    pub triangles: usize,
    /// Bound of the distance from any point of a cap to the imported surface.
    pub distance: f64,
    /// About the integral of the squared distance to the imported surface over one cap of each loop.
    pub squares: f64,
}

/// About that integral for a cap of this distance: that of a disk's squared distance to its rim.
pub(super) fn squares(distance: f64) -> f64 {
    std::f64::consts::PI / 6.0 * distance.powi(4)
}

/// Halvings of a cap's triangles while its distance is bounded.
const HALVINGS: u32 = 3;

fn centre(mesh: &ManifoldMesh, path: &[u32]) -> DVec3 {
    let at = |h: u32| mesh.positions[start(&mesh.triangles, h) as usize];
    path.iter().map(|&h| at(h)).sum::<DVec3>() / path.len() as f64
}

/// Bound of the distance from any point of the loop's cap to the loop; infinite where it is above `most`.
pub(super) fn distance(mesh: &ManifoldMesh, path: &[u32], most: f64) -> f64 {
    let segments: Vec<[DVec3; 2]> = path
        .iter()
        .map(|&h| {
            [start(&mesh.triangles, h), end(&mesh.triangles, h)].map(|v| mesh.positions[v as usize])
        })
        .collect();
    let centre = centre(mesh, path);
    let mut largest = nearest(&[centre], &segments);
    for &[a, b] in &segments {
        if largest > most {
            return f64::INFINITY;
        }
        raise([a, b, centre], &segments, HALVINGS, &mut largest);
    }
    if largest > most {
        f64::INFINITY
    } else {
        largest
    }
}

/// Distance of the farthest of some points to the segment for which it is least.
fn nearest(points: &[DVec3], segments: &[[DVec3; 2]]) -> f64 {
    let to_segment = |p: DVec3, [a, b]: [DVec3; 2]| {
        let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance_squared(if along.is_nan() { a } else { a.lerp(b, along) })
    };
    segments
        .iter()
        .map(|&s| points.iter().map(|&p| to_segment(p, s)).fold(0.0, f64::max))
        .fold(f64::INFINITY, f64::min)
        .sqrt()
}

/// Raises `largest` to a bound of the distance from a triangle to some segments: the distance to one of them is convex, so
/// it is largest at a corner.
fn raise(corners: [DVec3; 3], segments: &[[DVec3; 2]], halvings: u32, largest: &mut f64) {
    let whole = nearest(&corners, segments);
    // No part of it is farther than it is as a whole.
    if whole <= *largest {
        return;
    }
    if halvings == 0 {
        *largest = whole;
        return;
    }
    let [a, b, c] = corners;
    let (ab, bc, ca) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
    let before = *largest;
    for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
        raise(part, segments, halvings - 1, largest);
    }
    *largest = largest.min(before.max(whole));
}

/// Cuts `mesh` along disjoint loops and caps both sides of each.
pub(super) fn cut(mesh: &mut ManifoldMesh, loops: &[Loop], done: &mut Caps) {
    let first_origin = mesh.origin.iter().map(|&o| o + 1).max().unwrap_or(0);
    for (path, origin) in loops.iter().zip(first_origin..) {
        done.loops += 1;
        done.triangles += 2 * path.len();
        let reach = distance(mesh, path, f64::INFINITY);
        done.distance = done.distance.max(reach);
        done.squares += squares(reach);
        let centre = centre(mesh, path);
        let other_side: Vec<u32> = path.iter().rev().map(|&h| mesh.twins[h as usize]).collect();
        separate(mesh, path);
        for side in [path.as_slice(), &other_side] {
            cap(mesh, side, centre, origin);
        }
    }
}

/// Gives the right side of the loop its own vertices.
fn separate(mesh: &mut ManifoldMesh, path: &[u32]) {
    for (i, &h) in path.iter().enumerate() {
        let before = path[(i + path.len() - 1) % path.len()];
        let v = start(&mesh.triangles, h);
        let copy = push_vertex(mesh, v);
        let last = mesh.twins[before as usize];
        // The right side's fan lies clockwise from this edge to the one before.
        let mut at = next(mesh.twins[h as usize]);
        loop {
            mesh.triangles[at as usize / 3][at as usize % 3] = copy;
            if at == last {
                break;
            }
            at = next(mesh.twins[at as usize]);
        }
    }
    for &h in path {
        let twin = mesh.twins[h as usize];
        mesh.twins[h as usize] = NONE;
        mesh.twins[twin as usize] = NONE;
    }
}

/// A copy of vertex `v`.
fn push_vertex(mesh: &mut ManifoldMesh, v: u32) -> u32 {
    let (copy, v) = (id(mesh.positions.len()), v as usize);
    mesh.positions.push(mesh.positions[v]);
    mesh.origin.push(mesh.origin[v]);
    mesh.normals.push(mesh.normals[v]);
    if !mesh.colours.is_empty() {
        mesh.colours.push(mesh.colours[v]);
    }
    copy
}

/// Closes the opening along `side`, whose half-edges have no twins, by a fan around a new vertex.
fn cap(mesh: &mut ManifoldMesh, side: &[u32], centre: DVec3, origin: u32) {
    let apex = push_vertex(mesh, start(&mesh.triangles, side[0]));
    mesh.cap_apexes.push(apex);
    let first = id(mesh.triangles.len());
    let count = id(side.len());
    let mut normal = DVec3::ZERO;
    let mut colour = [0; 3];
    for (k, &h) in (0..count).zip(side) {
        let (a, b) = (start(&mesh.triangles, h), end(&mesh.triangles, h));
        mesh.triangles.push([b, a, apex]);
        // Its other neighbours: the one before starts where this one ends on the loop.
        let (before, after) = (first + (k + count - 1) % count, first + (k + 1) % count);
        mesh.twins.extend([h, 3 * before + 2, 3 * after + 1]);
        mesh.twins[h as usize] = 3 * (first + k);
        let [p, q] = [a, b].map(|v| mesh.positions[v as usize] - centre);
        normal += q.cross(p);
        if let Some(own) = mesh.colours.get(a as usize) {
            for (sum, &part) in colour.iter_mut().zip(own) {
                *sum += u32::from(part);
            }
        }
    }
    let apex = apex as usize;
    mesh.positions[apex] = centre;
    mesh.origin[apex] = origin;
    mesh.normals[apex] = normal.try_normalize().unwrap_or(DVec3::Z);
    if let Some(own) = mesh.colours.get_mut(apex) {
        *own = colour.map(|sum| u8::try_from(sum / count).unwrap_or(u8::MAX));
    }
}
