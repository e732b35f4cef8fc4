//! Moves the vertices of a simplified mesh to where it is nearest, in the least squares, to points of its source.
//!
//! Each point pulls at the place of the mesh nearest to it, along the normal there and a little across (Hoppe et al.,
//! "Mesh Optimization", 1993, without springs). A collapse puts its vertex where the planes around it ask for it,
//! which is outside of what is curved; afterwards the source lies as much on one side as on the other.
//!
//! Limits: vertices on borders and of non-manifold edges stay. Few points a vertex make it follow those in place of the surface: 4 of them
//! make bunny worse, from 25 on little is gained.

mod cloud;
mod gradients;
mod shading;

pub use cloud::Cloud;
pub use shading::Shading;

use super::WeldedMesh;
use super::adjacency::{EdgeTable, id};
use glam::{DMat3, DVec3};
use marquetry_evaluation::distance::Indexed;
use shading::Shade;

/// Weight of the squared distance across the normal.
const ACROSS: f64 = 0.005;
/// Weight of staying, over that of the points of a vertex on average.
const STAYING: f64 = 0.001;
/// Farthest that a vertex moves, over the shortest edge around it.
const FARTHEST: f64 = 0.4;
/// Cosine of the angle that a triangle turns by at most.
const COSINE: f64 = 0.7;
/// Points whose nearest places are looked for in one go.
const AT_A_TIME: usize = 1 << 16;

/// What was done, and what is known of normals by it.
#[derive(Debug, Clone, Default)]
pub struct Refit {
    /// How far the farthest vertex went, a length.
    pub farthest: f64,
    /// Normals that points have.
    pub shading: Shading,
}

/// Moves vertices of `mesh` but those that are held towards the points of `cloud`.
///
/// No triangle is turned by more than 46 degrees. The same for any number of threads.
pub fn refit(mesh: &mut WeldedMesh, cloud: &Cloud, is_held: impl Fn(u32) -> bool) -> Refit {
    let tree = match Indexed::new(mesh.surface()) {
        Ok(tree) if !cloud.places.is_empty() => tree,
        _ => return Refit::default(),
    };
    let system = System::new(mesh, &tree, cloud, is_held);
    let mut moves = system.solve();
    let shading = system.shading;
    limit(mesh, &mut moves);
    keep_upright(mesh, &mut moves);
    let mut farthest = 0.0_f64;
    for (place, by) in mesh.positions.iter_mut().zip(&moves) {
        *place += *by;
        farthest = farthest.max(by.length());
    }
    Refit { farthest, shading }
}

/// The normal equations.
struct System<'a> {
    triangles: &'a [[u32; 3]],
    /// By triangle.
    shading: Shading,
    normals: Vec<DVec3>,
    /// By vertex.
    wanted: Vec<DVec3>,
    inverse: Vec<DMat3>,
    staying: f64,
    is_free: Vec<bool>,
}

impl<'a> System<'a> {
    fn new(
        mesh: &'a WeldedMesh,
        tree: &Indexed<'_>,
        cloud: &Cloud,
        is_held: impl Fn(u32) -> bool,
    ) -> Self {
        let normals: Vec<DVec3> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.surface().corners(t);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        // By triangle, and by corner of it, the sums of the ways to the points.
        let mut ways = vec![[DVec3::ZERO; 3]; mesh.triangles.len()];
        let mut shades = vec![Shade::default(); mesh.triangles.len()];
        // What is nearest takes more room than the points.
        for (places, told) in cloud.chunks(AT_A_TIME) {
            let found = places.iter().zip(told).zip(tree.nearest(places));
            for ((point, told), closest) in found {
                let Some(closest) = closest else { continue };
                let t = closest.triangle as usize;
                let Some(at) = barycentric(mesh.surface().corners(t), closest.point) else {
                    continue;
                };
                shades[t].add(at, normals[t], told.as_dvec3());
                for (way, at) in ways[t].iter_mut().zip(at) {
                    *way += (*point - closest.point) * at;
                }
            }
        }
        let mut is_free = inner(mesh);
        for (v, is_free) in is_free.iter_mut().enumerate() {
            *is_free &= !is_held(id(v));
        }
        let staying = STAYING * cloud.places.len() as f64 / mesh.positions.len().max(1) as f64;
        let mut wanted = vec![DVec3::ZERO; mesh.positions.len()];
        let mut diagonal = vec![DMat3::from_diagonal(DVec3::splat(staying)); wanted.len()];
        let of_triangles = mesh.triangles.iter().zip(&ways).zip(&shades).zip(&normals);
        for (((corners, ways), shade), &normal) in of_triangles {
            for (k, &v) in corners.iter().enumerate() {
                wanted[v as usize] += seen(normal, ways[k]);
                diagonal[v as usize] += outer(normal) * shade.weights[k];
            }
        }
        let inverse = diagonal.into_iter().map(|m| m.inverse()).collect();
        for (wanted, _) in wanted.iter_mut().zip(&is_free).filter(|(_, free)| !**free) {
            *wanted = DVec3::ZERO;
        }
        Self {
            triangles: &mesh.triangles,
            shading: Shading { shades },
            normals,
            wanted,
            inverse,
            staying,
            is_free,
        }
    }

