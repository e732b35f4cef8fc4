use super::*;
use crate::parameterize::test_patches::{Random, bumpy, shattered, with_borders};
use crate::parameterize::{orientation, parameterize};
use glam::DVec2;

const MIXED: [bool; 4] = [false, true, true, false];

struct Case {
    patch: Patch,
    borders: Vec<Border>,
    map: Parametrization,
}

fn case(patch: Patch) -> Case {
    let (mut patch, borders) = with_borders(patch, MIXED);
    let map = parameterize(&mut patch, &borders);
    assert_eq!(map.flipped, 0);
    Case {
        patch,
        borders,
        map,
    }
}

/// A case whose map is the projection along z, whatever its borders say.
fn projected(patch: Patch) -> Case {
    let mut case = case(patch);
    case.map.uv = case.patch.positions.iter().map(|p| p.truncate()).collect();
    case
}

fn random_cases() -> Vec<Case> {
    let waves = |x: f64, y: f64| 0.2 * (9.0 * x).sin() + 0.1 * (14.0 * y).cos();
    let mut cases: Vec<Case> = (0..6)
        .map(|seed| case(bumpy(2 + seed * 2, 0.95, seed as u64, waves)))
        .collect();
    cases.extend((0..6).map(|seed| case(shattered(seed * 12, 0.3, seed as u64))));
    cases
}

/// Samples with noise, as quantization leaves them.
fn noisy(case: &Case, resolution: u8, noise: f64) -> Vec<DVec3> {
    let mut random = Random(u64::from(resolution));
    let mut positions = resample(&case.patch, &case.map, &case.borders, resolution).positions;
    for position in &mut positions {
        *position += noise * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
    }
    positions
}

fn source_at(case: &Case, point: DVec2) -> DVec3 {
    for corners in &case.patch.triangles {
        let [a, b, c] = corners.map(|v| case.map.uv[v as usize]);
        let weights = [
            orientation(b, c, point),
            orientation(c, a, point),
            orientation(a, b, point),
        ];
        if weights.iter().all(|&w| w >= 0.0) {
            let [p, q, r] = corners.map(|v| case.patch.positions[v as usize]);
            return (p * weights[0] + q * weights[1] + r * weights[2])
                / (weights[0] + weights[1] + weights[2]);
        }
    }
    panic!("{point} lies in no triangle");
}

