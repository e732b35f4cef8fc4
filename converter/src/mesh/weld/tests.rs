use super::*;
use crate::mesh::prepare;

fn soup(triangles: &[[DVec3; 3]]) -> ImportedMesh {
    let positions: Vec<DVec3> = triangles.iter().flatten().copied().collect();
    let triangles = (0..id(triangles.len()))
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    ImportedMesh {
        positions,
        colours: Vec::new(),
        triangles,
        ..ImportedMesh::default()
    }
}

/// A grid of squares, each two triangles with corners of their own, moved by `noise(corner)`.
fn grid(cells: u32, mut noise: impl FnMut(u32) -> DVec3) -> ImportedMesh {
    let mut corners = 0;
    let mut at = |x: u32, y: u32| {
        corners += 1;
        DVec3::new(f64::from(x), f64::from(y), 0.0) + noise(corners)
    };
    let mut triangles = Vec::new();
    for y in 0..cells {
        for x in 0..cells {
            triangles.push([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
            triangles.push([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
    }
    soup(&triangles)
}

/// A repeatable number in −1..=1.
fn jitter(seed: u32) -> f64 {
    f64::from(seed.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 23) - 1.0
}

#[test]
fn minus_zero_is_zero() {
    let mesh = soup(&[
        [DVec3::ZERO, DVec3::X, DVec3::Y],
        [-DVec3::ZERO, DVec3::Y, DVec3::NEG_X],
    ]);
    let welded = exact(mesh.clone(), &mut Account::new(&mesh));
    assert_eq!(welded.positions.len(), 4);
    assert_eq!(welded.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn weld_agrees_with_comparing_all_pairs() {
    let points: Vec<DVec3> = (0..600)
        .map(|i| {
            DVec3::new(
                f64::from(i * 7 % 5),
                f64::from(i * 11 % 4),
                f64::from(i % 3) - 1.0,
            ) * 1e-20
        })
        .collect();
    let naive: Vec<u32> = points
        .iter()
        .map(|p| id(points.iter().position(|q| q == p).unwrap()))
        .collect();
    assert_eq!(first_equal(&points), naive);
}

#[test]
fn what_is_not_finite_or_coincides_is_left_out_with_its_reason() {
    let mesh = soup(&[
        [DVec3::ZERO, DVec3::X, DVec3::Y],
        [DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)],
        [DVec3::INFINITY, DVec3::X, DVec3::Y],
        [DVec3::ZERO, DVec3::X, DVec3::X],
    ]);
    let (manifold, account) = prepare(mesh).unwrap();
    assert_eq!(manifold.triangles.len(), 1);
    assert_eq!(account.lost(Reason::NonFinite).triangles, 2);
    assert_eq!(account.lost(Reason::Degenerate).triangles, 1);
    assert_eq!(account.check(), Ok(()));
    let nothing = soup(&[[DVec3::ZERO; 3], [DVec3::NAN; 3]]);
    let error = prepare(nothing)
        .unwrap_err()
        .in_file(std::path::Path::new("a.stl"))
        .to_string();
    assert!(
        error.contains("a.stl") && error.contains("1 have a corner that is not finite"),
        "{error}"
    );
}

#[test]
fn colours_of_welded_vertices_are_averaged() {
    let mut mesh = soup(&[
        [DVec3::ZERO, DVec3::X, DVec3::Y],
        [DVec3::ZERO, DVec3::Y, DVec3::NEG_X],
    ]);
    mesh.colours = vec![[0, 10, 255], [9; 3], [8; 3], [1, 20, 255], [8; 3], [7; 3]];
    let welded = exact(mesh.clone(), &mut Account::new(&mesh));
    assert_eq!(welded.colours, [[1, 15, 255], [9; 3], [8; 3], [7; 3]]);
}

#[test]
fn failed_weld_is_repaired_within_a_tolerance() {
    let mesh = grid(20, |i| {
        DVec3::new(jitter(i), jitter(i + 7), jitter(i + 99)) * 2e-5
    });
    let (manifold, account) = prepare(mesh).unwrap();
    assert!(account.weld_tolerance.is_some());
    assert_eq!(manifold.positions.len(), 21 * 21);
    assert_eq!(account.topology.boundary_loops, 1);
    assert_eq!(account.check(), Ok(()));
    assert_eq!(manifold.check(), Ok(()));
}

#[test]
fn genuine_soup_stays_as_it_is() {
    let mesh = grid(20, |i| {
        DVec3::new(jitter(i), jitter(i + 7), jitter(i + 99)) * 0.2
    });
    let n = mesh.triangles.len();
    let (manifold, account) = prepare(mesh).unwrap();
    assert_eq!(account.weld_tolerance, None);
    assert_eq!(manifold.components().1 as usize, n);
    let clean = prepare(grid(20, |_| DVec3::ZERO)).unwrap().1;
    assert_eq!(
        (clean.weld_tolerance, clean.topology.boundary_loops),
        (None, 1)
    );
}

#[test]
fn tolerance_weld_finds_every_close_pair() {
    let points: Vec<DVec3> = (0..400)
        .map(|i| DVec3::new(jitter(i), jitter(i + 1000), jitter(i + 2000)) * 4.0)
        .collect();
    let tolerance = 0.5;
    let fast = first_within(&points, tolerance);
    let mut sets = UnionFind::new(points.len());
    for i in 0..id(points.len()) {
        for j in 0..i {
            if points[i as usize].distance(points[j as usize]) <= tolerance {
                sets.union(i, j);
            }
        }
    }
    let naive: Vec<u32> = (0..id(points.len())).map(|i| sets.find(i)).collect();
    assert_eq!(fast, naive);
}

/// Found by fuzzing: slivers of triangles whose width is about the tolerance.
#[test]
fn narrow_triangles_are_no_failed_weld() {
    let positions = [
        (0.0, 0.0, 1.0),
        (3e5, 6.0, 1.0),
        (1.0, 0.0, 11.0),
        (1.0, 0.0, 0.0),
    ];
    let positions = positions.map(|(x, y, z)| DVec3::new(x, y, z)).to_vec();
    let mesh = ImportedMesh {
        positions,
        triangles: vec![[2, 3, 1], [1, 2, 0], [0, 2, 1]],
        ..ImportedMesh::default()
    };
    let (_, account) = prepare(mesh).unwrap();
    assert_eq!(account.check(), Ok(()));
    assert_eq!(account.weld_tolerance, None);
}

/// Found by fuzzing: vertices on edges cut triangles to pieces, more of which are lost than triangles came in.
#[test]
fn pieces_of_triangles_are_accounted_for() {
    let flat = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    // The same long triangle twice, one of them with its edge cut by small ones, and again from behind.
    let mut mesh = ImportedMesh {
        positions: vec![flat(0.0, 0.0), flat(8.0, 0.0), flat(4.0, 8.0)],
        triangles: vec![[0, 1, 2], [0, 1, 2], [1, 0, 2]],
        ..ImportedMesh::default()
    };
    for i in 0..8 {
        let first = id(mesh.positions.len());
        let at = f64::from(i);
        mesh.positions
            .extend([flat(at, 0.0), flat(at + 1.0, 0.0), flat(at + 0.5, -1.0)]);
        mesh.triangles.push([first + 1, first, first + 2]);
    }
    let (manifold, account) = prepare(mesh).unwrap();
    assert_eq!(manifold.check(), Ok(()));
    assert_eq!(account.check(), Ok(()));
    assert_eq!(account.kept.triangles, manifold.triangles.len());
}