    fn solve(&self) -> Vec<DVec3> {
        // The blocks of the diagonal.
        let preconditioned = |residual: &[DVec3]| {
            let blocks = residual.iter().zip(&self.inverse);
            blocks.map(|(r, m)| *m * *r).collect()
        };
        gradients::solve(&self.wanted, preconditioned, |moves, to| {
            self.apply(moves, to);
        })
    }

    fn apply(&self, moves: &[DVec3], to: &mut [DVec3]) {
        for (to, by) in to.iter_mut().zip(moves) {
            *to = *by * self.staying;
        }
        let of_triangles = self.triangles.iter().zip(&self.shading.shades);
        for ((&corners, shade), &normal) in of_triangles.zip(&self.normals) {
            let sums = shade.product(corners.map(|v| moves[v as usize]));
            for (v, sum) in corners.into_iter().zip(sums) {
                to[v as usize] += seen(normal, sum);
            }
        }
        for (to, _) in to.iter_mut().zip(&self.is_free).filter(|(_, free)| !**free) {
            *to = DVec3::ZERO;
        }
    }
}

/// A way as it counts: all of it along the normal, little across.
fn seen(normal: DVec3, way: DVec3) -> DVec3 {
    normal * normal.dot(way) + ACROSS * way
}

fn outer(n: DVec3) -> DMat3 {
    DMat3::from_cols(n * n.x, n * n.y, n * n.z) + DMat3::from_diagonal(DVec3::splat(ACROSS))
}

/// Weights of the corners of a triangle at a point on it.
fn barycentric([a, b, c]: [DVec3; 3], point: DVec3) -> Option<[f64; 3]> {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let square = normal.length_squared();
    if square <= 0.0 {
        return None;
    }
    let s = ap.cross(ac).dot(normal) / square;
    let t = ab.cross(ap).dot(normal) / square;
    Some([1.0 - s - t, s, t])
}

/// Which vertices have no edge without exactly two triangles.
fn inner(mesh: &WeldedMesh) -> Vec<bool> {
    let mut is_inner = vec![true; mesh.positions.len()];
    let edges = EdgeTable::new(&mesh.triangles, mesh.positions.len());
    for v in edges.open(&mesh.triangles).flatten() {
        is_inner[v as usize] = false;
    }
    is_inner
}

/// Shortens moves to a part of the edges around.
fn limit(mesh: &WeldedMesh, moves: &mut [DVec3]) {
    let mut shortest = vec![f64::INFINITY; moves.len()];
    for &[a, b, c] in &mesh.triangles {
        for (v, w) in [(a, b), (b, c), (c, a)] {
            let length = mesh.positions[v as usize].distance(mesh.positions[w as usize]);
            for v in [v, w] {
                shortest[v as usize] = shortest[v as usize].min(length);
            }
        }
    }
    for (by, shortest) in moves.iter_mut().zip(shortest) {
        *by = by.clamp_length_max(FARTHEST * shortest);
    }
}

