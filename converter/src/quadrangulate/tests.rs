use super::*;
use crate::mesh::NONE;
use glam::DVec3;
use std::collections::HashMap;

fn manifold(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> ManifoldMesh {
    let mut by_edge = HashMap::new();
    for (t, tri) in (0u32..).zip(&triangles) {
        for k in 0..3 {
            by_edge.insert(
                (tri[k], tri[(k + 1) % 3]),
                3 * t + u32::try_from(k).unwrap(),
            );
        }
    }
    let twins = triangles
        .iter()
        .flat_map(|tri| {
            (0..3).map(|k| {
                by_edge
                    .get(&(tri[(k + 1) % 3], tri[k]))
                    .copied()
                    .unwrap_or(NONE)
            })
        })
        .collect();
    ManifoldMesh {
        origin: (0..u32::try_from(positions.len()).unwrap()).collect(),
        normals: positions.iter().map(|p| p.normalize_or_zero()).collect(),
        colours: Vec::new(),
        positions,
        triangles,
        twins,
        cap_apexes: Vec::new(),
    }
}

/// Every vertex its own region.
fn discrete(mesh: &ManifoldMesh) -> Segmentation {
    Segmentation {
        labels: mesh.origin.clone(),
        regions: u32::try_from(mesh.positions.len()).unwrap(),
        crossings: vec![0.5; 3 * mesh.triangles.len()],
    }
}

fn area(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum()
}

fn check(mesh: &ManifoldMesh, layout: &Layout, open_borders: usize) {
    let mut uses = vec![0; layout.borders.len()];
    for patch in &layout.patches {
        for (side, &(border, forward)) in patch.sides.iter().zip(&patch.borders) {
            uses[border as usize] += 1;
            let curve = &layout.borders[border as usize];
            assert_eq!(side.len(), curve.points.len());
            assert_eq!(curve.params.len(), curve.points.len());
            assert!(curve.params.windows(2).all(|w| w[0] < w[1]));
            for (i, &v) in side.iter().enumerate() {
                let at = if forward { i } else { side.len() - 1 - i };
                assert_eq!(patch.positions[v as usize], curve.points[at]);
            }
        }
        for s in 0..4 {
            assert_eq!(patch.sides[s].last(), patch.sides[(s + 1) % 4].first());
        }
    }
    assert!(uses.iter().all(|&u| u == 1 || u == 2), "{uses:?}");
    assert_eq!(uses.iter().filter(|&&u| u == 1).count(), open_borders);
    let total: f64 = layout
        .patches
        .iter()
        .map(|p| area(&p.positions, &p.triangles))
        .sum();
    let whole = area(&mesh.positions, &mesh.triangles);
    assert!(
        (total / whole - 1.0).abs() < 1e-9,
        "area {total} of {whole}"
    );
}

fn tetrahedron() -> ManifoldMesh {
    let p = [
        [1.0, 1.0, 1.0],
        [1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
    ];
    manifold(
        p.map(DVec3::from_array).to_vec(),
        vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
    )
}

#[test]
fn a_tetrahedron_has_three_quads_a_corner() {
    let mesh = tetrahedron();
    let layout = quadrangulate(&mesh, &discrete(&mesh), &mut Flattenings::default()).unwrap();
    assert_eq!(layout.patches.len(), 12);
    check(&mesh, &layout, 0);
}

#[test]
fn a_single_triangle_has_nine_quads_and_six_open_borders() {
    let mesh = manifold(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
    let layout = quadrangulate(&mesh, &discrete(&mesh), &mut Flattenings::default()).unwrap();
    assert_eq!(layout.patches.len(), 9);
    check(&mesh, &layout, 6);
}

#[test]
fn a_missing_side_is_reported() {
    let mesh = tetrahedron();
    let mut two = discrete(&mesh);
    two.labels = vec![0, 0, 1, 1];
    two.regions = 2;
    assert!(matches!(
        quadrangulate(&mesh, &two, &mut Flattenings::default()),
        Err(QuadrangulateError::Structure { .. })
    ));
}

/// A bumpy grid whose regions are squares of cells, shifted every other row like bricks so that corners have degree 3.
#[test]
fn a_brick_wall_is_cut_without_loss() {
    let n = 24u32;
    let positions: Vec<DVec3> = (0..n * n)
        .map(|i| {
            let (x, y) = (f64::from(i % n), f64::from(i / n));
            DVec3::new(
                x + 0.2 * (y * 1.7).sin(),
                y + 0.2 * (x * 2.3).cos(),
                (0.4 * x).sin() * (0.3 * y).cos(),
            )
        })
        .collect();
    let triangles = (0..(n - 1) * (n - 1))
        .flat_map(|i| {
            let a = i / (n - 1) * n + i % (n - 1);
            [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
        })
        .collect();
    let mesh = manifold(positions, triangles);
    let label = |i: u32| {
        let (x, y) = (i % n, i / n);
        let row = y / 6;
        let column = (x + row % 2 * 4) / 8;
        row * 4 + column
    };
    let mut segmentation = discrete(&mesh);
    segmentation.labels = (0..n * n).map(label).collect();
    let mut names: Vec<u32> = segmentation.labels.clone();
    names.sort_unstable();
    names.dedup();
    for l in &mut segmentation.labels {
        *l = u32::try_from(names.binary_search(l).unwrap()).unwrap();
    }
    segmentation.regions = u32::try_from(names.len()).unwrap();
    let layout = quadrangulate(&mesh, &segmentation, &mut Flattenings::default()).unwrap();
    let used_once = 2 * layout.borders.len() - 4 * layout.patches.len();
    check(&mesh, &layout, used_once);
    assert!(used_once >= 4);
}
