//! Small components of every sort, all the way to a tree.

use super::*;
use crate::atlas::quantize;
use crate::mesh::{ImportedMesh, prepare};
use marquetry_evaluation::distance::{Mesh, measure};
use std::collections::BTreeMap;

mod tight;

/// `count` cubes of different sizes, strewn by a fixed rule; every third lies on its neighbour's corner.
fn cubes(count: u32) -> ImportedMesh {
    let mut mesh = ImportedMesh::default();
    for n in 0..count {
        let k = f64::from(n);
        let corner = DVec3::new(
            (k * 0.618_034).fract() * 40.0,
            (k * 0.414_214).fract() * 40.0,
            k / f64::from(count) * 40.0,
        );
        let size = 0.1 + 0.3 * (k * 0.732_051).fract();
        let first = u32::try_from(mesh.positions.len()).unwrap();
        for i in 0..8u32 {
            let bit = |b: u32| f64::from(i >> b & 1);
            mesh.positions
                .push(corner + size * DVec3::new(bit(0), bit(1), bit(2)));
            mesh.colours.push([u8::try_from(n % 256).unwrap(), 9, 200]);
        }
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            mesh.triangles
                .extend([[a, b, c], [a, c, d]].map(|t| t.map(|v| first + v)));
        }
    }
    mesh
}

/// A square of `cells`² cells, too large for a cluster from 12 on.
fn sheet(cells: u32) -> ImportedMesh {
    let side = cells + 1;
    let mut mesh = ImportedMesh::default();
    for k in 0..side * side {
        let place = DVec3::new(f64::from(k % side), f64::from(k / side), 50.0);
        mesh.positions.push(place);
        mesh.colours.push([200; 3]);
    }
    for k in 0..cells * cells {
        let a = k / cells * side + k % cells;
        mesh.triangles
            .extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
    }
    mesh
}

fn joined(mut a: ImportedMesh, b: &ImportedMesh) -> ImportedMesh {
    let first = u32::try_from(a.positions.len()).unwrap();
    a.positions.extend(&b.positions);
    a.colours.extend(&b.colours);
    a.triangles
        .extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    a
}

fn lattice(mesh: &ManifoldMesh, step: f64) -> Lattice {
    let (min, max) = mesh
        .positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
            (min.min(p), max.max(p))
        });
    quantize::lattice(min, max, step)
}

#[test]
fn selection_takes_whole_components_and_leaves_the_rest_intact() {
    let mesh = joined(sheet(16), &cubes(7));
    let (mesh, _) = prepare(mesh).unwrap();
    let all = mesh.clone();
    let selection = select::select(mesh);
    assert_eq!(selection.components.len(), 7);
    assert!(
        selection
            .components
            .iter()
            .all(|component| component.len() == 12)
    );
    assert_eq!(selection.small.triangles.len(), 7 * 12);
    assert_eq!(selection.small.check(), Ok(()));
    assert_eq!(selection.rest.triangles.len(), 2 * 16 * 16);
    assert_eq!(selection.rest.positions.len(), 17 * 17);
    assert_eq!(selection.rest.colours.len(), 17 * 17);
    assert_eq!(selection.rest.check(), Ok(()));
    let area = |positions: &[DVec3], triangles: &[[u32; 3]]| -> f64 {
        let corners = triangles.iter().map(|t| t.map(|v| positions[v as usize]));
        corners
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum()
    };
    let (positions, triangles) = select::joined(selection.rest, &selection.small);
    assert_eq!(triangles.len(), all.triangles.len());
    let (before, after) = (
        area(&all.positions, &all.triangles),
        area(&positions, &triangles),
    );
    assert!((before - after).abs() < 1e-9 * before);
}

#[test]
fn what_is_too_large_for_a_cluster_is_not_selected() {
    let (mesh, _) = prepare(sheet(16)).unwrap();
    assert!(select::select(mesh).components.is_empty());
}

/// A square of `cells`² cells with every third cell in every third row left out.
fn holed(cells: u32) -> ImportedMesh {
    let mut mesh = sheet(cells);
    let is_hole = |cell: u32| cell / cells % 3 == 1 && cell % cells % 3 == 1;
    let mut triangle = 0;
    mesh.triangles.retain(|_| {
        triangle += 1;
        !is_hole((triangle - 1) / 2)
    });
    mesh
}

