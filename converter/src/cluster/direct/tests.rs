use super::*;

/// A sheet of `cells`² cells over the unit square, as high as `height` says.
pub(in crate::cluster) fn sheet(
    cells: u32,
    height: impl Fn(f64, f64) -> f64,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let side = cells + 1;
    let at = |k: u32| f64::from(k) / f64::from(cells);
    let place = |k: u32| (at(k % side), at(k / side));
    let positions = (0..side * side).map(place);
    let positions = positions.map(|(x, y)| DVec3::new(x, y, height(x, y)));
    let corners = |k: u32| {
        let a = k / cells * side + k % cells;
        [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
    };
    (
        positions.collect(),
        (0..cells * cells).flat_map(corners).collect(),
    )
}

pub(in crate::cluster) fn bumps(x: f64, y: f64) -> f64 {
    0.02 * (9.0 * x).sin() * (7.0 * y).cos()
}

/// 231 places on a triangle, in rows of 1, 2, 3...
pub(in crate::cluster) fn places([a, b, c]: [DVec3; 3]) -> impl Iterator<Item = DVec3> {
    let rows = (0..21_u32).flat_map(|row| (0..=row).map(move |k| [row, k]));
    rows.map(move |place| {
        let [v, w] = place.map(|n| f64::from(n) / 20.0);
        a + v * (b - a) + w * (c - b)
    })
}

/// A surface and a source.
fn with_sheets<T>(
    sheets: &[(Vec<DVec3>, Vec<[u32; 3]>); 2],
    run: impl FnOnce(&Indexed<'_>, &Indexed<'_>) -> T,
) -> T {
    let [surface, source] = sheets.each_ref().map(|(positions, triangles)| {
        Indexed::new(Mesh {
            positions,
            triangles,
        })
        .unwrap()
    });
    run(&surface, &source)
}

/// The surface as one leaf, of which no more is known than `bound`.
fn one_leaf(surface: &Indexed<'_>, bound: f64) -> [Leaf; 1] {
    let triangles = surface.mesh.triangles.len();
    [Leaf { triangles, bound }]
}

/// A coarse sheet and a fine one with a spike, in leaves of 50 triangles, and the largest distance found.
fn with_both<T>(run: impl FnOnce(&Indexed<'_>, &Indexed<'_>, Vec<Leaf>, f64) -> T) -> T {
    let spike = |x: f64, y: f64| {
        let from = (x - 0.31).hypot(y - 0.72);
        bumps(x, y) + (0.01 - from).max(0.0)
    };
    let leaf = Leaf {
        triangles: 50,
        bound: 1.0,
    };
    with_sheets(&[sheet(20, bumps), sheet(300, spike)], |surface, source| {
        let found = surface.measure(source, 100_000).hausdorff();
        run(surface, source, vec![leaf; 16], found)
    })
}

#[test]
fn bounds_hold_everywhere_and_are_near_the_truth() {
    with_both(|surface, source, leaves, found| {
        // Less than what is there, so that longer distances have to be tried.
        for found in [found, 0.2 * found] {
            let bounds = bounds(surface, source, &leaves, found);
            let most = bounds.iter().copied().fold(0.0, f64::max);
            let distances = surface.measure(source, 2_000_000);
            assert!(distances.hausdorff() <= most);
            assert!(most <= 2.1 * distances.hausdorff());
            // Triangle by triangle, from many places.
            assert_eq!(bounds.len(), surface.mesh.triangles.len());
            for (t, bound) in bounds.iter().enumerate() {
                for point in places(surface.mesh.corners(t)) {
                    let closest = source.tree.closest(point, f64::INFINITY).unwrap();
                    assert!(closest.distance2.sqrt() <= *bound);
                }
            }
            assert!(bounds.iter().any(|bound| *bound < 0.9 * most) || found > most / 2.2);
            if found > 0.5 * distances.hausdorff() {
                // One spike is no reason to call all triangles as bad.
                let good = bounds.iter().filter(|bound| **bound <= 1.01 * found);
                assert!(good.count() >= bounds.len() / 2);
            }
        }
    });
}

#[test]
fn one_bad_place_of_what_is_hardly_changed_is_no_reason_to_know_little_of_the_rest() {
    let rough = |x: f64, y: f64| 1e-4 * (31.0 * x + 57.0 * y).sin();
    let spike = |x: f64, y: f64| 0.05 * f64::from((x - 0.5).hypot(y - 0.5) < 0.02);
    let sheets = [
        sheet(24, |x, y| bumps(x, y) + rough(x, y)),
        sheet(24, |x, y| bumps(x, y) + spike(x, y)),
    ];
    with_sheets(&sheets, |surface, source| {
        let found = surface.measure(source, 100_000).hausdorff();
        assert!(found > 0.02, "{found}");
        let bounds = bounds(surface, source, &one_leaf(surface, 1.0), found);
        let good = bounds.iter().filter(|&&bound| bound < 2e-4).count();
        assert!(good > bounds.len() * 9 / 10, "{good} of {}", bounds.len());
        assert!(bounds.iter().all(|&bound| bound <= 2.1 * found));
        for (t, bound) in bounds.iter().enumerate() {
            for point in places(surface.mesh.corners(t)) {
                let closest = source.tree.closest(point, f64::INFINITY).unwrap();
                assert!(closest.distance2.sqrt() <= *bound);
            }
        }
        // And the source's, which lie within its bound of a triangle.
        for t in 0..source.mesh.triangles.len() {
            for point in places(source.mesh.corners(t)) {
                let is_near = bounds.iter().enumerate().any(|(own, &bound)| {
                    let nearest = closest_point(surface.mesh.corners(own), point);
                    nearest.distance(point) <= bound
                });
                assert!(is_near, "{t}");
            }
        }
    });
}

#[test]
fn what_is_mostly_unchanged_to_the_last_bit_is_no_endless_work() {
    let spike = |x: f64, y: f64| f64::from((x - 0.5).hypot(y - 0.5) < 0.02);
    let sheets = [
        sheet(24, bumps),
        sheet(24, |x, y| bumps(x, y) + spike(x, y)),
    ];
    with_sheets(&sheets, |surface, source| {
        let bounds = bounds(surface, source, &one_leaf(surface, 2.0), 1.0);
        let good = bounds.iter().filter(|&&bound| bound < 0.02).count();
        assert!(good > bounds.len() / 2 && good < bounds.len(), "{good}");
    });
}

#[test]
fn what_is_known_is_never_made_worse_and_nothing_found_changes_nothing() {
    with_both(|surface, source, mut leaves, found| {
        for leaf in &mut leaves {
            leaf.bound = found;
        }
        let known = bounds(surface, source, &leaves, found);
        assert!(known.iter().all(|bound| *bound <= found * HAIR));
        let none = bounds(surface, source, &leaves, 0.0);
        assert!(none.iter().all(|bound| bound.to_bits() == found.to_bits()));
    });
}

#[test]
fn threads_do_not_change_them() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            with_both(|surface, source, leaves, found| {
                bounds(surface, source, &leaves, 0.2 * found)
            })
        })
    };
    assert_eq!(run(1), run(3));
}
