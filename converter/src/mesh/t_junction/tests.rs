use super::*;
use crate::mesh::{ImportedMesh, ManifoldMesh, NONE, prepare};

fn prepared(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> (ManifoldMesh, Account) {
    let (mesh, account) = prepare(ImportedMesh {
        positions: positions.iter().map(|&p| p.into()).collect(),
        triangles: triangles.to_vec(),
        ..ImportedMesh::default()
    })
    .unwrap();
    assert_eq!((mesh.check(), account.check()), (Ok(()), Ok(())));
    (mesh, account)
}

fn border_edges(mesh: &ManifoldMesh) -> usize {
    mesh.twins.iter().filter(|&&t| t == NONE).count()
}

/// Two walls in the plane z = 0 that meet along x = 0: one with `left` edges there, the other with `right`.
fn walls(left: u32, right: u32, scale: f64, offset: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for (n, x) in [(left, -1.0), (right, 1.0)] {
        let first = u32::try_from(positions.len()).unwrap();
        positions.push([x, 0.5, 0.0]);
        for i in 0..=n {
            positions.push([0.0, f64::from(i) / f64::from(n), 0.0]);
        }
        for i in 1..=n {
            let (a, b) = (first + i, first + i + 1);
            triangles.push(if x < 0.0 {
                [first, a, b]
            } else {
                [first, b, a]
            });
        }
    }
    for p in &mut positions {
        *p = p.map(|c| c * scale + offset);
    }
    (positions, triangles)
}

#[test]
fn walls_with_t_junctions_become_connected() {
    for (left, right) in [(1, 2), (1, 7), (2, 3), (3, 6), (4, 4), (5, 7)] {
        for (scale, offset) in [(1.0, 0.0), (1e-20, 0.0), (1e20, 0.0), (3.0, 1e7)] {
            let (positions, triangles) = walls(left, right, scale, offset);
            let (mesh, account) = prepared(&positions, &triangles);
            assert_eq!(mesh.components().1, 1, "{left} {right} {scale}");
            assert_eq!(border_edges(&mesh), 4, "{left} {right} {scale}");
            let common = (1..left).filter(|i| i * right % left == 0).count();
            let expected = left as usize + right as usize - 2 - 2 * common;
            assert_eq!(account.t_junctions, expected, "{left} {right}");
        }
    }
}

#[test]
fn vertices_beside_an_edge_are_left_alone() {
    let (mut positions, triangles) = walls(1, 2, 1.0, 0.0);
    // The middle of the right wall's side, moved away from the left wall.
    positions[5][0] = 1e-4;
    let (mesh, account) = prepared(&positions, &triangles);
    assert_eq!((account.t_junctions, mesh.components().1), (0, 2));
    // On the edge, but no piece would be shared: another wall stands on it with one corner.
    let mut positions: Vec<[f64; 3]> = walls(1, 1, 1.0, 0.0).0[..3].to_vec();
    positions.extend([[0.0, 0.5, 0.0], [1.0, 0.2, 0.0], [1.0, 0.8, 0.0]]);
    let (mesh, account) = prepared(&positions, &[[0, 1, 2], [3, 4, 5]]);
    assert_eq!((account.t_junctions, mesh.components().1), (0, 2));
}

#[test]
fn all_edges_of_a_triangle_can_be_cut() {
    // A triangle with a neighbour of two edges at each side.
    let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let middle =
        |a: usize, b: usize| [0, 1, 2].map(|k| f64::midpoint(corners[a][k], corners[b][k]));
    let mut positions = corners.to_vec();
    let mut triangles = vec![[0, 1, 2]];
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let m = middle(a, b);
        let i = u32::try_from(positions.len()).unwrap();
        positions.extend([m, [3.0 * m[0] - 3.0, 3.0 * m[1] - 3.0, 1.0]]);
        let [a, b] = [a, b].map(|v| u32::try_from(v).unwrap());
        triangles.extend([[b, i, i + 1], [i, a, i + 1]]);
    }
    let (mesh, account) = prepared(&positions, &triangles);
    assert_eq!((account.t_junctions, account.added_triangles), (3, 3));
    assert_eq!((mesh.components().1, border_edges(&mesh)), (1, 6));
    assert_eq!(mesh.triangles.len(), 10);
}

#[test]
fn a_sliver_with_its_apex_on_its_edge_is_no_junction() {
    let positions = [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let (mesh, account) = prepared(&positions, &[[0, 1, 2], [0, 2, 3], [2, 1, 3]]);
    assert_eq!((account.t_junctions, mesh.components().1), (0, 1));
}

#[test]
fn a_vertex_on_two_edges_of_a_narrow_triangle_is_put_into_one() {
    let positions = [
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [4.0, 1e-9, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [2.0, -1.0, 0.0],
    ];
    let (_, account) = prepared(&positions, &[[0, 1, 2], [3, 1, 5], [3, 2, 4]]);
    assert_eq!(account.t_junctions, 1);
}

#[test]
fn tree_finds_what_a_search_finds() {
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let positions: Vec<DVec3> = (0..500)
        .map(|_| DVec3::new(random(), random(), random() * 0.01))
        .collect();
    let tree = PointTree::new(&positions, (0..500).collect());
    for _ in 0..200 {
        let (a, b) = (
            DVec3::new(random(), random(), 0.0),
            DVec3::new(random(), random(), 0.01),
        );
        let near = 0.05 * random();
        let mut found = Vec::new();
        tree.for_each_near([a, b], near, |v| found.push(v));
        for (v, &p) in (0..).zip(&positions) {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            if (a + (b - a) * t).distance(p) <= near {
                assert!(found.contains(&v), "{v}");
            }
        }
    }
}