#[test]
fn small_sheets_cut_off_for_topology_are_selected() {
    // Three sheets on one edge: two of them are glued, the third is a copy of its own.
    let mut mesh = sheet(24);
    let flap = sheet(2);
    let mut raised = flap.clone();
    for p in &mut raised.positions {
        *p = DVec3::new(p.x, 6.0, 50.0 + p.y);
    }
    mesh = joined(mesh, &raised);
    let (mesh, _) = prepare(mesh).unwrap();
    assert!(mesh.components().1 > 1);
    let selection = select::select(mesh);
    assert_eq!(selection.components.len(), 1);
    assert_eq!(selection.components[0].len(), 2 * 2 * 2);
    assert_eq!(selection.rest.triangles.len(), 2 * 24 * 24);
    assert_eq!(selection.rest.check(), Ok(()));
}

#[test]
fn ragged_components_are_selected() {
    let (mesh, _) = prepare(joined(holed(30), &cubes(2))).unwrap();
    let count = mesh.triangles.len();
    let ragged = select::select(mesh);
    assert!(ragged.rest.triangles.is_empty());
    assert_eq!(ragged.components.len(), 3);
    assert_eq!(ragged.small.triangles.len(), count);
}

#[test]
fn tree_keeps_its_bounds_at_every_node() {
    let (mesh, _) = prepare(cubes(400)).unwrap();
    let lattice = lattice(&mesh, 1e-3);
    let selection = select::select(mesh);
    assert!(selection.rest.triangles.is_empty());
    let mesh = selection.small;
    let layer = build(&mesh, &selection.components, &lattice, true, &[]);
    assert_eq!(layer.summary.components, 400);
    assert_eq!(layer.summary.triangles, 4800);

    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    append_finest(&layer.nodes, &lattice, &mut positions, &mut triangles);
    assert_eq!(triangles.len(), 4800);
    let distance = |positions: &[DVec3], triangles: &[[u32; 3]]| {
        let own = Mesh {
            positions,
            triangles,
        };
        let source = Mesh {
            positions: &mesh.positions,
            triangles: &mesh.triangles,
        };
        measure(own, source, 20_000).unwrap().hausdorff()
    };
    assert!(distance(&positions, &triangles) <= layer.max_error);

    // Any level, as a cut.
    let nodes = &layer.nodes;
    let children = |k: usize| nodes[k].children.iter().map(|&child| child as usize);
    let mut level = vec![0];
    let mut levels = 0;
    loop {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let mut error = 0.0f64;
        for &k in &level {
            let node = &nodes[k];
            let whole = ClusterInput {
                children: Vec::new(),
                ..node.clone()
            };
            append_finest(&[whole], &lattice, &mut positions, &mut triangles);
            error = error.max(f64::from(node.error));
            assert!(children(k).all(|child| nodes[child].error <= node.error));
            assert!(node.mesh.triangles.len() <= 256 && node.mesh.positions.len() <= 256);
            assert!(node.mesh.colours.len() == node.mesh.positions.len());
        }
        let measured = distance(&positions, &triangles);
        assert!(
            measured <= error * lattice.step,
            "{measured} at level {levels}, bound {}",
            error * lattice.step
        );
        if level.iter().all(|&k| nodes[k].children.is_empty()) {
            break;
        }
        level = level
            .into_iter()
            .flat_map(|k| {
                if nodes[k].children.is_empty() {
                    vec![k]
                } else {
                    children(k).collect()
                }
            })
            .collect();
        levels += 1;
    }
    assert!(levels >= 2, "the test has seen {levels} levels");
}

#[test]
fn components_below_the_lattice_leave_something_to_see() {
    let mut mesh = joined(sheet(13), &cubes(1));
    let first = mesh.positions.len() - 8;
    for p in &mut mesh.positions[first..] {
        *p = DVec3::new(3.0, 3.0, 60.0) + 1e-9 * *p;
    }
    let (mesh, _) = prepare(mesh).unwrap();
    let lattice = lattice(&mesh, 1e-2);
    let selection = select::select(mesh);
    assert_eq!(selection.components.len(), 1);
    let layer = build(&selection.small, &selection.components, &lattice, true, &[]);
    assert!(!layer.nodes[0].mesh.triangles.is_empty());
    let unit = lattice.step * f64::from(1u32 << lattice.shift);
    assert!(layer.max_error > 0.0 && layer.max_error < 3.0 * unit);
}

