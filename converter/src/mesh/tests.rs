use super::*;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// Random triangles on few vertices have every defect: many faces on an edge, duplicates, folds, pinches, slits.
    #[test]
    fn any_triangles_become_a_valid_manifold(
        points in proptest::collection::vec((0..4_i8, 0..4_i8, 0..4_i8), 4..14),
        picks in proptest::collection::vec((0..14_usize, 0..14_usize, 0..14_usize), 1..60),
        coloured in any::<bool>(),
    ) {
        let n = points.len();
        let positions: Vec<DVec3> =
            points.iter().map(|&(x, y, z)| DVec3::new(x.into(), y.into(), z.into())).collect();
        let corner = |i: usize| u32::try_from(i % n).unwrap();
        let triangles: Vec<[u32; 3]> = picks.iter().map(|&(a, b, c)| [corner(a), corner(b), corner(c)]).collect();
        let colours = if coloured { vec![[7; 3]; n] } else { Vec::new() };
        let imported = ImportedMesh { positions, colours, triangles, ..ImportedMesh::default() };
        match prepare(imported.clone()) {
            Ok((mesh, account)) => {
                prop_assert_eq!(mesh.check(), Ok(()));
                prop_assert_eq!(account.check(), Ok(()));
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                let (again, _) = pool.install(|| prepare(imported)).unwrap();
                prop_assert_eq!(again.triangles, mesh.triangles);
                prop_assert_eq!(again.twins, mesh.twins);
                prop_assert_eq!(again.positions, mesh.positions);
            }
            Err(ImportError::NoSurface { triangles, degenerate, .. }) => prop_assert_eq!(triangles, degenerate),
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}

#[test]
fn boundary_loops_are_simple() {
    // A fan whose border comes back to its centre: the centre is split, so no loop visits a vertex twice.
    let positions = (0..7)
        .map(|i| DVec3::new(f64::from(i), f64::from(i * i % 5), 0.0))
        .collect();
    let imported = ImportedMesh {
        positions,
        colours: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 3, 4], [0, 5, 6], [0, 2, 3]],
        ..ImportedMesh::default()
    };
    let (mesh, _) = prepare(imported).unwrap();
    let mut borders = vec![0; mesh.positions.len()];
    for (h, _) in (0..).zip(&mesh.twins).filter(|(_, t)| **t == NONE) {
        borders[adjacency::start(&mesh.triangles, h) as usize] += 1;
    }
    assert!(borders.iter().all(|&n| n <= 1), "{borders:?}");
}

#[test]
fn normals_of_a_cube_do_not_depend_on_diagonals_or_units() {
    let corner = |k: u32| {
        let side = |bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        DVec3::new(side(0), side(1), side(2))
    };
    let faces: [[u32; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    for diagonals in 0..64_u32 {
        let mut triangles = Vec::new();
        for (k, [a, b, c, d]) in (0..).zip(faces) {
            triangles.extend(if diagonals >> k & 1 == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
        for scale in [1e-20, 1.0, 1e20] {
            let (mesh, account) = prepare(ImportedMesh {
                positions: (0..8).map(|k| corner(k) * scale).collect(),
                triangles: triangles.clone(),
                ..ImportedMesh::default()
            })
            .unwrap();
            assert_eq!((mesh.check(), account.check()), (Ok(()), Ok(())));
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                let outward = (*p / scale).normalize_or_zero();
                assert!(n.distance(outward) < 1e-6, "{diagonals}: {p} {n}");
            }
        }
    }
}

#[test]
fn a_large_face_stays_flat_beside_small_ones() {
    // A square of side 10, and along one of its sides a strip of small triangles that goes down.
    let mut positions = vec![DVec3::new(0.0, 10.0, 0.0), DVec3::new(10.0, 10.0, 0.0)];
    positions.extend([0.0, 10.0].map(|x| DVec3::new(x, 0.0, 0.0)));
    positions.extend([0.0, 10.0].map(|x| DVec3::new(x, 0.0, -0.5)));
    let triangles = vec![[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]];
    let (mesh, _) = prepare(ImportedMesh {
        positions,
        triangles,
        ..ImportedMesh::default()
    })
    .unwrap();
    for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
        if p.z == 0.0 {
            assert!(n.z > 0.99, "{p} {n}");
        }
    }
}
