use super::test_patches::{bumpy, shattered, with_borders};
use super::*;
use crate::atlas::patch::Attributes;
use glam::DVec3;

const MIXED: [bool; 4] = [true, false, false, true];

fn waves(x: f64, y: f64) -> f64 {
    0.3 * (7.0 * x).sin() * (5.0 * y).cos()
}

fn assert_certified(patch: Patch) -> Parametrization {
    let (mut patch, borders) = with_borders(patch, MIXED);
    let map = parameterize(&mut patch, &borders);
    assert_eq!(map.flipped, 0);
    assert_eq!(map.uv.len(), patch.positions.len());
    assert!(
        map.uv
            .iter()
            .all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0)
    );
    let area: f64 = patch
        .triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|v| map.uv[v as usize]);
            0.5 * (b - a).perp_dot(c - a)
        })
        .sum();
    assert!((area - 1.0).abs() < 1e-12, "{area}");
    map
}

#[test]
fn a_flat_square_lies_on_itself() {
    let patch = bumpy(9, 0.4, 1, |_, _| 0.0);
    let positions = patch.positions.clone();
    let map = assert_certified(patch);
    for (uv, position) in map.uv.iter().zip(&positions) {
        // Clamped weights of obtuse corners and the borders' tiny constant leave a little.
        assert!(uv.distance(position.truncate()) < 2e-2, "{uv} {position}");
    }
    assert!((1.0..1.01).contains(&map.stretch), "{}", map.stretch);
}

#[test]
fn random_patches_are_certified() {
    for seed in 0..40 {
        assert_certified(bumpy(1 + seed % 14, 0.9, seed as u64, waves));
        assert_certified(shattered(seed * 5, 0.2, seed as u64));
    }
}

#[test]
fn reweighting_lowers_the_stretch_of_a_steep_hill() {
    let hill = |x: f64, y: f64| (-20.0 * ((x - 0.5).powi(2) + (y - 0.5).powi(2))).exp();
    let (mut patch, borders) = with_borders(bumpy(24, 0.3, 3, hill), MIXED);
    let best = parameterize(&mut patch, &borders);
    let edges = Edges::of(&patch.triangles);
    let mut uv = best.uv.clone();
    let on_side = place_sides(&patch, &borders, &mut uv);
    let mut system = tutte::System::of(&edges, &on_side);
    let weights = tutte::cotangent_weights(&patch.positions, &patch.triangles, &edges);
    system.solve(&edges, &weights, &mut uv);
    let first =
        stretch::Metric::of(&patch.positions, &patch.triangles).stretch(&patch.triangles, &uv);
    assert!(
        best.stretch < first - 0.02 && best.stretch >= 1.0,
        "{} {first}",
        best.stretch
    );
}

#[test]
fn side_vertices_lie_at_their_borders_parameters() {
    for forward in [[true; 4], [false; 4], MIXED] {
        let (mut patch, borders) = with_borders(bumpy(5, 0.5, 8, waves), forward);
        let map = parameterize(&mut patch, &borders);
        for side in 0..4 {
            for (k, &vertex) in patch.sides[side].iter().enumerate() {
                let params = &borders[side].params;
                let t = if forward[side] {
                    params[k]
                } else {
                    1.0 - params[params.len() - 1 - k]
                };
                let expected = [
                    DVec2::new(t, 0.0),
                    DVec2::new(1.0, t),
                    DVec2::new(1.0 - t, 1.0),
                    DVec2::new(0.0, 1.0 - t),
                ][side];
                let uv = map.uv[vertex as usize];
                assert!(uv.distance(expected) < 1e-15);
                assert!([uv.y, 1.0 - uv.x, 1.0 - uv.y, uv.x][side].abs() <= 0.0);
            }
        }
    }
}

#[test]
fn chords_of_one_side_are_split() {
    // Side 0 is 0-1-2-3-4; triangle (0, 2, 4) has all corners on it, (0, 1, 2) and (2, 3, 4) are ears, and 0-4 joins two
    // corners.
    let xy = [
        (0.0, 0.0),
        (1.0, -1.0),
        (2.0, -1.0),
        (3.0, -1.0),
        (4.0, 0.0),
        (4.0, 2.0),
        (0.0, 2.0),
    ];
    let mut patch = Patch {
        positions: xy.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect(),
        attributes: vec![Attributes::default(); 7],
        triangles: vec![[0, 1, 2], [2, 3, 4], [0, 2, 4], [0, 4, 5], [0, 5, 6]],
        sides: [vec![0, 1, 2, 3, 4], vec![4, 5], vec![5, 6], vec![6, 0]],
        borders: Default::default(),
    };
    let area = |patch: &Patch| -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| patch.positions[v as usize]);
            (b - a).cross(c - a).z
        };
        patch.triangles.iter().map(doubled).sum()
    };
    let before = area(&patch);
    let edges = Edges::of(&patch.triangles);
    assert!(chords::split(&mut patch, &edges));
    assert_eq!((patch.positions.len(), patch.triangles.len()), (10, 11));
    assert!((area(&patch) - before).abs() < 1e-12);
    let edges = Edges::of(&patch.triangles);
    assert!(edges.uses.iter().all(|&uses| uses <= 2));
    assert!(!chords::split(&mut patch, &edges));
    assert_certified(patch);
}

