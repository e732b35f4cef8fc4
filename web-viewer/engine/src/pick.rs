//! Which point of the drawn surface lies below a place of the picture.
//!
//! Leaves and clusters of the cut are visited in the order in which the ray enters their bounds; the walk ends where the
//! next one begins beyond the nearest hit. Within one all triangles are tried: 2 048 at most, and a ray enters few.
//! A triangle's edge is judged by the sign of direction · (a × b), which is exactly the opposite for the triangle on the
//! edge's other side, so no ray slips through a seam (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", 2013).
//!
//! Limit: a leaf that is on its way to another resolution is picked where it will be at rest.

use crate::camera::Ray;
use crate::lod::Leaf;
use crate::lod::mesh::Patch;
use glam::DVec3;
use marquetry_format::{Bounds, ClusterId, ClusterMesh, NodeId};

/// A point of the surface as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// Where it is, world coordinates.
    pub world: DVec3,
    /// Unit normal of its triangle, towards the eye.
    pub normal: DVec3,
    /// Most that the surface drawn there is away from the source, world length.
    pub error: f64,
    /// The node that is drawn there; `None` where it is a cluster.
    pub node: Option<NodeId>,
}

/// A part of what a cut draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// Of a chart.
    Leaf(Leaf),
    /// Of the cluster layer.
    Cluster(ClusterId),
}

/// The triangles of a part.
#[derive(Debug, Clone, Copy)]
pub enum Surface<'a> {
    /// Of a leaf.
    Patch(Patch<'a>),
    /// Of a cluster; only its positions and triangles matter.
    Cluster(&'a ClusterMesh),
}

/// Where a ray meets a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Multiple of the ray's direction.
    pub depth: f64,
    /// Unit normal, towards the ray's origin.
    pub normal: DVec3,
    /// The part.
    pub part: Part,
}

/// The nearest hit of `ray` with what `surface` gives for each of `parts`, among the points that `is_shown`.
///
/// The bounds of a part (lattice units) hold everything drawn of it.
pub fn nearest<'a>(
    ray: &Ray,
    parts: impl Iterator<Item = (Part, Bounds)>,
    mut surface: impl FnMut(Part) -> Option<Surface<'a>>,
    is_shown: impl Fn(DVec3) -> bool,
) -> Option<Hit> {
    let mut entered: Vec<(f64, Part)> = parts
        .filter_map(|(part, bounds)| Some((entry(ray, &bounds)?, part)))
        .collect();
    entered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<Hit> = None;
    for (depth, part) in entered {
        if best.is_some_and(|best| best.depth < depth) {
            break;
        }
        let mut test = |triangle: [DVec3; 3]| {
            let Some((depth, normal)) = meet(ray.direction, triangle) else {
                return;
            };
            if depth >= ray.near
                && best.is_none_or(|best| depth < best.depth)
                && is_shown(ray.origin + depth * ray.direction)
            {
                best = Some(Hit {
                    depth,
                    normal,
                    part,
                });
            }
        };
        match surface(part) {
            Some(Surface::Patch(patch)) => patch_triangles(ray, &patch, &mut test),
            Some(Surface::Cluster(mesh)) => cluster_triangles(ray, mesh, &mut test),
            None => {}
        }
    }
    best
}

/// Depth at which `ray` enters a box of one lattice unit around `bounds`, 0 inside.
fn entry(ray: &Ray, bounds: &Bounds) -> Option<f64> {
    let min = DVec3::from_array(bounds.min.map(f64::from)) - 1.0 - ray.origin;
    let max = DVec3::from_array(bounds.max.map(f64::from)) + 1.0 - ray.origin;
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        if ray.direction[axis] == 0.0 {
            if min[axis] > 0.0 || max[axis] < 0.0 {
                return None;
            }
            continue;
        }
        let ends = [min[axis], max[axis]].map(|end| end / ray.direction[axis]);
        near = near.max(ends[0].min(ends[1]));
        far = far.min(ends[0].max(ends[1]));
    }
    (near <= far).then_some(near)
}

/// The triangles of a patch, seen from the ray's origin; none where samples are missing.
fn patch_triangles(ray: &Ray, patch: &Patch<'_>, test: &mut impl FnMut([DVec3; 3])) {
    let cells = 1usize << patch.leaf.grid_resolution();
    let side = cells + 1;
    let mut corners = Vec::with_capacity(side * side);
    for n in 0..side * side {
        let Some(position) = patch.position(n % side, n / side) else {
            return;
        };
        corners.push(position - ray.origin);
    }
    for (j, i) in (0..cells).flat_map(|j| (0..cells).map(move |i| (j, i))) {
        let corner = |di: usize, dj: usize| corners[(j + dj) * side + i + di];
        let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
        test([a, b, c]);
        test([a, c, d]);
    }
}

fn cluster_triangles(ray: &Ray, mesh: &ClusterMesh, test: &mut impl FnMut([DVec3; 3])) {
    for triangle in &mesh.triangles {
        let corner = |n: u8| {
            let point = mesh.positions.get(usize::from(n))?;
            Some(DVec3::from_array(point.map(f64::from)) - ray.origin)
        };
        if let [Some(a), Some(b), Some(c)] = triangle.map(corner) {
            test([a, b, c]);
        }
    }
}

/// Depth at which a ray from the origin meets a triangle, from either side, and the normal that faces the origin.
pub fn meet(direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, DVec3)> {
    let edges = [(b, c), (c, a), (a, b)].map(|(from, to)| direction.dot(from.cross(to)));
    if !(edges.iter().all(|e| *e >= 0.0) || edges.iter().all(|e| *e <= 0.0)) {
        return None;
    }
    let sum: f64 = edges.iter().sum();
    if sum == 0.0 {
        return None;
    }
    let point = (a * edges[0] + b * edges[1] + c * edges[2]) / sum;
    let depth = point.dot(direction) / direction.length_squared();
    let normal = (b - a).cross(c - a).try_normalize()?;
    let facing = if normal.dot(direction) > 0.0 {
        -normal
    } else {
        normal
    };
    depth.is_finite().then_some((depth, facing))
}
