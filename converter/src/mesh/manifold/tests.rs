use super::*;
use crate::mesh::account::Reason;
use crate::mesh::{ImportedMesh, prepare};

fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> ImportedMesh {
    ImportedMesh {
        positions: points.iter().map(|p| DVec3::from_array(*p)).collect(),
        colours: Vec::new(),
        triangles: triangles.to_vec(),
        ..ImportedMesh::default()
    }
}

/// Prepares, checks every promise, and gives the mesh and its account.
fn valid(mesh: ImportedMesh) -> (ManifoldMesh, Account) {
    let (manifold, account) = prepare(mesh).unwrap();
    assert_eq!(manifold.check(), Ok(()));
    assert_eq!(account.check(), Ok(()));
    (manifold, account)
}

fn border_edges(mesh: &ManifoldMesh) -> usize {
    mesh.twins.iter().filter(|t| **t == NONE).count()
}

fn euler(mesh: &ManifoldMesh) -> i64 {
    let [v, f, h, b] = [
        mesh.positions.len(),
        mesh.triangles.len(),
        mesh.twins.len(),
        border_edges(mesh),
    ]
    .map(|n| i64::try_from(n).unwrap());
    v - i64::midpoint(h, b) + f
}

fn volume(mesh: &ManifoldMesh) -> f64 {
    mesh.triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            a.cross(b).dot(c) / 6.0
        })
        .sum()
}

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
const CORNER: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
];

/// A cube's twelve triangles, outward, on vertices numbered by bits x + 2 y + 4 z and mapped by `v`.
fn cube(v: impl Fn(u32) -> u32) -> Vec<[u32; 3]> {
    [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ]
    .iter()
    .flat_map(|&[a, b, c, d]: &[u32; 4]| [[v(a), v(b), v(c)], [v(a), v(c), v(d)]])
    .collect()
}