#[test]
fn the_same_for_any_number_of_threads() {
    let (mesh, _) = prepare(cubes(300)).unwrap();
    let lattice = lattice(&mesh, 1e-3);
    let selection = select::select(mesh);
    let built = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let layer =
            pool.install(|| build(&selection.small, &selection.components, &lattice, true, &[]));
        format!("{:?}", layer.nodes)
    };
    assert_eq!(built(1), built(4));
}

/// Edges of a cut with the number of their triangles; `is_split` is asked of every group all of whose members are reached.
fn edges_of_cut(
    nodes: &[ClusterInput],
    mut is_split: impl FnMut() -> bool,
) -> BTreeMap<[[u32; 3]; 2], u32> {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, node) in nodes.iter().enumerate() {
        if let Some(&first) = node.children.first() {
            members.entry(first).or_default().push(k);
        }
    }
    let mut is_reached = vec![false; nodes.len()];
    let mut is_drawn = is_reached.clone();
    (is_reached[0], is_drawn[0]) = (true, true);
    for (k, node) in nodes.iter().enumerate() {
        let Some(members) = node.children.first().map(|first| &members[first]) else {
            continue;
        };
        // Children come after what they replace, so all that is to be known of a group is known at its last member.
        let is_last = members.last() == Some(&k);
        if !is_last || !members.iter().all(|&k| is_reached[k]) || !is_split() {
            continue;
        }
        for &member in members {
            is_drawn[member] = false;
        }
        for &child in &node.children {
            (is_reached[child as usize], is_drawn[child as usize]) = (true, true);
        }
    }
    let mut edges = BTreeMap::new();
    for (node, _) in nodes.iter().zip(is_drawn).filter(|(_, is_drawn)| *is_drawn) {
        for t in &node.mesh.triangles {
            for k in 0..3 {
                let end = |k: usize| node.mesh.positions[usize::from(t[k % 3])];
                let (a, b) = (end(k), end(k + 1));
                *edges.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
            }
        }
    }
    edges
}

/// A bumpy sheet of `cells`² cells, and some cubes beside it, as clusters.
fn large(cells: u32, colours: bool) -> (ManifoldMesh, Lattice, Layer) {
    let mut bumpy = sheet(cells);
    for p in &mut bumpy.positions {
        p.z += (0.7 * p.x).sin() * (0.45 * p.y).cos();
    }
    let (mesh, _) = prepare(joined(bumpy, &cubes(3))).unwrap();
    let lattice = lattice(&mesh, 1e-3);
    let mut selection = select::select(mesh);
    assert_eq!(selection.components.len(), 3);
    assert!(selection.can_take_all());
    selection.take_all(usize::MAX);
    assert!(selection.rest.triangles.is_empty());
    assert_eq!(selection.components.len(), 4);
    let layer = build(
        &selection.small,
        &selection.components,
        &lattice,
        colours,
        &[],
    );
    (selection.small, lattice, layer)
}

/// Checks that random cuts are open at the rim of the sheet only; how many different ones there were, at least.
///
/// The cubes, which lie below the sheet, fit a leaf. What stands for all may leave out faces of them, as the distance says.
fn check_cuts(nodes: &[ClusterInput], cells: u32, lattice: &Lattice) -> usize {
    let far = f64::from(cells);
    let is_on_rim = |p: [u32; 3]| {
        let at = lattice.world_from_lattice(p);
        [at.x, at.y]
            .iter()
            .any(|c| *c < 0.01 || (c - far).abs() < 0.01)
    };
    let mut random = 7u64;
    let mut sizes = std::collections::BTreeSet::new();
    for round in 0..60 {
        let coin = || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            round == 0 || random >> 33 & 3 > 0
        };
        let edges = edges_of_cut(nodes, coin);
        sizes.insert(edges.len());
        for ([a, b], count) in edges {
            let is_of_cube = lattice.world_from_lattice(a).z < 45.0;
            assert!(
                count % 2 == 0 || is_of_cube || is_on_rim(a) && is_on_rim(b),
                "{count} at {a:?} {b:?}"
            );
        }
    }
    sizes.len()
}

