//! Moves the vertices of a simplified mesh to where it is nearest, in the least squares, to points of its source.
//!
//! Each point pulls at the place of the mesh nearest to it, along the normal there and a little across (Hoppe et al.,
//! "Mesh Optimization", 1993, without springs). A collapse puts its vertex where the planes around it ask for it,
//! which is outside of what is curved; afterwards the source lies as much on one side as on the other.
//!
//! Limits: vertices on borders and of non-manifold edges stay. Few points a vertex make it follow those in place of the surface: 4 of them
//! make bunny worse, from 25 on little is gained.

use super::WeldedMesh;
use super::adjacency::{EdgeTable, id};
use glam::{DMat3, DVec3};
use marquetry_evaluation::distance::Indexed;

/// Weight of the squared distance across the normal.
const ACROSS: f64 = 0.005;
/// Weight of staying, over that of the points of a vertex on average.
const STAYING: f64 = 0.001;
/// Steps of conjugate gradients, at most, and the part of the residual that is left at the last.
const STEPS: u32 = 20;
const LEFT: f64 = 1e-3;
/// Farthest that a vertex moves, over the shortest edge around it.
const FARTHEST: f64 = 0.4;
/// Cosine of the angle that a triangle turns by at most.
const COSINE: f64 = 0.7;
/// Points whose nearest places are looked for in one go.
const AT_A_TIME: usize = 1 << 16;

/// Moves vertices of `mesh` but those that are held towards `points`, finite ones; how far the farthest went, a length.
///
/// No triangle is turned by more than 46 degrees. The same for any number of threads.
pub fn refit(mesh: &mut WeldedMesh, points: &[DVec3], is_held: impl Fn(u32) -> bool) -> f64 {
    let tree = match Indexed::new(mesh.surface()) {
        Ok(tree) if !points.is_empty() => tree,
        _ => return 0.0,
    };
    let mut moves = System::new(mesh, &tree, points, is_held).solve();
    limit(mesh, &mut moves);
    keep_upright(mesh, &mut moves);
    let mut farthest = 0.0_f64;
    for (place, by) in mesh.positions.iter_mut().zip(&moves) {
        *place += *by;
        farthest = farthest.max(by.length());
    }
    farthest
}

/// What the points nearest to a triangle ask for.
#[derive(Debug, Clone, Copy, Default)]
struct Pull {
    /// Sums of products of weights of corners: 00, 11, 22, 01, 12, 20.
    weights: [f64; 6],
    /// By corner, the sum of the ways to the points.
    ways: [DVec3; 3],
}

impl Pull {
    fn add(&mut self, at: [f64; 3], way: DVec3) {
        for k in 0..3 {
            self.weights[k] += at[k] * at[k];
            self.weights[3 + k] += at[k] * at[(k + 1) % 3];
            self.ways[k] += way * at[k];
        }
    }
}

