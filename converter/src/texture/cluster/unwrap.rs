//! Small meshes laid out on an image of their own.
//!
//! Triangles that hang together and look into about the same direction become a **patch**, which is projected along the mean
//! of its normals (as in Sander, Snyder, Gortler & Hoppe, "Texture mapping progressive meshes", 2001, with projection in place
//! of their parametrization). What would cover itself there is parted. Patches are turned to their smallest rectangle and put
//! on shelves, the highest first. Vertices come to lie on the centres of texels: an image is made for the places that came out,
//! so rounding them only stretches it a little.

use glam::{DMat2, DVec2, DVec3};
use marquetry_format::cluster::{MAX_CLUSTER_VERTICES, MAX_TEXTURE_TEXELS, TEXTURE_STEP};
use std::collections::HashMap;

/// Texels around a patch that belong to it, on each side.
const MARGIN: u32 = 2;
/// Cosines of the angle between a triangle and the patch that it joins; the next is tried where a mesh breaks into too many parts.
const TURNS: [f64; 5] = [0.64, 0.4, 0.15, 0.0, -0.5];
/// A triangle of a tiny patch joins another one up to this cosine.
const LENIENT: f64 = 0.2;
/// Triangles of a tiny patch.
const TINY: usize = 3;
/// Directions tried for the smallest rectangle, over a quarter turn.
const DIRECTIONS: u32 = 9;
/// What scales are lowered by until all patches fit.
const SHRINK: f64 = 0.93;
/// Cells a side that patches are looked at for overlap with.
const OVERLAP_CELLS: u32 = 48;
/// Times in a row that a patch is halved for overlap.
const HALVINGS: u32 = 6;

/// A mesh on its image.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Unwrapped {
    /// By vertex: which vertex of the mesh it is, and the texel whose centre it lies on.
    pub vertices: Vec<(u32, [u8; 2])>,
    /// Corners.
    pub triangles: Vec<[u32; 3]>,
    /// Width and height of the image, texels.
    pub size: [u32; 2],
    /// Texels a unit of length.
    pub scale: f64,
}

/// Lays out `triangles`, at `scale` texels a unit of length or fewer; `None` where they break into more vertices than a cluster has.
pub fn unwrap(positions: &[DVec3], triangles: &[[u32; 3]], scale: f64) -> Option<Unwrapped> {
    let mesh = Mesh::new(positions, triangles);
    let patches = mesh.few_patches()?;
    Some(mesh.packed(&patches, scale))
}

/// Whether [`unwrap`] lays out `triangles`.
pub fn is_unwrappable(positions: &[DVec3], triangles: &[[u32; 3]]) -> bool {
    Mesh::new(positions, triangles).few_patches().is_some()
}

struct Mesh<'a> {
    positions: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    /// Unit normals; zero without area.
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    /// Across each edge; a triangle without area joins any patch.
    beside: Vec<[Option<u32>; 3]>,
}

/// Triangles that are projected together, ascending.
type Patch = Vec<u32>;

/// A patch in the plane, in units of length, from (0, 0) on.
struct Flat {
    /// Vertices of the mesh and their places.
    places: HashMap<u32, DVec2>,
    extent: DVec2,
}