/// `columns` squares in a band, whose ends are glued with a half twist if `twisted`.
fn band(columns: u32, twisted: bool) -> ImportedMesh {
    let mut points = Vec::new();
    for i in 0..columns {
        let angle = f64::from(i) / f64::from(columns) * std::f64::consts::TAU;
        let tilt = if twisted { angle / 2.0 } else { 0.0 };
        for side in [-0.3, 0.3] {
            let r = 1.0 + side * tilt.sin();
            points.push([r * angle.cos(), r * angle.sin(), side * tilt.cos()]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..columns {
        let swap = u32::from(twisted && i + 1 == columns);
        let (a, b) = (2 * i, 2 * i + 1);
        let j = (i + 1) % columns;
        let (c, d) = (2 * j + swap, 2 * j + 1 - swap);
        triangles.extend([[a, c, b], [b, c, d]]);
    }
    mesh(&points, &triangles)
}

/// A torus of n × m vertices; with `klein` the second seam is glued mirrored. Positions are only distinct.
fn torus(n: u32, m: u32, klein: bool) -> ImportedMesh {
    let mut points = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
            let (a, b) = (a * std::f64::consts::TAU, b * std::f64::consts::TAU);
            points.push([
                (2.0 + b.cos()) * a.cos(),
                (2.0 + b.cos()) * a.sin(),
                b.sin(),
            ]);
        }
    }
    let at = |i: u32, j: u32| {
        let j = if klein && i == n {
            (m - j % m) % m
        } else {
            j % m
        };
        (i % n) * m + j
    };
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(&points, &triangles)
}

#[test]
fn single_triangle_is_a_disk() {
    let (m, account) = valid(mesh(&CORNER[..3], &[[0, 1, 2]]));
    assert_eq!((m.triangles.len(), border_edges(&m), euler(&m)), (1, 3, 1));
    assert_eq!(account.topology.boundary_loops, 1);
    assert_eq!(m.normals, [DVec3::Z; 3]);
}

#[test]
fn closed_meshes_end_up_outward_however_they_came() {
    for turned in 0..16_u32 {
        let triangles: Vec<[u32; 3]> = (0_u32..)
            .zip(TETRAHEDRON)
            .map(|(i, [a, b, c])| {
                if turned >> i & 1 == 1 {
                    [a, c, b]
                } else {
                    [a, b, c]
                }
            })
            .collect();
        let (m, account) = valid(mesh(&CORNER, &triangles));
        assert!((volume(&m) - 1.0 / 6.0).abs() < 1e-15);
        assert_eq!((border_edges(&m), account.cut_edges), (0, 0));
        assert_eq!(account.flipped_triangles, turned.count_ones() as usize);
    }
}

#[test]
fn open_meshes_keep_the_sense_of_the_majority() {
    let mut band = band(24, false);
    let expected = valid(band.clone()).0;
    for t in (0..band.triangles.len()).step_by(3) {
        band.triangles[t].swap(1, 2);
    }
    let (m, account) = valid(band);
    assert_eq!(account.flipped_triangles, 16);
    let sorted = |m: &ManifoldMesh| {
        let mut all: Vec<[u32; 3]> = m
            .triangles
            .iter()
            .map(|t| {
                let k = (0..3).min_by_key(|&k| t[k]).unwrap();
                [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]
            })
            .collect();
        all.sort_unstable();
        all
    };
    assert_eq!(sorted(&m), sorted(&expected));
}

#[test]
fn moebius_strip_is_cut_across_once() {
    let (m, account) = valid(band(24, true));
    assert_eq!(account.cut_edges, 1);
    assert_eq!((euler(&m), m.components().1), (1, 1));
    // Both copies of a cut vertex have one normal, up to sign.
    for v in 0..m.positions.len() {
        for w in 0..v {
            if m.origin[v] == m.origin[w] {
                assert!((m.normals[v].dot(m.normals[w]).abs() - 1.0).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn klein_bottle_is_cut_open_and_a_torus_is_not() {
    let (m, account) = valid(torus(12, 8, false));
    assert_eq!((euler(&m), border_edges(&m), account.cut_edges), (0, 0, 0));
    let (m, account) = valid(torus(12, 8, true));
    assert!(account.cut_edges > 0);
    assert_eq!(m.components().1, 1);
    assert_eq!(border_edges(&m), 2 * account.cut_edges);
    assert_eq!(m.triangles.len(), 2 * 12 * 8 + account.added_triangles);
}

#[test]
fn bow_tie_becomes_two_disks_with_one_origin() {
    let points = [
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [-1.0, -1.0, 0.0],
    ];
    let (m, account) = valid(mesh(&points, &[[0, 1, 2], [0, 3, 4]]));
    assert_eq!(
        (m.positions.len(), account.vertex_copies, m.components().1),
        (6, 1, 2)
    );
    assert_eq!(
        (account.topology.components, account.topology.boundary_loops),
        (1, 1)
    );
    assert_eq!(m.origin[5], 0);
    assert_eq!(m.positions[5], m.positions[0]);
}

#[test]
fn fans_of_faces_on_one_edge_are_paired_or_cut() {
    for faces in 3..=8_u32 {
        let mut points = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let mut triangles = Vec::new();
        for i in 0..faces {
            let angle = f64::from(i) / f64::from(faces) * std::f64::consts::TAU;
            points.push([angle.cos(), angle.sin(), 0.5]);
            // Senses alternate, as around an edge where solids touch.
            triangles.push(if i % 2 == 0 {
                [1, 0, i + 2]
            } else {
                [0, 1, i + 2]
            });
        }
        let (m, account) = valid(mesh(&points, &triangles));
        assert_eq!(account.topology.non_manifold_edges, 1);
        assert_eq!(account.cut_edges, faces as usize % 2);
        assert_eq!(m.components().1, faces.div_ceil(2));
    }
}

#[test]
fn cubes_that_share_an_edge_or_a_face_stay_closed() {
    let mut points: Vec<[f64; 3]> = Vec::new();
    for z in 0..2 {
        for y in 0..3 {
            for x in 0..3 {
                points.push([f64::from(x), f64::from(y), f64::from(z)]);
            }
        }
    }
    let at = |dx: u32, dy: u32| move |v: u32| (v & 1) + dx + 3 * ((v >> 1 & 1) + dy) + 9 * (v >> 2);
    for (dx, dy, non_manifold) in [(1, 1, 1), (1, 0, 5)] {
        let mut triangles = cube(at(0, 0));
        triangles.extend(cube(at(dx, dy)));
        let (m, account) = valid(mesh(&points, &triangles));
        assert_eq!(account.topology.non_manifold_edges, non_manifold);
        assert_eq!((m.components().1, border_edges(&m), euler(&m)), (2, 0, 4));
        assert!((volume(&m) - 2.0).abs() < 1e-12);
        assert_eq!((account.cut_edges, m.triangles.len()), (0, 24));
    }
}

#[test]
fn two_sided_walls_lose_their_second_side() {
    let square = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let (m, account) = valid(mesh(&square, &[[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]]));
    assert_eq!((m.triangles.len(), border_edges(&m)), (2, 4));
    assert_eq!(account.lost(Reason::SecondSide).triangles, 2);
    let (m, account) = valid(mesh(&square, &[[0, 1, 2], [2, 1, 0]]));
    assert_eq!(
        (
            m.triangles.len(),
            account.lost(Reason::SecondSide).triangles
        ),
        (1, 1)
    );
    let (m, account) = valid(mesh(&square, &[[0, 1, 2], [1, 2, 0], [0, 2, 3]]));
    assert_eq!(
        (m.triangles.len(), account.lost(Reason::Duplicate).triangles),
        (2, 1)
    );
    // The same closed body twice, once inside out.
    let mut both = TETRAHEDRON.to_vec();
    both.extend(TETRAHEDRON.map(|[a, b, c]| [a, c, b]));
    let (m, account) = valid(mesh(&CORNER, &both));
    assert_eq!(
        (
            m.triangles.len(),
            border_edges(&m),
            account.lost(Reason::SecondSide).triangles
        ),
        (4, 0, 4)
    );
}

#[test]
fn fin_on_a_body_is_cut_off_and_the_body_stays_closed() {
    let mut points = CORNER.to_vec();
    points.push([0.5, 0.5, -1.0]);
    let mut triangles = TETRAHEDRON.to_vec();
    triangles.push([1, 2, 4]);
    let (m, account) = valid(mesh(&points, &triangles));
    assert_eq!(
        (account.cut_edges, m.components().1, border_edges(&m)),
        (1, 2, 3)
    );
    // A sphere and a disk.
    assert_eq!(euler(&m), 2 + 1);
}

/// Welded meshes that `prepare` would not let through are made simplicial as well.
#[test]
fn pillow_is_subdivided_to_a_simplicial_sphere() {
    let welded = WeldedMesh {
        positions: CORNER[..3].iter().map(|p| DVec3::from_array(*p)).collect(),
        colours: vec![[0; 3], [100; 3], [200; 3]],
        triangles: vec![[0, 1, 2], [0, 2, 1]],
    };
    let table = EdgeTable::new(&welded.triangles, 3);
    let mut account = Account::default();
    let m = manifold(welded, &table, &mut account);
    assert_eq!(m.check(), Ok(()));
    assert_eq!((euler(&m), border_edges(&m)), (2, 0));
    assert_eq!(
        (
            m.triangles.len(),
            account.split_edges,
            account.added_triangles
        ),
        (6, 2, 4)
    );
    assert_eq!(m.colours.len(), 5);
}

#[test]
fn pinched_edge_is_told_apart_by_halving() {
    // Two disks that cross along one interior edge: pairing connects each half of one with a half of the other, and
    // both new edges have the same ends.
    let ring: Vec<[f64; 3]> = (0..6)
        .map(|i| f64::from(i) / 6.0 * std::f64::consts::TAU)
        .map(|a| [2.0 * a.cos(), a.sin(), 0.0])
        .collect();
    let mut points = vec![[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]];
    points.extend(&ring);
    points.extend(ring.iter().map(|p| [1.5 * p[0], 0.0, p[1]]));
    let disk = |k: u32| {
        let r = |i: u32| 2 + k + i % 6;
        vec![
            [0, 1, r(1)],
            [1, 0, r(4)],
            [1, r(0), r(1)],
            [1, r(5), r(0)],
            [1, r(4), r(5)],
            [0, r(1), r(2)],
            [0, r(2), r(3)],
            [0, r(3), r(4)],
        ]
    };
    let mut triangles = disk(0);
    triangles.extend(disk(6));
    let (m, account) = valid(mesh(&points, &triangles));
    assert_eq!(account.topology.non_manifold_edges, 1);
    assert_eq!(
        (
            account.cut_edges,
            account.split_edges,
            account.added_triangles
        ),
        (0, 1, 2)
    );
    assert_eq!((border_edges(&m), m.components().1), (12, 1));
}

#[test]
fn faces_left_alone_keep_their_place() {
    // Three faces in one sense on an edge: no wedge is closed, all are cut.
    let points = [
        [0.0; 3],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [-1.0, 1.0, 0.0],
        [-1.0, -1.0, 0.0],
    ];
    let (m, account) = valid(mesh(&points, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]));
    assert_eq!(
        (account.cut_edges, m.components().1, border_edges(&m)),
        (3, 3, 9)
    );
    assert_eq!(account.vertex_copies, 4);
}