/// Leaves the vertices of triangles that would turn, or lose their area, where they are.
fn keep_upright(mesh: &WeldedMesh, moves: &mut [DVec3]) {
    loop {
        let mut is_done = true;
        for &corners in &mesh.triangles {
            let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
            let [d, e, f] = corners.map(|v| mesh.positions[v as usize] + moves[v as usize]);
            let (before, after) = ((b - a).cross(c - a), (e - d).cross(f - d));
            let is_moved = corners.iter().any(|&v| moves[v as usize] != DVec3::ZERO);
            if is_moved && before.dot(after) <= COSINE * before.length() * after.length() {
                is_done = false;
                for v in corners {
                    moves[v as usize] = DVec3::ZERO;
                }
            }
        }
        if is_done {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::normals::vertex_normals;
    use marquetry_evaluation::distance;

    /// A quarter of a cylinder of `cells`² cells, two triangles each; vertices within its border are `outside` of it.
    fn bent(cells: u32, outside: f64) -> WeldedMesh {
        let at = |x: u32, y: u32| y * (cells + 1) + x;
        let mut mesh = WeldedMesh {
            positions: Vec::new(),
            colours: Vec::new(),
            triangles: Vec::new(),
        };
        for k in 0..(cells + 1).pow(2) {
            let [x, y] =
                [k % (cells + 1), k / (cells + 1)].map(|c| f64::from(c) / f64::from(cells));
            let turn = x * std::f64::consts::FRAC_PI_2;
            let is_inside = [x, y].iter().all(|c| (0.01..0.99).contains(c));
            let reach = if is_inside { 1.0 + outside } else { 1.0 };
            let place = DVec3::new(reach * turn.cos(), reach * turn.sin(), y);
            mesh.positions.push(place);
        }
        for k in 0..cells.pow(2) {
            let (x, y) = (k % cells, k / cells);
            let (a, c) = (at(x, y), at(x + 1, y + 1));
            mesh.triangles
                .extend([[a, at(x + 1, y), c], [a, c, at(x, y + 1)]]);
        }
        mesh
    }

    fn rms(mesh: &WeldedMesh, cloud: &Cloud) -> f64 {
        let distances = distance::from_points(&cloud.places, mesh.surface());
        distances.unwrap().rms
    }

    fn points_of(mesh: &WeldedMesh) -> Cloud {
        Cloud::on(mesh.surface(), &vertex_normals(mesh.surface()), 20_000).unwrap()
    }

    #[test]
    fn vertices_outside_of_a_curved_surface_come_nearer_and_borders_stay() {
        let source = bent(300, 0.0);
        let points = points_of(&source);
        let mut mesh = bent(10, 0.01);
        let before = mesh.clone();
        let farthest = refit(&mut mesh, &points, |_| false).farthest;
        let [least, most] = [rms(&mesh, &points), rms(&before, &points)];
        assert!(least < 0.5 * most, "{least} {most}");
        let ways = || before.positions.iter().zip(&mesh.positions);
        let found = ways().map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!((found - farthest).abs() < 1e-12 && farthest < 0.4 * 0.1);
        let is_border = |p: &DVec3| [p.x, p.y, p.z, 1.0 - p.z].iter().any(|c| c.abs() < 1e-9);
        let border = ways().filter(|(place, _)| is_border(place));
        assert_eq!(border.filter(|(a, b)| a == b).count(), 40);
    }

    #[test]
    fn what_lies_on_its_source_stays() {
        let mut mesh = bent(10, 0.0);
        let points = points_of(&mesh);
        assert!(refit(&mut mesh, &points, |_| false).farthest < 1e-12);
        let before = mesh.clone();
        assert!(refit(&mut mesh, &Cloud::default(), |_| false).farthest <= 0.0);
        assert_eq!(mesh.positions, before.positions);
    }

    #[test]
    fn what_is_held_stays() {
        let points = points_of(&bent(300, 0.0));
        let before = bent(10, 0.01);
        let mut mesh = before.clone();
        refit(&mut mesh, &points, |v| v % 2 == 0);
        let is_moved = |v: &usize| before.positions[*v] != mesh.positions[*v];
        let moved: Vec<usize> = (0..mesh.positions.len()).filter(is_moved).collect();
        assert!(moved.len() > 30 && moved.iter().all(|v| v % 2 == 1));
    }

    /// Points far above one corner ask for a spike.
    #[test]
    fn no_triangle_is_turned_over() {
        let mut mesh = bent(10, 0.0);
        let mut points = points_of(&mesh);
        for k in 0..5000 {
            let place = DVec3::new(2.0, 2.0 + f64::from(k) * 1e-4, 0.5);
            points.places.push(place);
            points.normals.push(glam::Vec3::X);
        }
        let before = mesh.clone();
        refit(&mut mesh, &points, |_| false);
        for t in 0..mesh.triangles.len() {
            let [old, new] =
                [&before, &mesh].map(|mesh| distance::normal(mesh.surface().corners(t)));
            assert!(old.unwrap().dot(new.unwrap()) > 0.69);
        }
    }
}