impl<'a> Mesh<'a> {
    fn new(positions: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = corners(t);
            (b - a).cross(c - a)
        };
        // Vertices of equal position count as one here: normals and colours may differ across a crease.
        let mut places: HashMap<[u64; 3], u32> = HashMap::new();
        let numbers: Vec<u32> = (0u32..)
            .zip(positions)
            .map(|(v, p)| *places.entry(p.to_array().map(f64::to_bits)).or_insert(v))
            .collect();
        let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
        let edge = |t: &[u32; 3], k: usize| [t[k], t[(k + 1) % 3]].map(|v| numbers[v as usize]);
        for (n, t) in (0u32..).zip(triangles) {
            for k in 0..3 {
                edges.entry(edge(t, k)).or_insert(n);
            }
        }
        let beside = triangles.iter().map(|t| {
            [0, 1, 2].map(|k| {
                let [a, b] = edge(t, k);
                edges.get(&[b, a]).copied()
            })
        });
        Self {
            positions,
            triangles,
            normals: triangles
                .iter()
                .map(|t| doubled(t).normalize_or_zero())
                .collect(),
            areas: triangles
                .iter()
                .map(|t| doubled(t).length() / 2.0)
                .collect(),
            beside: beside.collect(),
        }
    }

    /// Patches that look most alike and have no more vertices than a cluster.
    fn few_patches(&self) -> Option<Vec<Patch>> {
        TURNS.iter().find_map(|&turn| {
            let patches = self.patches(turn);
            let vertices: usize = patches.iter().map(|patch| self.vertices_of(patch)).sum();
            (vertices <= MAX_CLUSTER_VERTICES).then_some(patches)
        })
    }

    fn axis(&self, patch: &[u32]) -> DVec3 {
        let weighted = |&t: &u32| self.normals[t as usize] * self.areas[t as usize];
        patch
            .iter()
            .map(weighted)
            .sum::<DVec3>()
            .normalize_or_zero()
    }

    fn patches(&self, turn: f64) -> Vec<Patch> {
        let mut of: Vec<Option<u32>> = vec![None; self.triangles.len()];
        let mut order: Vec<u32> = (0u32..).zip(self.triangles).map(|(t, _)| t).collect();
        order.sort_by(|&a, &b| {
            self.areas[b as usize]
                .total_cmp(&self.areas[a as usize])
                .then(a.cmp(&b))
        });
        let mut count = 0u32;
        for &seed in &order {
            if of[seed as usize].is_some() {
                continue;
            }
            let mut sum = DVec3::ZERO;
            let mut next = std::collections::VecDeque::from([seed]);
            while let Some(t) = next.pop_front() {
                let normal = self.normals[t as usize];
                let alike = normal == DVec3::ZERO || normal.dot(sum.normalize_or(normal)) >= turn;
                if of[t as usize].is_some() || !alike {
                    continue;
                }
                of[t as usize] = Some(count);
                sum += normal * self.areas[t as usize];
                next.extend(self.beside[t as usize].iter().flatten());
            }
            count += 1;
        }
        let mut patches = grouped(&of, count);
        self.join_tiny(&mut of, &patches);
        patches = grouped(&of, count);
        patches.retain(|patch| !patch.is_empty());
        patches
            .into_iter()
            .flat_map(|patch| self.parted(patch, HALVINGS))
            .collect()
    }

    /// Gives the triangles of tiny patches to those beside them.
    fn join_tiny(&self, of: &mut [Option<u32>], patches: &[Patch]) {
        for patch in patches.iter().filter(|patch| patch.len() <= TINY) {
            let own = patch.first().and_then(|&t| of[t as usize]);
            let others = patch
                .iter()
                .flat_map(|&t| self.beside[t as usize])
                .flatten();
            let best = others
                .filter_map(|t| of[t as usize].filter(|&other| Some(other) != own))
                .map(|other| {
                    let axis = self.axis(&patches[other as usize]);
                    let worst = patch.iter().map(|&t| self.normals[t as usize].dot(axis));
                    (other, worst.fold(1.0, f64::min))
                })
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            if let Some((other, turn)) = best
                && turn >= LENIENT
            {
                for &t in patch {
                    of[t as usize] = Some(other);
                }
            }
        }
    }

    /// Halves `patch`, by depth, where its projection covers itself.
    fn parted(&self, mut patch: Patch, halvings: u32) -> Vec<Patch> {
        if halvings == 0
            || patch.len() < 2
            || !self
                .flat(&patch)
                .is_some_and(|flat| self.overlaps(&patch, &flat))
        {
            return vec![patch];
        }
        let axis = self.axis(&patch);
        let depth = |&t: &u32| {
            let corners = self.triangles[t as usize].map(|v| self.positions[v as usize]);
            axis.dot(corners.into_iter().sum::<DVec3>())
        };
        patch.sort_by(|a, b| depth(a).total_cmp(&depth(b)).then(a.cmp(b)));
        let mut upper = patch.split_off(patch.len() / 2);
        patch.sort_unstable();
        upper.sort_unstable();
        [patch, upper]
            .into_iter()
            .flat_map(|half| self.parted(half, halvings - 1))
            .collect()
    }

    /// Whether more than a few cells are covered twice.
    fn overlaps(&self, patch: &[u32], flat: &Flat) -> bool {
        let scale = f64::from(OVERLAP_CELLS) / flat.extent.max_element().max(f64::MIN_POSITIVE);
        let side = OVERLAP_CELLS as usize + 1;
        let mut covered = vec![0u8; side * side];
        for &t in patch {
            let [a, b, c] = self.triangles[t as usize].map(|v| flat.places[&v] * scale);
            let area = (b - a).perp_dot(c - a);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let [first, last] = [low, high].map(|p| p.floor().max(DVec2::ZERO).as_uvec2());
            for j in first.y..=last.y.min(OVERLAP_CELLS) {
                for i in first.x..=last.x.min(OVERLAP_CELLS) {
                    let p = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5);
                    let inside = [(a, b), (b, c), (c, a)]
                        .into_iter()
                        .all(|(a, b)| (b - a).perp_dot(p - a) * area.signum() > 0.0);
                    let cell = &mut covered[j as usize * side + i as usize];
                    *cell = cell.saturating_add(u8::from(inside));
                }
            }
        }
        let twice = covered.iter().filter(|&&count| count > 1).count();
        let all = covered.iter().filter(|&&count| count > 0).count();
        twice > 3 + all / 100
    }

    fn vertices_of(&self, patch: &[u32]) -> usize {
        let mut vertices: Vec<u32> = patch
            .iter()
            .flat_map(|&t| self.triangles[t as usize])
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.len()
    }

    /// `None` for a patch without area.
    fn flat(&self, patch: &[u32]) -> Option<Flat> {
        let axis = self.axis(patch);
        let (across, up) = if axis == DVec3::ZERO {
            let first =
                self.triangles[*patch.first()? as usize].map(|v| self.positions[v as usize]);
            let along = (first[1] - first[0]).normalize_or(DVec3::X);
            (along, along.any_orthonormal_vector())
        } else {
            axis.any_orthonormal_pair()
        };
        let project = |v: u32| {
            let p = self.positions[v as usize];
            DVec2::new(p.dot(across), p.dot(up))
        };
        let vertices: Vec<u32> = patch
            .iter()
            .flat_map(|&t| self.triangles[t as usize])
            .collect();
        let points: Vec<DVec2> = vertices.iter().map(|&v| project(v)).collect();
        let turned = |step: u32| {
            let angle = f64::from(step) / f64::from(DIRECTIONS) * std::f64::consts::FRAC_PI_2;
            let turn = DMat2::from_angle(angle);
            let (low, high) = points
                .iter()
                .map(|p| turn * *p)
                .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| {
                    (low.min(p), high.max(p))
                });
            (turn, low, high - low)
        };
        let (turn, low, extent) = (0..DIRECTIONS)
            .map(turned)
            .min_by(|a, b| (a.2.x * a.2.y).total_cmp(&(b.2.x * b.2.y)))?;
        // Lying, as shelves are best filled.
        let lies = extent.x >= extent.y;
        let place = |p: DVec2| {
            let p = turn * p - low;
            if lies {
                p
            } else {
                DVec2::new(extent.y - p.y, p.x)
            }
        };
        let places = vertices.iter().zip(&points).map(|(&v, &p)| (v, place(p)));
        Some(Flat {
            places: places.collect(),
            extent: if lies {
                extent
            } else {
                DVec2::new(extent.y, extent.x)
            },
        })
    }

    fn packed(&self, patches: &[Patch], scale: f64) -> Unwrapped {
        let flats: Vec<Flat> = patches
            .iter()
            .filter_map(|patch| self.flat(patch))
            .collect();
        let longest = flats
            .iter()
            .map(|flat| flat.extent.max_element())
            .fold(0.0, f64::max);
        let room = f64::from(MAX_TEXTURE_TEXELS - 2 * MARGIN - 1);
        let mut scale = scale.min(room / longest.max(f64::MIN_POSITIVE));
        loop {
            if let Some((corners, size)) = shelves(&flats, scale) {
                return self.placed(patches, &flats, &corners, size, scale);
            }
            scale *= SHRINK;
        }
    }

    fn placed(
        &self,
        patches: &[Patch],
        flats: &[Flat],
        corners: &[[u32; 2]],
        size: [u32; 2],
        scale: f64,
    ) -> Unwrapped {
        let mut out = Unwrapped {
            size,
            scale,
            triangles: vec![[0; 3]; self.triangles.len()],
            ..Unwrapped::default()
        };
        for ((patch, flat), corner) in patches.iter().zip(flats).zip(corners) {
            let mut numbers: HashMap<u32, u32> = HashMap::new();
            for &t in patch {
                out.triangles[t as usize] = self.triangles[t as usize].map(|v| {
                    *numbers.entry(v).or_insert_with(|| {
                        let place = flat.places[&v] * scale;
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "shelves hold it"
                        )]
                        let texel =
                            |along: f64, first: u32| (along.round() as u32 + first + MARGIN) as u8;
                        let texels = [texel(place.x, corner[0]), texel(place.y, corner[1])];
                        out.vertices.push((v, texels));
                        u32::try_from(out.vertices.len() - 1).unwrap_or(u32::MAX)
                    })
                });
            }
        }
        out
    }
}

