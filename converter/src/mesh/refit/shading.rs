//! Normals of vertices that, interpolated over the triangles, are nearest in the least squares to those of a source.

use super::gradients;
use glam::DVec3;

/// Weight of a vertex's own normal, over that of the points of a vertex on average.
const OWN: f64 = 0.02;
/// Cosine between a triangle and the normal of a point from which on the point is of another sheet, or of a detail that is gone.
const FOREIGN: f64 = 0.3;
/// Cosine between a vertex's own normal and the one that is found, at least.
const ALIKE: f64 = 0.7;

/// What the points nearest to a triangle say.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shade {
    /// Sums of products of weights of corners: 00, 11, 22, 01, 12, 20.
    pub(super) weights: [f64; 6],
    /// By corner, the sum of the points' normals.
    normals: [DVec3; 3],
}

impl Shade {
    /// Adds a point at weights of corners; `face` is the triangle's normal, `told` that of the point, up to its sign.
    pub(super) fn add(&mut self, at: [f64; 3], face: DVec3, told: DVec3) {
        let cosine = face.dot(told);
        let normal = if cosine.abs() < FOREIGN {
            face
        } else {
            told * cosine.signum()
        };
        for k in 0..3 {
            self.weights[k] += at[k] * at[k];
            self.weights[3 + k] += at[k] * at[(k + 1) % 3];
            self.normals[k] += normal * at[k];
        }
    }

    /// The weights' matrix times a vector by corner.
    pub(super) fn product(&self, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
        let w = &self.weights;
        [
            w[0] * a + w[3] * b + w[5] * c,
            w[3] * a + w[1] * b + w[4] * c,
            w[5] * a + w[4] * b + w[2] * c,
        ]
    }
}

/// What points say of the normals of a mesh.
#[derive(Debug, Clone, Default)]
pub struct Shading {
    /// By triangle.
    pub(super) shades: Vec<Shade>,
}

impl Shading {
    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        self.shades.is_empty()
    }

    /// Brings unit `normals` of vertices nearer to what points say, but those that are held. `triangles` are those of the mesh that was
    /// fitted, whose corners may be numbered otherwise: several vertices at one place have normals of their own.
    pub fn fit(
        &self,
        triangles: &[[u32; 3]],
        normals: &mut [DVec3],
        is_held: impl Fn(u32) -> bool,
    ) {
        let is_free: Vec<bool> = (0u32..).take(normals.len()).map(|v| !is_held(v)).collect();
        let of_triangles = || triangles.iter().zip(&self.shades);
        let mut diagonal = vec![0.0; normals.len()];
        let mut wanted = vec![DVec3::ZERO; normals.len()];
        for (corners, shade) in of_triangles() {
            let own = shade.product(corners.map(|v| normals[v as usize]));
            for (k, &v) in corners.iter().enumerate() {
                diagonal[v as usize] += shade.weights[k];
                wanted[v as usize] += shade.normals[k] - own[k];
            }
        }
        let mean = diagonal.iter().sum::<f64>() / normals.len().max(1) as f64;
        let staying = (OWN * mean).max(f64::MIN_POSITIVE);
        let hold = |of: &mut [DVec3]| {
            for (of, _) in of.iter_mut().zip(&is_free).filter(|(_, free)| !**free) {
                *of = DVec3::ZERO;
            }
        };
        hold(&mut wanted);
        let preconditioned = |residual: &[DVec3]| {
            let scaled = residual.iter().zip(&diagonal);
            scaled.map(|(r, d)| *r / (d + staying)).collect()
        };
        let changes = gradients::solve(&wanted, preconditioned, |changes, to| {
            for (to, by) in to.iter_mut().zip(changes) {
                *to = *by * staying;
            }
            for (corners, shade) in of_triangles() {
                let sums = shade.product(corners.map(|v| changes[v as usize]));
                for (&v, sum) in corners.iter().zip(sums) {
                    to[v as usize] += sum;
                }
            }
            hold(to);
        });
        for (normal, change) in normals.iter_mut().zip(changes) {
            let found = (*normal + change).normalize_or_zero();
            if found.dot(*normal) >= ALIKE {
                *normal = found;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a square, with points all over both that say `told` of where they are.
    fn said(told: impl Fn(f64, f64) -> DVec3) -> ([[u32; 3]; 2], Shading) {
        let mut shades = vec![Shade::default(); 2];
        for k in 0..400 {
            let [x, y] = [k % 20, k / 20].map(|c| (f64::from(c) + 0.5) / 20.0);
            let (t, at) = if x >= y {
                (0, [1.0 - x, x - y, y])
            } else {
                (1, [1.0 - y, x, y - x])
            };
            shades[t].add(at, DVec3::Z, told(x, y));
        }
        ([[0, 1, 2], [0, 2, 3]], Shading { shades })
    }

    fn tilted(by: f64) -> DVec3 {
        DVec3::new(by, 0.0, 1.0)
    }

    #[test]
    fn normals_are_those_that_interpolate_what_points_say() {
        let (triangles, shading) = said(|x, _| tilted(0.1 * x));
        let mut normals = [DVec3::Z; 4];
        shading.fit(&triangles, &mut normals, |v| v == 1);
        assert_eq!(normals[1], DVec3::Z);
        for (v, tilt) in [(0, 0.0), (2, 0.1), (3, 0.0)] {
            let angle = normals[v].angle_between(tilted(tilt));
            assert!(angle < 0.03, "{v}: {angle}");
        }
        let mut normals = [DVec3::Z; 4];
        shading.fit(&triangles, &mut normals, |_| false);
        for (v, tilt) in [(0, 0.0), (1, 0.1), (2, 0.1), (3, 0.0)] {
            let angle = normals[v].angle_between(tilted(tilt));
            assert!(angle < 4e-3, "{v}: {angle}");
        }
    }

    #[test]
    fn points_of_other_sheets_say_nothing_and_the_back_of_one_is_turned() {
        let (triangles, shading) = said(|x, _| if x < 0.5 { DVec3::X } else { -DVec3::Z });
        let mut normals = [DVec3::Z; 4];
        shading.fit(&triangles, &mut normals, |_| false);
        assert!(normals.iter().all(|n| n.angle_between(DVec3::Z) < 1e-6));
    }

    #[test]
    fn vertices_are_never_turned_far() {
        let (triangles, shading) = said(|_, _| tilted(2.0));
        let mut normals = [DVec3::Z; 4];
        shading.fit(&triangles, &mut normals, |_| false);
        assert_eq!(normals, [DVec3::Z; 4]);
        Shading::default().fit(&triangles, &mut normals, |_| false);
        assert_eq!(normals, [DVec3::Z; 4]);
    }
}
