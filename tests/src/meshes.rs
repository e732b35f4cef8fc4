//! Models made by formula, for machines without scans.

use glam::DVec3;
use std::f64::consts::TAU;

/// A triangle mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Model {
    /// The mesh, borrowed.
    pub fn mesh(&self) -> marquetry_evaluation::Mesh<'_> {
        marquetry_evaluation::Mesh {
            positions: &self.positions,
            triangles: &self.triangles,
        }
    }
}

/// The torus around z with tube radius 0.4 and ring radius 1, dented so that its curvature varies: closed, genus 1,
/// `2 * around * along` triangles.
pub fn torus(around: u32, along: u32) -> Model {
    let positions = (0..around * along)
        .map(|k| {
            let (u, v) = (
                TAU * f64::from(k % around) / f64::from(around),
                TAU * f64::from(k / around) / f64::from(along),
            );
            let tube = 0.4 + 0.04 * (5.0 * u).sin() * (3.0 * v).cos();
            let ring = 1.0 + tube * v.cos();
            DVec3::new(ring * u.cos(), ring * u.sin(), tube * v.sin())
        })
        .collect();
    let at = |i: u32, j: u32| i % around + j % along * around;
    let triangles = (0..around * along)
        .flat_map(|k| {
            let (i, j) = (k % around, k / around);
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Model {
        positions,
        triangles,
    }
}

/// The unit sphere as `2 * around * (rings - 1)` triangles between two poles.
pub fn sphere(around: u32, rings: u32) -> Model {
    let mut positions = vec![DVec3::Z];
    for ring in 1..rings {
        let polar = 0.5 * TAU * f64::from(ring) / f64::from(rings);
        positions.extend((0..around).map(|i| {
            let angle = TAU * f64::from(i) / f64::from(around);
            DVec3::new(
                polar.sin() * angle.cos(),
                polar.sin() * angle.sin(),
                polar.cos(),
            )
        }));
    }
    positions.push(-DVec3::Z);
    let at = |ring: u32, i: u32| 1 + (ring - 1) * around + i % around;
    let south = 1 + (rings - 1) * around;
    let mut triangles = Vec::new();
    for i in 0..around {
        triangles.push([0, at(1, i), at(1, i + 1)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, i), at(ring, i + 1));
            let (c, d) = (at(ring + 1, i + 1), at(ring + 1, i));
            triangles.extend([[a, d, c], [a, c, b]]);
        }
        triangles.push([south, at(rings - 1, i + 1), at(rings - 1, i)]);
    }
    Model {
        positions,
        triangles,
    }
}

/// A wavy square of `cells`² cells without its middle ninth: two border loops.
pub fn plane_with_hole(cells: u32) -> Model {
    let side = cells + 1;
    let positions = (0..side * side)
        .map(|k| {
            let (x, y) = (
                f64::from(k % side) / f64::from(cells),
                f64::from(k / side) / f64::from(cells),
            );
            DVec3::new(x, y, 0.05 * (7.0 * x).sin() * (5.0 * y).cos())
        })
        .collect();
    let middle = cells / 3..2 * cells / 3;
    let triangles = (0..cells * cells)
        .filter(|k| !(middle.contains(&(k % cells)) && middle.contains(&(k / cells))))
        .flat_map(|k| {
            let a = k / cells * side + k % cells;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        })
        .collect();
    Model {
        positions,
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive when the triangles face outwards.
    fn volume(model: &Model) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|v| model.positions[v as usize]);
        model
            .triangles
            .iter()
            .map(corners)
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    #[test]
    fn closed_models_face_outwards() {
        let sphere = sphere(96, 48);
        assert_eq!(sphere.triangles.len(), 2 * 96 * 47);
        assert!((volume(&sphere) - 2.0 / 3.0 * TAU).abs() < 0.02);
        let torus = torus(96, 48);
        assert!((volume(&torus) - TAU * TAU / 2.0 * 0.16).abs() < 0.1);
    }

    #[test]
    fn every_edge_of_a_closed_model_is_met_once_each_way() {
        for model in [sphere(8, 5), torus(9, 7)] {
            let mut edges: Vec<_> = model
                .triangles
                .iter()
                .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
                .collect();
            edges.sort_unstable();
            assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
            assert!(
                edges
                    .iter()
                    .all(|&(a, b)| edges.binary_search(&(b, a)).is_ok())
            );
        }
    }
}