fn grouped(of: &[Option<u32>], count: u32) -> Vec<Patch> {
    let mut patches = vec![Patch::new(); count as usize];
    for (t, patch) in (0u32..).zip(of) {
        if let Some(patch) = patch {
            patches[*patch as usize].push(t);
        }
    }
    patches
}

/// The first texel of every patch's rectangle, margin included, and the size of the image; `None` where they do not fit.
fn shelves(flats: &[Flat], scale: f64) -> Option<(Vec<[u32; 2]>, [u32; 2])> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts saturate"
    )]
    let texels = |length: f64| ((length * scale).round() as u32).saturating_add(1 + 2 * MARGIN);
    let sizes: Vec<[u32; 2]> = flats
        .iter()
        .map(|flat| [texels(flat.extent.x), texels(flat.extent.y)])
        .collect();
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&k| (std::cmp::Reverse(sizes[k]), k));
    order.sort_by_key(|&k| std::cmp::Reverse(sizes[k][1]));
    let whole = |texels: u32| texels.next_multiple_of(TEXTURE_STEP);
    let widest = sizes.iter().map(|size| size[0]).max()?;
    let steps = whole(widest)..=MAX_TEXTURE_TEXELS;
    steps
        .step_by(TEXTURE_STEP as usize)
        .filter_map(|width| {
            let mut corners = vec![[0, 0]; sizes.len()];
            let ([mut x, mut y], mut shelf) = ([0, 0], 0);
            for &k in &order {
                let [w, h] = sizes[k];
                if x + w > width {
                    (x, y, shelf) = (0, y + shelf, 0);
                }
                corners[k] = [x, y];
                x += w;
                shelf = shelf.max(h);
            }
            let height = whole(y + shelf);
            (height <= MAX_TEXTURE_TEXELS).then_some((corners, [width, height]))
        })
        .min_by_key(|(_, [width, height])| (width * height, *width))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An open box of side 10 with its faces cut into `cells`² squares, one vertex a place.
    fn box_of(cells: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        let face = |number: u32, i: u32, j: u32| match number {
            0 => [j, i, 0],
            1 => [i, 0, j],
            2 => [j, cells, i],
            3 => [0, j, i],
            _ => [cells, i, j],
        };
        for number in 0..5 {
            let mut vertex = |i: u32, j: u32| {
                let place = face(number, i, j);
                *numbers.entry(place).or_insert_with(|| {
                    positions
                        .push(DVec3::from_array(place.map(f64::from)) * 10.0 / f64::from(cells));
                    u32::try_from(positions.len() - 1).unwrap()
                })
            };
            for i in 0..cells {
                for j in 0..cells {
                    let [a, b, c, d] =
                        [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| vertex(i, j));
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        (positions, triangles)
    }

    /// Texels that more than one triangle covers with its inside.
    fn covered_twice(mesh: &Unwrapped) -> usize {
        let mut covered = vec![0u32; (mesh.size[0] * mesh.size[1]) as usize];
        for t in &mesh.triangles {
            let [a, b, c] =
                t.map(|v| DVec2::from_array(mesh.vertices[v as usize].1.map(f64::from)));
            let turn = (b - a).perp_dot(c - a).signum();
            for (k, count) in (0u32..).zip(&mut covered) {
                let p = DVec2::new(f64::from(k % mesh.size[0]), f64::from(k / mesh.size[0]));
                let inside = |a: DVec2, b: DVec2| (b - a).perp_dot(p - a) * turn > 0.0;
                *count += u32::from(inside(a, b) && inside(b, c) && inside(c, a));
            }
        }
        covered.iter().filter(|&&count| count > 1).count()
    }

    #[test]
    fn faces_of_a_box_are_patches_of_their_true_size() {
        let (positions, triangles) = box_of(3);
        let mesh = unwrap(&positions, &triangles, 6.0).unwrap();
        assert_eq!(mesh.triangles.len(), triangles.len());
        // Five faces of 16 vertices each, none shared.
        assert_eq!(mesh.vertices.len(), 80);
        assert!((mesh.scale - 6.0).abs() < 1e-12);
        assert!(
            mesh.size
                .iter()
                .all(|side| side % TEXTURE_STEP == 0 && *side <= MAX_TEXTURE_TEXELS)
        );
        for (given, t) in triangles.iter().zip(&mesh.triangles) {
            for k in 0..3 {
                let [a, b] = [t[k], t[(k + 1) % 3]].map(|v| mesh.vertices[v as usize]);
                assert_eq!([a.0, b.0], [given[k], given[(k + 1) % 3]]);
                let length = positions[a.0 as usize].distance(positions[b.0 as usize]) * 6.0;
                let [a, b] = [a, b].map(|(_, place)| DVec2::from_array(place.map(f64::from)));
                assert!((a.distance(b) - length).abs() < 1.5, "{a} {b} {length}");
            }
        }
        assert_eq!(covered_twice(&mesh), 0);
        let margin = u8::try_from(MARGIN).unwrap();
        for (_, [i, j]) in &mesh.vertices {
            assert!(*i >= margin && *j >= margin);
            assert!(u32::from(*i) + MARGIN < mesh.size[0] && u32::from(*j) + MARGIN < mesh.size[1]);
        }
    }

    #[test]
    fn what_does_not_fit_gets_coarser_texels() {
        let (positions, triangles) = box_of(2);
        let mesh = unwrap(&positions, &triangles, 1e6).unwrap();
        assert!(mesh.scale < 26.0 && mesh.scale > 5.0, "{}", mesh.scale);
        assert!(mesh.size.iter().all(|side| *side <= MAX_TEXTURE_TEXELS));
        assert_eq!(covered_twice(&mesh), 0);
    }

    /// Two turns of a helicoid: no triangle looks far from the axis, yet it covers itself when seen along it.
    #[test]
    fn surfaces_that_cover_themselves_are_parted() {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for step in 0..=32u32 {
            let angle = f64::from(step) / 32.0 * 4.0 * std::f64::consts::PI;
            for radius in [4.0, 10.0] {
                positions.push(DVec3::new(
                    radius * angle.cos(),
                    radius * angle.sin(),
                    0.1 * angle,
                ));
            }
            if step > 0 {
                let n = 2 * step;
                triangles.extend([[n - 2, n - 1, n], [n - 1, n + 1, n]]);
            }
        }
        let mesh = unwrap(&positions, &triangles, 5.0).unwrap();
        assert!(covered_twice(&mesh) < 30, "{}", covered_twice(&mesh));
        assert!(mesh.vertices.len() > positions.len());
    }

    #[test]
    fn rough_meshes_are_refused_rather_than_shown_wrong() {
        // Every triangle is alone and looks elsewhere: there is nothing to cut. Three vertices each are all there can be.
        let spike = |k: u32| {
            let angle = f64::from(k) * 2.4;
            let at = DVec3::new(f64::from(k % 16), f64::from(k / 16), 0.0) * 3.0;
            [
                DVec3::ZERO,
                DVec3::new(angle.cos(), angle.sin(), 1.0),
                DVec3::Z,
            ]
            .map(|p| at + p)
        };
        let positions: Vec<DVec3> = (0..80).flat_map(spike).collect();
        let triangles: Vec<[u32; 3]> = (0..80).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        assert!(is_unwrappable(&positions, &triangles));
        let positions: Vec<DVec3> = (0..90).flat_map(spike).collect();
        let triangles: Vec<[u32; 3]> = (0..90).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        assert!(!is_unwrappable(&positions, &triangles));
    }

    #[test]
    fn flat_triangles_have_places_too() {
        let positions = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X, DVec3::Y];
        let mesh = unwrap(&positions, &[[0, 1, 3], [0, 2, 1]], 20.0).unwrap();
        assert_eq!(mesh.triangles.len(), 2);
        let alone = unwrap(&positions, &[[0, 2, 1]], 20.0).unwrap();
        assert!(alone.vertices.iter().any(|(_, place)| place[0] > 30));
    }
}
