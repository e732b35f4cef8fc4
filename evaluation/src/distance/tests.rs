//! The tree against brute force, and distances against closed forms.

use super::*;

/// Numbers in [0, 1) for tests.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }
}

/// Distance to the nearest of all triangles: what the tree must find as well.
fn brute_force(positions: &[DVec3], triangles: &[[u32; 3]], point: DVec3) -> f64 {
    let mesh = Mesh {
        positions,
        triangles,
    };
    (0..triangles.len())
        .map(|triangle| closest_point(mesh.corners(triangle), point).distance_squared(point))
        .fold(f64::INFINITY, f64::min)
}

fn soup(count: u32, size: f64, noise: &mut Noise) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..count {
        let centre = noise.vector();
        positions.extend((0..3).map(|_| centre + size * noise.vector()));
    }
    (
        positions,
        (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    )
}

fn octahedron_sphere(subdivisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut corners = Vec::new();
    for signs in 0..8 {
        let sign = |bit: u32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let (x, y, z) = (DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2));
        let outwards = sign(0) * sign(1) * sign(2) > 0.0;
        corners.push(if outwards { [x, y, z] } else { [y, x, z] });
    }
    for _ in 0..subdivisions {
        corners = corners
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize_or_zero);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let positions = corners.concat();
    let triangles = (0..u32::try_from(corners.len()).unwrap())
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    (positions, triangles)
}

fn plane(cells: u32, height: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let side = cells + 1;
    let at = |i: u32| f64::from(i) / f64::from(cells);
    let positions = (0..side * side)
        .map(|k| DVec3::new(at(k % side), at(k / side), height))
        .collect();
    let triangles = (0..cells * cells)
        .flat_map(|k| {
            let a = k / cells * side + k % cells;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        })
        .collect();
    (positions, triangles)
}

#[test]
fn tree_finds_what_brute_force_finds() {
    let mut noise = Noise(1);
    for (count, size, scale, offset) in [
        (1, 0.5, 1.0, 0.0),
        (5, 0.5, 1.0, 0.0),
        (2000, 0.05, 1.0, 0.0),
        (600, 2.0, 1e-20, 0.0),
        (600, 0.1, 1.0, 1e7),
    ] {
        let (mut positions, triangles) = soup(count, size, &mut noise);
        for p in &mut positions {
            *p = *p * scale + offset;
        }
        let tree = Bvh::new(&positions, &triangles).unwrap();
        for _ in 0..200 {
            let point = noise.vector() * (1.5 * scale) + offset;
            let closest = tree.closest(point, f64::INFINITY).unwrap();
            let expected = brute_force(&positions, &triangles, point);
            assert_eq!(closest.distance2.to_bits(), expected.to_bits());
            let mut hint = u32::MAX;
            assert!(tree.is_within(point, expected, &mut hint));
            assert!(tree.is_within(point, expected, &mut hint));
            assert!(!tree.is_within(point, expected.next_down(), &mut hint));
            let within = |max: f64| -> Vec<u32> {
                tree.within(point, max).iter().map(|f| f.triangle).collect()
            };
            let numbered = (0u32..).zip(&triangles);
            let near = numbered.filter(|(_, t)| {
                let corners = t.map(|v| positions[v as usize]);
                closest_point(corners, point).distance_squared(point) <= 1.5 * expected
            });
            assert_eq!(
                within(1.5 * expected),
                near.map(|(n, _)| n).collect::<Vec<_>>()
            );
            assert!(within(expected.next_down()).is_empty());
            let mesh = Mesh {
                positions: &positions,
                triangles: &triangles,
            };
            assert_eq!(
                closest.point,
                closest_point(mesh.corners(closest.triangle as usize), point)
            );
        }
    }
}

#[test]
fn tree_over_degenerate_triangles_finds_what_brute_force_finds() {
    let mut noise = Noise(2);
    let mut positions: Vec<DVec3> = (0..300).map(|i| DVec3::X * f64::from(i % 7)).collect();
    positions.extend([DVec3::Y; 300]);
    let triangles: Vec<[u32; 3]> = (0..200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let tree = Bvh::new(&positions, &triangles).unwrap();
    for _ in 0..200 {
        let point = noise.vector() * 5.0;
        let closest = tree.closest(point, f64::INFINITY).unwrap();
        assert_eq!(
            closest.distance2.to_bits(),
            brute_force(&positions, &triangles, point).to_bits()
        );
    }
}

#[test]
fn large_tree_is_the_same_as_brute_force() {
    let (positions, triangles) = octahedron_sphere(6);
    assert!(triangles.len() > 30_000);
    let tree = Bvh::new(&positions, &triangles).unwrap();
    let mut noise = Noise(3);
    for _ in 0..20 {
        let point = noise.vector() * 1.2;
        let closest = tree.closest(point, f64::INFINITY).unwrap();
        assert_eq!(
            closest.distance2.to_bits(),
            brute_force(&positions, &triangles, point).to_bits()
        );
    }
}

#[test]
fn bound_is_inclusive_and_cuts_off_beyond() {
    let tree = Bvh::new(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]).unwrap();
    let point = DVec3::new(0.25, 0.25, 2.0);
    assert!(tree.closest(point, 4.0).is_some());
    assert_eq!(tree.closest(point, 3.999), None);
    assert!(tree.closest(DVec3::ZERO, 0.0).is_some());
}