#[test]
fn no_cut_through_a_component_that_fits_no_leaf_opens_a_crack() {
    const CELLS: u32 = 120;
    let (_, lattice, layer) = large(CELLS, true);
    let all = (2 * CELLS * CELLS) as usize;
    assert_eq!(layer.summary.triangles, all + 36);
    let nodes = &layer.nodes;
    // What is above the leaves has about a quarter of their triangles, and each level above about half of the one below.
    let mut heights = vec![0; nodes.len()];
    let mut shared = std::collections::BTreeSet::new();
    for (k, node) in nodes.iter().enumerate().rev() {
        let below = node.children.iter().map(|&child| heights[child as usize]);
        heights[k] = below.max().map_or(0, |below: u32| below + 1);
        for &child in &node.children {
            assert!(child as usize > k && nodes[child as usize].error <= node.error);
        }
        if !node.children.is_empty() && !shared.insert(&node.children) {
            let other = nodes[..].iter().rposition(|n| n.children == node.children);
            assert_eq!(nodes[other.unwrap()].error.to_bits(), node.error.to_bits());
        }
    }
    assert!(heights[0] >= 6, "{} levels", heights[0]);
    assert!(nodes.len() < 2 * layer.summary.leaves);
    let different = check_cuts(nodes, CELLS, &lattice);
    assert!(different > 10, "{different} different cuts");
}

#[test]
fn levels_of_a_scan_with_few_nodes_are_halved() {
    let (.., layer) = large(120, false);
    let mut heights = vec![0; layer.nodes.len()];
    let mut triangles = vec![0.0; layer.nodes.len()];
    // The root stands for the cubes, too, and has a level of its own.
    for (k, node) in layer.nodes.iter().enumerate().skip(1).rev() {
        let below = node.children.iter().map(|&child| heights[child as usize]);
        heights[k] = below.max().map_or(0, |below: usize| below + 1);
        triangles[heights[k]] += node.mesh.triangles.len() as f64;
    }
    let levels = *heights.iter().max().unwrap();
    assert!(levels >= 6, "{levels} levels above the leaves");
    let ratios: Vec<f64> = (0..levels)
        .map(|k| triangles[k + 1] / triangles[k])
        .collect();
    // Leaves are most of the file: theirs is a quarter.
    assert!(ratios[0] < 0.35, "{ratios:?}");
    assert!(ratios[1..].iter().all(|ratio| *ratio > 0.4), "{ratios:?}");
}

/// The leaves among `nodes`, and the mesh that they stand for.
fn with_both<T>(
    nodes: &[ClusterInput],
    mesh: &ManifoldMesh,
    lattice: &Lattice,
    run: impl FnOnce(Mesh<'_>, Mesh<'_>) -> T,
) -> T {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    append_finest(nodes, lattice, &mut positions, &mut triangles);
    let own = Mesh {
        positions: &positions,
        triangles: &triangles,
    };
    let source = Mesh {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    };
    run(own, source)
}

#[test]
fn what_is_finer_than_asked_for_is_left_out() {
    const CELLS: u32 = 120;
    let (mesh, lattice, mut layer) = large(CELLS, false);
    let before = layer.summary;
    assert!(!layer.is_trimmed());
    let mut counts = vec![before.nodes];
    for rms in [0.1, 0.2] {
        layer.trim(rms, 4.0);
        assert!(layer.is_trimmed());
        let measured = with_both(&layer.nodes, &mesh, &lattice, |own, source| {
            measure(own, source, 20_000).unwrap()
        });
        let rounding = lattice.step * f64::from(1u32 << lattice.shift);
        assert!(
            measured.rms() <= 1.1 * rms + rounding,
            "{} of {rms}",
            measured.rms()
        );
        assert!(measured.hausdorff() <= layer.max_error && layer.max_error <= 4.0 + rounding);
        assert!(check_cuts(&layer.nodes, CELLS, &lattice) > 1);
        counts.push(layer.nodes.len());
    }
    assert!(counts.is_sorted_by(|a, b| a > b), "{counts:?}");
    // From anew, not from what was left.
    layer.trim(0.0, 0.0);
    assert_eq!(layer.summary, before);
}