fn image_triangles(resolution: u8, finest: u8, positions: &[DVec3]) -> Vec<[DVec3; 3]> {
    let stride = 1usize << (finest - resolution);
    let row = (1usize << finest) + 1;
    let at = |i: usize, j: usize| positions[(j * row + i) * stride];
    let mut triangles = Vec::new();
    for j in 0..1 << resolution {
        for i in 0..1 << resolution {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    triangles
}

fn source_triangles(patch: &Patch) -> Vec<[DVec3; 3]> {
    patch
        .triangles
        .iter()
        .map(|t| t.map(|v| patch.positions[v as usize]))
        .collect()
}

/// Largest distance from points all over `from` to `to`.
fn sampled_distance(from: &[[DVec3; 3]], to: &[[DVec3; 3]]) -> f64 {
    let mut farthest = 0.0f64;
    for [a, b, c] in from {
        for (p, q) in [(0, 0), (4, 0), (0, 4), (2, 2), (2, 0), (0, 2), (1, 1)] {
            let point = *a + (b - a) * (f64::from(p) / 4.0) + (c - a) * (f64::from(q) / 4.0);
            let nearest = to
                .iter()
                .map(|&t| point.distance(tighten::closest_point(t, point)));
            farthest = farthest.max(nearest.fold(f64::INFINITY, f64::min));
        }
    }
    farthest
}

#[test]
fn samples_equal_naive_point_location() {
    for case in random_cases() {
        let grid = resample(&case.patch, &case.map, &case.borders, 4);
        assert_eq!(
            (grid.positions.len(), grid.attributes.len()),
            (17 * 17, 17 * 17)
        );
        for (k, &position) in grid.positions.iter().enumerate() {
            let point = DVec2::new((k % 17) as f64, (k / 17) as f64) / 16.0;
            assert!(position.distance(source_at(&case, point)) < 1e-13);
        }
    }
}

#[test]
fn a_window_has_the_bits_of_the_whole_grid() {
    for case in random_cases() {
        let whole = resample(&case.patch, &case.map, &case.borders, 5);
        let sampler = Sampler::new(&case.patch, &case.map);
        for (x, y, cells) in [(0, 0, 32), (0, 16, 16), (8, 24, 8), (31, 31, 1), (5, 9, 3)] {
            let part = sampler.grid(
                &case.borders,
                Window {
                    resolution: 5,
                    x,
                    y,
                    cells,
                },
            );
            for j in 0..=cells {
                for i in 0..=cells {
                    let (at, of) = (
                        (j * (cells + 1) + i) as usize,
                        ((y + j) * 33 + x + i) as usize,
                    );
                    assert_eq!(part.positions[at], whole.positions[of]);
                    assert_eq!(part.attributes[at], whole.attributes[of]);
                }
            }
        }
    }
}

#[test]
fn both_patches_of_a_border_get_the_same_bits() {
    let left = bumpy(7, 0.8, 4, |x, y| (3.0 * x * y).sin());
    let (left, borders) = with_borders(left, [true, true, false, true]);
    for (side, runs_with) in (0..4).flat_map(|side| [(side, true), (side, false)]) {
        let mut right = Patch::default();
        right.borders[side] = (1, runs_with);
        for step in 0..=64 {
            let (position, attributes) = borders::sample(&left, &borders, 1, step, 6);
            let opposite = if runs_with { step } else { 64 - step };
            assert_eq!(
                (position, attributes),
                borders::sample(&right, &borders, side, opposite, 6)
            );
        }
    }
    let ends = [
        borders::sample(&left, &borders, 1, 0, 12).0,
        borders::sample(&left, &borders, 1, 4096, 12).0,
    ];
    assert_eq!(ends, [left.positions[7], left.positions[63]]);
}

#[test]
fn corners_and_sides_come_from_the_borders() {
    let mut case = case(bumpy(6, 0.5, 9, |x, _| x));
    for border in &mut case.borders {
        for point in &mut border.points {
            point.z += 100.0;
        }
    }
    let grid = resample(&case.patch, &case.map, &case.borders, 3);
    for (k, position) in grid.positions.iter().enumerate() {
        let on_side = k % 9 == 0 || k % 9 == 8 || k / 9 == 0 || k / 9 == 8;
        assert_eq!(position.z > 50.0, on_side);
    }
}

#[test]
fn a_resolution_of_12_is_complete() {
    let case = case(shattered(6, 0.2, 3));
    let grid = resample(&case.patch, &case.map, &case.borders, 12);
    assert_eq!(grid.positions.len(), 4097 * 4097);
    let window = Window {
        resolution: 12,
        x: 2000,
        y: 1000,
        cells: 32,
    };
    let part = resample_window(&case.patch, &case.map, &case.borders, window);
    assert_eq!(
        part.positions[33 * 32 + 32],
        grid.positions[1032 * 4097 + 2032]
    );
}

#[test]
fn an_uncertified_map_leaves_no_sample_unset() {
    let mut case = case(bumpy(6, 0.5, 9, |x, y| x - y));
    for (vertex, uv) in case.map.uv.iter_mut().enumerate() {
        if vertex % 5 == 0 && (uv.x * uv.y * (1.0 - uv.x) * (1.0 - uv.y)) > 0.0 {
            *uv = DVec2::new(0.01, 0.01);
        }
    }
    let grid = resample(&case.patch, &case.map, &case.borders, 5);
    assert!(
        grid.positions
            .iter()
            .all(|p| p.is_finite() && p.truncate().max_element() <= 1.0)
    );
    let errors = grid_errors(&case.patch, &case.map, 5, &grid.positions);
    assert!(
        errors
            .iter()
            .all(|e| e.max.is_finite() && e.mean_square.is_finite())
    );
}

#[test]
fn a_plane_has_no_error() {
    let case = case(bumpy(11, 0.7, 2, |x, y| 0.5 * x - 2.0 * y));
    let positions = resample(&case.patch, &case.map, &case.borders, 4).positions;
    for error in grid_errors(&case.patch, &case.map, 4, &positions) {
        assert!(
            error.max_plane < 1e-14 && error.mean_square < 1e-28,
            "{error:?}"
        );
        assert!(error.max < 1e-12, "{error:?}");
        assert!((error.area - (1.0f64 + 0.25 + 4.0).sqrt()).abs() < 1e-12);
    }
}

#[test]
fn the_error_of_a_spherical_cap_is_its_sagitta() {
    let radius: f64 = 20.0;
    let cap = |x: f64, y: f64| (radius * radius - (x - 0.5).powi(2) - (y - 0.5).powi(2)).sqrt();
    let case = projected(bumpy(128, 0.0, 1, cap));
    let positions = resample(&case.patch, &case.map, &case.borders, 3).positions;
    for (resolution, error) in grid_errors(&case.patch, &case.map, 3, &positions)
        .iter()
        .enumerate()
    {
        // Largest in the middle of a diagonal of length √2 h: (√2 h)² / 8R.
        let sagitta = 0.25f64.powi(i32::try_from(resolution).unwrap()) / (4.0 * radius);
        assert!(
            (error.max / sagitta - 1.0).abs() < 0.03,
            "{error:?} {sagitta}"
        );
        assert!(
            (error.max_plane / sagitta - 1.0).abs() < 0.03,
            "{error:?} {sagitta}"
        );
        // Over a right triangle with legs h the interpolation error of (x² + y²) / 2R has mean square h⁴ / 4R² · 11/90.
        let mean_square = sagitta * sagitta * 4.0 * 11.0 / 90.0;
        assert!(
            (error.mean_square / mean_square - 1.0).abs() < 0.05,
            "{} {mean_square}",
            error.mean_square
        );
    }
}

#[test]
fn the_bound_is_above_the_sampled_distance_both_ways() {
    for case in random_cases() {
        let positions = noisy(&case, 4, 0.01);
        let source = source_triangles(&case.patch);
        for (resolution, error) in (0u8..).zip(grid_errors(&case.patch, &case.map, 4, &positions)) {
            let image = image_triangles(resolution, 4, &positions);
            let there = sampled_distance(&source, &image);
            let back = sampled_distance(&image, &source);
            assert!(
                error.max >= there.max(back),
                "{resolution} {error:?} {there} {back}"
            );
            assert!(error.max >= error.max_plane);
        }
    }
}

#[test]
fn the_bound_is_not_far_above_the_distance_of_a_slid_surface() {
    // A gentle surface whose samples slid along it by half a cell.
    let case = projected(bumpy(40, 0.5, 6, |x, y| {
        0.05 * (4.0 * x).sin() * (3.0 * y).cos()
    }));
    let mut positions = resample(&case.patch, &case.map, &case.borders, 4).positions;
    for j in 1..16usize {
        for i in 1..16usize {
            let point = DVec2::new(i as f64 + 0.5, j as f64 + 0.3) / 16.0;
            positions[j * 17 + i] = source_at(&case, point);
        }
    }
    let error = grid_errors(&case.patch, &case.map, 4, &positions)[4];
    let image = image_triangles(4, 4, &positions);
    let source = source_triangles(&case.patch);
    let distance = sampled_distance(&source, &image).max(sampled_distance(&image, &source));
    assert!(
        error.max >= distance && error.max < 2.5 * distance,
        "{error:?} {distance}"
    );
    assert!(error.max < 0.25 / 32.0);
}

#[test]
fn the_parametric_error_is_above_dense_sampling() {
    for case in random_cases() {
        let positions = noisy(&case, 3, 0.05);
        let mut densest = 0.0f64;
        let mut plane = 0.0f64;
        for corners in &case.patch.triangles {
            let uv = corners.map(|v| case.map.uv[v as usize]);
            let at = corners.map(|v| case.patch.positions[v as usize]);
            let normal = tighten::unit_normal(at);
            for (p, q) in (0..=12)
                .flat_map(|p| (0..=12 - p).map(move |q| (f64::from(p) / 12.0, f64::from(q) / 12.0)))
            {
                let place = uv[0] + (uv[1] - uv[0]) * p + (uv[2] - uv[0]) * q;
                let gap = at[0] + (at[1] - at[0]) * p + (at[2] - at[0]) * q
                    - image_at(&positions, place * 8.0);
                densest = densest.max(gap.length());
                plane = plane.max(gap.dot(normal).abs());
            }
        }
        let sampler = Sampler::new(&case.patch, &case.map);
        let parametric = sampler.quick_error(Window::whole(3), &positions).max;
        assert!(
            parametric >= densest - 1e-12 && parametric < 2.0 * densest,
            "{parametric} {densest}"
        );
        let error = grid_errors(&case.patch, &case.map, 3, &positions)[3];
        assert!(error.max_plane >= plane - 1e-12 && error.max <= parametric * (1.0 + 1e-6));
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers below 81"
)]
fn image_at(positions: &[DVec3], place: DVec2) -> DVec3 {
    let (i, j) = (place.x.floor().min(7.0), place.y.floor().min(7.0));
    let (u, v) = (place.x - i, place.y - j);
    let at = |x: f64, y: f64| positions[((j + y) * 9.0 + i + x) as usize];
    let middle = if u >= v { at(1.0, 0.0) } else { at(0.0, 1.0) };
    at(0.0, 0.0) * (1.0 - u.max(v)) + middle * (u - v).abs() + at(1.0, 1.0) * u.min(v)
}

#[test]
fn the_mean_square_is_that_of_dense_sampling() {
    for case in random_cases() {
        let positions = noisy(&case, 3, 0.05);
        let (mut sum, mut area) = (0.0, 0.0);
        for corners in &case.patch.triangles {
            let uv = corners.map(|v| case.map.uv[v as usize]);
            let at = corners.map(|v| case.patch.positions[v as usize]);
            let normal = tighten::unit_normal(at);
            let part = 0.5 * (at[1] - at[0]).cross(at[2] - at[0]).length() / (60.0 * 61.0 / 2.0);
            for (p, q) in
                (0..60).flat_map(|p| (0..60 - p).map(move |q| (f64::from(p), f64::from(q))))
            {
                let (p, q) = ((p + 1.0 / 3.0) / 60.0, (q + 1.0 / 3.0) / 60.0);
                let place = uv[0] + (uv[1] - uv[0]) * p + (uv[2] - uv[0]) * q;
                let gap = at[0] + (at[1] - at[0]) * p + (at[2] - at[0]) * q
                    - image_at(&positions, place * 8.0);
                sum += part * gap.dot(normal).powi(2);
                area += part;
            }
        }
        let error = grid_errors(&case.patch, &case.map, 3, &positions)[3];
        assert!(
            (error.area / area - 1.0).abs() < 1e-9,
            "{} {area}",
            error.area
        );
        assert!(
            (error.mean_square / (sum / area) - 1.0).abs() < 0.05,
            "{} {}",
            error.mean_square,
            sum / area
        );
    }
}

#[test]
fn windows_add_up_to_the_whole() {
    for case in random_cases() {
        let positions = noisy(&case, 4, 0.02);
        let whole = grid_errors(&case.patch, &case.map, 4, &positions)[4];
        let (mut sum, mut area, mut plane, mut max) = (0.0, 0.0, 0.0f64, 0.0f64);
        for (x, y) in [(0, 0), (8, 0), (0, 8), (8, 8)] {
            let window = Window {
                resolution: 4,
                x,
                y,
                cells: 8,
            };
            let part: Vec<DVec3> = (0..81)
                .map(|k| positions[((y + k / 9) * 17 + x + k % 9) as usize])
                .collect();
            let errors = grid_errors_window(&case.patch, &case.map, window, &part);
            assert_eq!(errors.len(), 4);
            sum += errors[3].mean_square * errors[3].area;
            area += errors[3].area;
            plane = plane.max(errors[3].max_plane);
            max = max.max(errors[3].max);
        }
        assert!((area / whole.area - 1.0).abs() < 1e-9);
        assert!((sum / area - whole.mean_square).abs() < 1e-9 * whole.mean_square);
        assert!((plane - whole.max_plane).abs() < 1e-12);
        assert!(max >= whole.max * 0.9);
    }
}

#[test]
fn points_of_the_source_stand_for_its_area() {
    for case in random_cases() {
        let sampler = Sampler::new(&case.patch, &case.map);
        let area: f64 = source_triangles(&case.patch)
            .iter()
            .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
            .sum();
        for resolution in [0, 2, 5] {
            let mut sum = 0.0;
            sampler.visit_points(Window::whole(resolution), |point| sum += point.area);
            assert!(
                (sum / area - 1.0).abs() < 1e-9,
                "{resolution}: {sum} {area}"
            );
        }
        let mut sum = 0.0;
        for (x, y) in (0..4).flat_map(|y| (0..4).map(move |x| (x * 8, y * 8))) {
            let window = Window {
                resolution: 5,
                x,
                y,
                cells: 8,
            };
            sampler.visit_points(window, |point| sum += point.area);
        }
        assert!((sum / area - 1.0).abs() < 1e-6, "{sum} {area}");
    }
}

#[test]
fn estimates_are_near_the_exact_errors() {
    for case in random_cases() {
        let positions = noisy(&case, 4, 0.05);
        let sampler = Sampler::new(&case.patch, &case.map);
        let estimates = sampler.estimates(Window::whole(4), &positions, 5);
        let exact = grid_errors(&case.patch, &case.map, 4, &positions);
        assert_eq!(estimates.len(), 5);
        for (estimate, exact) in estimates.iter().zip(&exact) {
            let squares = exact.mean_square * exact.area;
            assert!((estimate.area / exact.area - 1.0).abs() < 1e-9);
            assert!(estimate.worst <= exact.max_plane * (1.0 + 1e-9));
            assert!(
                (estimate.squares / squares - 1.0).abs() < 0.35,
                "{estimate:?} {exact:?}"
            );
        }
    }
}