#[test]
fn trees_that_are_kept_measure_alike() {
    let [(a, b), (c, d)] = [octahedron_sphere(3), octahedron_sphere(4)];
    let of = |positions, triangles| Mesh {
        positions,
        triangles,
    };
    let (first, second) = (of(&a, &b), of(&c, &d));
    let [one, other] = [first, second].map(|mesh| Indexed::new(mesh).unwrap());
    let expected = measure(first, second, 5000).unwrap();
    assert_eq!(one.measure(&other, 5000), expected);
    let points = samples(second, 5000).unwrap();
    assert_eq!(points.len(), 5000);
    let found = one.from_points(&points);
    assert_eq!(found.rms.to_bits(), expected.backward.rms.to_bits());
    let outside = of(&a, &[[0, 1, u32::MAX]]);
    assert!(samples(outside, 10).is_err());
    assert_eq!(Indexed::new(of(&a, &[])).unwrap_err(), MeshError::Empty);
}

#[test]
fn segments_hit_what_lies_between_their_ends() {
    let (positions, triangles) = octahedron_sphere(3);
    let tree = Bvh::new(&positions, &triangles).unwrap();
    let mut noise = Noise(4);
    for _ in 0..200 {
        let outside = noise.vector().normalize_or_zero() * 2.0;
        assert!(tree.any_hit(outside, DVec3::new(0.01, 0.02, 0.03)));
        assert!(!tree.any_hit(outside, outside * 0.6));
        assert!(!tree.any_hit(outside * 0.1, -outside * 0.1));
    }
}

#[test]
fn unusable_meshes_are_refused() {
    let positions = [DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)];
    let error = Bvh::new(&positions, &[[0, 1, 3]]).unwrap_err();
    assert_eq!(
        error,
        MeshError::IndexOutOfRange {
            triangle: 0,
            vertex: 3,
            vertices: 3
        }
    );
    let error = Bvh::new(&positions, &[[0, 1, 2]]).unwrap_err();
    assert_eq!(
        error,
        MeshError::NotFinite {
            triangle: 0,
            vertex: 2
        }
    );
    let empty = Bvh::new(&[], &[]).unwrap();
    assert!(empty.is_empty() && empty.closest(DVec3::ZERO, f64::INFINITY).is_none());
    assert!(!empty.any_hit(DVec3::ZERO, DVec3::X));
    let none = Mesh {
        positions: &[],
        triangles: &[],
    };
    assert_eq!(measure(none, none, 10), Err(MeshError::Empty));
}

#[test]
fn shifted_plane_is_one_shift_away() {
    let (a, triangles) = plane(10, 0.0);
    let (b, finer) = plane(17, 0.125);
    let first = Mesh {
        positions: &a,
        triangles: &triangles,
    };
    let second = Mesh {
        positions: &b,
        triangles: &finer,
    };
    let found = measure(first, second, 10_000).unwrap();
    assert_eq!(rms(first, second, 10_000), Ok(found.rms()));
    for way in [found.forward, found.backward] {
        assert!((way.max - 0.125).abs() < 1e-12 && (way.rms - 0.125).abs() < 1e-12);
    }
    assert!(found.normal_deviation_deg.mean < 1e-6);
    assert!(found.normal_deviation_deg.p95 <= 0.01);
}

#[test]
fn plane_that_is_missing_a_half_shows_in_one_direction_only() {
    let (positions, triangles) = plane(16, 0.0);
    let half: Vec<_> = triangles
        .iter()
        .copied()
        .filter(|t| t.iter().all(|&v| positions[v as usize].x <= 0.5))
        .collect();
    let whole = Mesh {
        positions: &positions,
        triangles: &triangles,
    };
    let part = Mesh {
        positions: &positions,
        triangles: &half,
    };
    let found = measure(part, whole, 40_000).unwrap();
    assert!(found.forward.max < 1e-12);
    assert!((found.backward.max - 0.5).abs() < 1e-12);
    // Distance x over half of the area: the mean square is the integral of x² from 0 to ½.
    assert!((found.backward.rms - (1.0_f64 / 24.0).sqrt()).abs() < 1e-3);
    assert!((found.hausdorff() - 0.5).abs() < 1e-12);
}