/// The normal equations.
struct System<'a> {
    triangles: &'a [[u32; 3]],
    /// By triangle.
    weights: Vec<[f64; 6]>,
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
        points: &[DVec3],
        is_held: impl Fn(u32) -> bool,
    ) -> Self {
        let mut pulls = vec![Pull::default(); mesh.triangles.len()];
        // What is nearest takes more room than the points.
        for points in points.chunks(AT_A_TIME) {
            for (point, closest) in points.iter().zip(tree.nearest(points)) {
                let Some(closest) = closest else { continue };
                let t = closest.triangle as usize;
                if let Some(at) = barycentric(mesh.surface().corners(t), closest.point) {
                    pulls[t].add(at, *point - closest.point);
                }
            }
        }
        let mut is_free = inner(mesh);
        for (v, is_free) in is_free.iter_mut().enumerate() {
            *is_free &= !is_held(id(v));
        }
        let normals: Vec<DVec3> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.surface().corners(t);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let staying = STAYING * points.len() as f64 / mesh.positions.len().max(1) as f64;
        let mut wanted = vec![DVec3::ZERO; mesh.positions.len()];
        let mut diagonal = vec![DMat3::from_diagonal(DVec3::splat(staying)); wanted.len()];
        for ((corners, pull), &normal) in mesh.triangles.iter().zip(&pulls).zip(&normals) {
            for (k, &v) in corners.iter().enumerate() {
                wanted[v as usize] += seen(normal, pull.ways[k]);
                diagonal[v as usize] += outer(normal) * pull.weights[k];
            }
        }
        let inverse = diagonal.into_iter().map(|m| m.inverse()).collect();
        for (wanted, _) in wanted.iter_mut().zip(&is_free).filter(|(_, free)| !**free) {
            *wanted = DVec3::ZERO;
        }
        Self {
            triangles: &mesh.triangles,
            weights: pulls.into_iter().map(|pull| pull.weights).collect(),
            normals,
            wanted,
            inverse,
            staying,
            is_free,
        }
    }

    /// Conjugate gradients, with the blocks of the diagonal as preconditioner.
    fn solve(&self) -> Vec<DVec3> {
        let mut moves = vec![DVec3::ZERO; self.wanted.len()];
        let mut residual = self.wanted.clone();
        let mut way: Vec<DVec3> = self.preconditioned(&residual);
        let mut square = dot(&residual, &way);
        let enough = LEFT * LEFT * square;
        let mut applied = vec![DVec3::ZERO; moves.len()];
        for _ in 0..STEPS {
            if square <= enough || square <= 0.0 {
                break;
            }
            self.apply(&way, &mut applied);
            let length = square / dot(&way, &applied);
            for v in 0..moves.len() {
                moves[v] += length * way[v];
                residual[v] -= length * applied[v];
            }
            let next = self.preconditioned(&residual);
            let next_square = dot(&residual, &next);
            for (way, next) in way.iter_mut().zip(next) {
                *way = next + *way * (next_square / square);
            }
            square = next_square;
        }
        moves
    }

    fn preconditioned(&self, residual: &[DVec3]) -> Vec<DVec3> {
        residual
            .iter()
            .zip(&self.inverse)
            .map(|(r, m)| *m * *r)
            .collect()
    }

    fn apply(&self, moves: &[DVec3], to: &mut [DVec3]) {
        for (to, by) in to.iter_mut().zip(moves) {
            *to = *by * self.staying;
        }
        for ((&corners, w), &normal) in self.triangles.iter().zip(&self.weights).zip(&self.normals)
        {
            let [a, b, c] = corners.map(|v| moves[v as usize]);
            let sums = [
                w[0] * a + w[3] * b + w[5] * c,
                w[3] * a + w[1] * b + w[4] * c,
                w[5] * a + w[4] * b + w[2] * c,
            ];
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

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
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

    fn rms(mesh: &WeldedMesh, points: &[DVec3]) -> f64 {
        distance::from_points(points, mesh.surface()).unwrap().rms
    }

    #[test]
    fn vertices_outside_of_a_curved_surface_come_nearer_and_borders_stay() {
        let source = bent(300, 0.0);
        let points = distance::samples(source.surface(), 20_000).unwrap();
        let mut mesh = bent(10, 0.01);
        let before = mesh.clone();
        let farthest = refit(&mut mesh, &points, |_| false);
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
        let points = distance::samples(mesh.surface(), 20_000).unwrap();
        assert!(refit(&mut mesh, &points, |_| false) < 1e-12);
        let before = mesh.clone();
        assert!(refit(&mut mesh, &[], |_| false) <= 0.0);
        assert_eq!(mesh.positions, before.positions);
    }

    #[test]
    fn what_is_held_stays() {
        let points = distance::samples(bent(300, 0.0).surface(), 20_000).unwrap();
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
        let mut points = distance::samples(mesh.surface(), 2_000).unwrap();
        points.extend((0..500).map(|k| DVec3::new(2.0, 2.0 + f64::from(k) * 1e-3, 0.5)));
        let before = mesh.clone();
        refit(&mut mesh, &points, |_| false);
        for t in 0..mesh.triangles.len() {
            let [old, new] =
                [&before, &mesh].map(|mesh| distance::normal(mesh.surface().corners(t)));
            assert!(old.unwrap().dot(new.unwrap()) > 0.69);
        }
    }
}
