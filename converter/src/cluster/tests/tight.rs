//! Bounds of leaves that are measured, and what follows from them above.

use super::*;

/// Tightens a layer of `mesh`.
fn tighten(layer: &mut Layer, mesh: &ManifoldMesh, lattice: &Lattice) {
    let nodes = layer.nodes.clone();
    with_both(&nodes, mesh, lattice, |own, source| {
        let found = measure(own, source, 200_000).unwrap().hausdorff();
        assert!(layer.max_error > 3.0 * found);
        let [own, source] = [own, source].map(|mesh| Indexed::new(mesh).unwrap());
        layer.tighten(&own, &source, found);
        assert!(layer.max_error >= found && layer.max_error <= 2.6 * found);
    });
}

/// Errors do not grow downwards, and nodes with the same children have the same.
fn assert_in_order(nodes: &[ClusterInput]) {
    let mut errors: BTreeMap<&[u32], u32> = BTreeMap::new();
    for node in nodes {
        let children = node.children.iter();
        let below = children.map(|&child| nodes[child as usize].error);
        assert!(below.fold(0.0, f32::max) <= node.error);
        if !node.children.is_empty() {
            let bits = node.error.to_bits();
            assert_eq!(*errors.entry(&node.children).or_insert(bits), bits);
        }
    }
}

#[test]
fn tight_bounds_hold_and_nodes_stay_in_order() {
    let (mesh, lattice, mut layer) = large(90, false);
    // As if much had been done before.
    layer.add_error(3.0);
    layer.trim(0.2, 7.0);
    let before = layer.nodes.clone();
    tighten(&mut layer, &mesh, &lattice);
    for (node, was) in layer.nodes.iter().zip(&before) {
        assert!(node.error <= was.error && node.mesh == was.mesh && node.children == was.children);
    }
    assert_in_order(&layer.nodes);
}

#[test]
fn bounds_of_painted_leaves_are_found_by_the_corners_of_their_triangles() {
    let build = || {
        let (mesh, lattice, mut layer) = large(90, false);
        layer.add_error(3.0);
        (mesh, lattice, layer)
    };
    let (mesh, lattice, mut plain) = build();
    tighten(&mut plain, &mesh, &lattice);
    let (_, _, mut layer) = build();
    let count = layer.nodes.len();
    for number in 0..count {
        let node = &mut layer.nodes[number];
        node.mesh.triangles.reverse();
        node.texel = Some(1.0);
        let (is_leaf, mut child) = (node.children.is_empty(), node.clone());
        // Every other leaf comes twice, in halves that both belong to it.
        if is_leaf && number % 2 == 0 {
            let half = child.mesh.triangles.len() / 2;
            let mut other = child.clone();
            other.mesh.triangles = child.mesh.triangles.split_off(half);
            let first = u32::try_from(layer.nodes.len()).unwrap();
            layer.nodes[number].children = vec![first, first + 1];
            layer.nodes.extend([child, other]);
        }
    }
    assert!(layer.nodes.len() > count + 4);
    tighten(&mut layer, &mesh, &lattice);
    assert_in_order(&layer.nodes);
    for (painted, plain) in layer.nodes.iter().zip(&plain.nodes) {
        // Which triangle was asked before may make it the next distance tried.
        assert!(painted.error <= 1.26 * plain.error && plain.error <= 1.26 * painted.error);
    }
}

#[test]
fn triangles_are_found_by_their_corners() {
    let mesh = |positions: &[u32], triangles: &[[u8; 3]]| ClusterMesh {
        positions: positions.iter().map(|&x| [x, x * x, 7]).collect(),
        triangles: triangles.to_vec(),
        ..ClusterMesh::default()
    };
    let own = mesh(
        &[1, 2, 3, 4, 5],
        &[[0, 1, 2], [1, 2, 3], [2, 3, 4], [0, 1, 4]],
    );
    let first = mesh(&[4, 3, 2], &[[0, 1, 2]]);
    // The first twice, once turned over.
    let second = mesh(&[5, 4, 3, 2, 1], &[[0, 1, 2], [4, 3, 2], [3, 4, 2]]);
    let others = [(&first, &[3.0][..]), (&second, &[2.0, 8.0, 9.0])];
    // What is nowhere is known as badly as any.
    assert_eq!(by_corners(&own, others.into_iter()), [9.0, 3.0, 2.0, 9.0]);
}