#[test]
fn sphere_and_its_approximation_part_by_the_sagitta() {
    let (coarse, coarse_triangles) = octahedron_sphere(2);
    let (fine, fine_triangles) = octahedron_sphere(6);
    let coarse_mesh = Mesh {
        positions: &coarse,
        triangles: &coarse_triangles,
    };
    let fine_mesh = Mesh {
        positions: &fine,
        triangles: &fine_triangles,
    };
    let found = measure(fine_mesh, coarse_mesh, 100_000).unwrap();
    // The largest triangles are deepest at their circumcentres.
    let sagitta = (0..coarse_triangles.len())
        .map(|t| {
            1.0 - normal(coarse_mesh.corners(t))
                .unwrap()
                .dot(coarse_mesh.corners(t)[0])
        })
        .fold(0.0, f64::max);
    // The finer mesh has a sagitta too: four subdivisions more make it 256 times less.
    let tolerance = 1.5 * sagitta / 256.0;
    assert!((found.forward.max - sagitta).abs() < tolerance);
    assert!(found.forward.rms < found.forward.max && found.forward.rms > 0.3 * sagitta);
}

#[test]
fn opposite_faces_deviate_by_a_half_turn() {
    let (positions, triangles) = plane(4, 0.0);
    let flipped: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let found = measure(
        Mesh {
            positions: &positions,
            triangles: &triangles,
        },
        Mesh {
            positions: &positions,
            triangles: &flipped,
        },
        1000,
    )
    .unwrap();
    assert!((found.normal_deviation_deg.mean - 180.0).abs() < 1e-9);
    assert!((found.normal_deviation_deg.p95 - 180.0).abs() < 1e-9);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(5);
    let (a, a_triangles) = soup(3000, 0.05, &mut noise);
    let (b, b_triangles) = soup(2000, 0.08, &mut noise);
    let first = Mesh {
        positions: &a,
        triangles: &a_triangles,
    };
    let second = Mesh {
        positions: &b,
        triangles: &b_triangles,
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| measure(first, second, 20_000).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn stray_vertices_are_no_surface() {
    let (mut positions, triangles) = plane(4, 0.0);
    let clean = positions.clone();
    positions.push(DVec3::splat(100.0));
    let found = measure(
        Mesh {
            positions: &positions,
            triangles: &triangles,
        },
        Mesh {
            positions: &clean,
            triangles: &triangles,
        },
        100,
    )
    .unwrap();
    assert!(found.hausdorff() < 1e-12);
}

#[test]
fn points_above_a_triangle_are_as_far_as_they_are_high() {
    let positions = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mesh = Mesh {
        positions: &positions,
        triangles: &[[0, 1, 2]],
    };
    // More than a chunk of them; the last lies beyond a corner.
    let mut points = vec![DVec3::new(0.25, 0.25, 3.0); 5000];
    points.push(DVec3::new(-3.0, 0.0, 4.0));
    let found = from_points(&points, mesh).unwrap();
    assert!((found.max - 5.0).abs() < 1e-12, "{found:?}");
    let rms = ((5000.0 * 9.0 + 25.0) / 5001.0_f64).sqrt();
    assert!((found.rms - rms).abs() < 1e-12, "{found:?}");
    let none = from_points(&[], mesh).unwrap();
    assert_eq!((none.max.to_bits(), none.rms.to_bits()), (0, 0));
    let empty = Mesh {
        triangles: &[],
        ..mesh
    };
    assert!(matches!(from_points(&points, empty), Err(MeshError::Empty)));
}

#[test]
fn interval_holds_the_rms_and_narrows_with_samples() {
    let mut noise = Noise(11);
    let (positions, triangles) = octahedron_sphere(4);
    let bumpy: Vec<DVec3> = positions
        .iter()
        .map(|p| *p * (1.0 + 0.02 * noise.next()))
        .collect();
    let smooth = Mesh {
        positions: &positions,
        triangles: &triangles,
    };
    let bumpy = Mesh {
        positions: &bumpy,
        triangles: &triangles,
    };
    let truth = measure(bumpy, smooth, 400_000).unwrap().forward.rms;
    let mut width = f64::INFINITY;
    for samples in [200, 5_000, 100_000] {
        let way = measure(bumpy, smooth, samples).unwrap().forward;
        let [low, high] = way.rms_interval;
        assert!(low <= way.rms && way.rms <= high);
        assert!(low <= truth && truth <= high, "{samples} samples");
        assert!(high - low < 0.5 * width, "{samples} samples");
        width = high - low;
    }
    let one = measure(bumpy, smooth, 1).unwrap().forward;
    assert!(one.rms_interval[0].abs() < 1e-12 && one.rms_interval[1] >= one.rms);
}

#[test]
fn twice_the_samples_change_the_rms_by_less_than_two_percent() {
    let (positions, triangles) = octahedron_sphere(3);
    let (fine, fine_triangles) = octahedron_sphere(6);
    let coarse = Mesh {
        positions: &positions,
        triangles: &triangles,
    };
    let sphere = Mesh {
        positions: &fine,
        triangles: &fine_triangles,
    };
    let [once, twice] =
        [100_000, 200_000].map(|samples| measure(coarse, sphere, samples).unwrap().rms());
    assert!((once / twice - 1.0).abs() < 0.02, "{once} and {twice}");
}
