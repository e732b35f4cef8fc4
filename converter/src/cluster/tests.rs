//! Small components of every sort, all the way to a tree.

use super::*;
use crate::atlas::quantize;
use crate::mesh::{ImportedMesh, prepare};
use marquetry_evaluation::distance::{Mesh, measure};

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

#[test]
fn sheets_cut_for_topology_stay_together() {
    // Three sheets on one edge: two of them are glued, the third is a copy of its own.
    let mut mesh = sheet(13);
    let flap = sheet(2);
    let mut raised = flap.clone();
    for p in &mut raised.positions {
        *p = DVec3::new(p.x, 6.0, 50.0 + p.y);
    }
    mesh = joined(mesh, &raised);
    let (mesh, _) = prepare(mesh).unwrap();
    assert!(mesh.components().1 > 1);
    assert!(select::select(mesh).components.is_empty());
}

#[test]
fn tree_keeps_its_bounds_at_every_node() {
    let (mesh, _) = prepare(cubes(400)).unwrap();
    let lattice = lattice(&mesh, 1e-3);
    let selection = select::select(mesh);
    assert!(selection.rest.triangles.is_empty());
    let mesh = selection.small;
    let layer = build(&mesh, &selection.components, &lattice, true);
    assert_eq!(layer.summary.components, 400);
    assert_eq!(layer.summary.triangles, 4800);

    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    append_finest(&layer.root, &lattice, &mut positions, &mut triangles);
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
    let mut level = vec![&layer.root];
    let mut levels = 0;
    loop {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let mut error = 0.0f64;
        for node in &level {
            let whole = ClusterInput {
                children: Vec::new(),
                ..(*node).clone()
            };
            append_finest(&whole, &lattice, &mut positions, &mut triangles);
            error = error.max(f64::from(node.error));
            assert!(node.children.iter().all(|child| child.error <= node.error));
            assert!(node.mesh.triangles.len() <= 256 && node.mesh.positions.len() <= 256);
            assert!(node.mesh.colours.len() == node.mesh.positions.len());
        }
        let measured = distance(&positions, &triangles);
        assert!(
            measured <= error * lattice.step,
            "{measured} at level {levels}, bound {}",
            error * lattice.step
        );
        if level.iter().all(|node| node.children.is_empty()) {
            break;
        }
        level = level
            .into_iter()
            .flat_map(|node| {
                if node.children.is_empty() {
                    vec![node]
                } else {
                    node.children.iter().collect()
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
    let layer = build(&selection.small, &selection.components, &lattice, true);
    assert!(!layer.root.mesh.triangles.is_empty());
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
        let layer = pool.install(|| build(&selection.small, &selection.components, &lattice, true));
        format!("{:?}", layer.root)
    };
    assert_eq!(built(1), built(4));
}

#[test]
fn a_component_that_fits_no_leaf_is_one_node_with_its_parts_below() {
    let mesh = joined(sheet(40), &cubes(3));
    let (mesh, _) = prepare(mesh).unwrap();
    let lattice = lattice(&mesh, 1e-3);
    let mut selection = select::select(mesh);
    assert_eq!(selection.components.len(), 3);
    assert!(selection.can_take_all());
    selection.take_all(usize::MAX);
    assert!(selection.rest.triangles.is_empty());
    assert_eq!(selection.components.len(), 4);
    let mesh = &selection.small;
    assert_eq!(mesh.triangles.len(), 3200 + 36);
    let layer = build(mesh, &selection.components, &lattice, true);
    assert_eq!(layer.summary.triangles, 3200 + 36);

    let sheet = layer.root.children.iter().find(|c| !c.children.is_empty());
    let sheet = sheet.unwrap();
    assert!(sheet.children.iter().all(|part| part.children.is_empty()));
    let below: usize = sheet.children.iter().map(|c| c.mesh.triangles.len()).sum();
    assert_eq!(below, 3200);
    assert!(sheet.children.len() >= 13 && sheet.children.len() <= 26);
    // A sheet without its rim has every edge twice, also where parts meet.
    let mut edges = std::collections::BTreeMap::new();
    for part in &sheet.children {
        for t in &part.mesh.triangles {
            for k in 0..3 {
                let end = |k: usize| part.mesh.positions[usize::from(t[k % 3])];
                let (a, b) = (end(k), end(k + 1));
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
    }
    assert_eq!(edges.values().filter(|&&n| n == 1).count(), 4 * 40);
    assert!(edges.values().all(|&n| n <= 2));
    assert!(sheet.error >= sheet.children[0].error);
}

#[test]
fn components_of_more_parts_than_a_node_has_children_are_not_taken() {
    let (mesh, _) = prepare(sheet(130)).unwrap();
    assert!(mesh.triangles.len() > leaf::MOST_TRIANGLES);
    assert!(!select::select(mesh).can_take_all());
}