#[test]
fn two_triangles_need_no_system() {
    let map = assert_certified(bumpy(1, 0.0, 5, |x, y| x * y));
    assert_eq!(map.uv.len(), 4);
}

#[test]
fn degenerate_shapes_stay_finite_and_certified() {
    let mut slivers = bumpy(8, 0.0, 7, |_, _| 0.0);
    // A whole column of zero-length edges, and a row of zero-area triangles.
    for j in 0..9 {
        slivers.positions[j * 9 + 3] = slivers.positions[j * 9 + 4];
    }
    for i in 0..9 {
        slivers.positions[5 * 9 + i].y = slivers.positions[4 * 9 + i].y;
    }
    let map = assert_certified(slivers);
    assert!(map.stretch >= 1.0);
    let mut point = bumpy(4, 0.5, 2, waves);
    point.positions.fill(DVec3::ONE);
    assert!(assert_certified(point).stretch <= 0.0);
}

#[test]
fn a_tower_is_certified() {
    let tower = |x: f64, y: f64| {
        if (x - 0.5).abs().max((y - 0.5).abs()) < 0.2 {
            60.0
        } else {
            0.0
        }
    };
    assert_certified(bumpy(30, 0.4, 11, tower));
}

#[test]
fn a_deep_tube_is_certified() {
    // Rings of 16 vertices, the outermost on the sides; its harmonic map shrinks by e^-0.4 a ring.
    let (rings, around) = (110u32, 16u32);
    let mut patch = Patch::default();
    for ring in 0..rings {
        for k in 0..around {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            let radius = if ring == 0 { 2.0 } else { 1.0 };
            patch.positions.push(DVec3::new(
                radius * angle.cos(),
                radius * angle.sin(),
                0.4 * f64::from(ring),
            ));
            if ring > 0 {
                let [a, b] = [
                    (ring - 1) * around + k,
                    (ring - 1) * around + (k + 1) % around,
                ];
                patch
                    .triangles
                    .extend([[a, b, b + around], [a, b + around, a + around]]);
            }
        }
    }
    let (last, tip) = ((rings - 1) * around, rings * around);
    patch
        .positions
        .push(DVec3::new(0.0, 0.0, 0.4 * f64::from(rings)));
    patch
        .triangles
        .extend((0..around).map(|k| [last + k, last + (k + 1) % around, tip]));
    patch.attributes = vec![Attributes::default(); patch.positions.len()];
    patch.sides = [0, 4, 8, 12].map(|start| (start..=start + 4).map(|k| k % around).collect());
    let map = assert_certified(patch);
    assert!(map.stretch < 50.0, "{}", map.stretch);
}

#[test]
fn the_factor_solves_what_it_was_given() {
    for seed in [1, 2] {
        let (patch, borders) = with_borders(bumpy(20, 0.6, seed, waves), MIXED);
        let edges = Edges::of(&patch.triangles);
        let mut uv = vec![DVec2::ZERO; patch.positions.len()];
        let on_side = place_sides(&patch, &borders, &mut uv);
        let weights = tutte::cotangent_weights(&patch.positions, &patch.triangles, &edges);
        tutte::System::of(&edges, &on_side).solve(&edges, &weights, &mut uv);
        let mut pull = vec![(DVec2::ZERO, 0.0); uv.len()];
        for (&[a, b], &weight) in edges.ends.iter().zip(&weights) {
            for (from, to) in [(a, b), (b, a)] {
                pull[from as usize].0 += weight * uv[to as usize];
                pull[from as usize].1 += weight;
            }
        }
        for (vertex, (sum, total)) in pull.into_iter().enumerate() {
            assert!(on_side[vertex] || (sum / total).distance(uv[vertex]) < 1e-12);
        }
    }
}

#[test]
fn every_vertex_has_one_place_in_the_elimination_order() {
    // Two grids that do not touch, and vertices without any edge.
    let mut pairs = Vec::new();
    for base in [0u32, 400] {
        for k in 0..400u32 {
            if k % 20 < 19 {
                pairs.push([base + k, base + k + 1]);
            }
            if k < 380 {
                pairs.push([base + k, base + k + 20]);
            }
        }
    }
    let dissection::Order { mut places, blocks } = dissection::order(830, &pairs);
    places.sort_unstable();
    assert!(places.iter().zip(0u32..).all(|(&place, k)| place == k));
    assert!(blocks[0] == 0 && blocks.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(dissection::order(0, &[]).places.is_empty());
}
