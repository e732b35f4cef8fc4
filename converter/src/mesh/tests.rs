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
fn normals_of_a_sphere_point_from_its_centre() {
    let (mut positions, mut triangles) = (vec![DVec3::Z, DVec3::NEG_Z], Vec::new());
    let (rings, columns) = (9_u32, 16_u32);
    for r in 0..rings {
        let polar = f64::from(r + 1) / f64::from(rings + 1) * std::f64::consts::PI;
        for c in 0..columns {
            let a = f64::from(c * c) / f64::from(columns * columns) * std::f64::consts::TAU;
            positions.push(DVec3::new(
                polar.sin() * a.cos(),
                polar.sin() * a.sin(),
                polar.cos(),
            ));
        }
    }
    let at = |r: u32, c: u32| 2 + r * columns + c % columns;
    for c in 0..columns {
        triangles.push([0, at(0, c), at(0, c + 1)]);
        triangles.push([1, at(rings - 1, c + 1), at(rings - 1, c)]);
        for r in 0..rings - 1 {
            triangles.extend([
                [at(r, c), at(r + 1, c), at(r + 1, c + 1)],
                [at(r, c), at(r + 1, c + 1), at(r, c + 1)],
            ]);
        }
    }
    for scale in [1e-20, 1.0, 1e20] {
        let positions = positions.iter().map(|p| *p * scale).collect();
        let (mesh, account) = prepare(ImportedMesh {
            positions,
            colours: Vec::new(),
            triangles: triangles.clone(),
            ..ImportedMesh::default()
        })
        .unwrap();
        assert_eq!((mesh.check(), account.check()), (Ok(()), Ok(())));
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(n.distance(*p / scale) < 1e-6, "{p} {n}");
        }
    }
}
