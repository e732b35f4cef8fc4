//! Clusters with textures: what is written is read, and what is wrong is refused.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::cluster::ClusterTexture;
use marquetry_format::verify::verify;
use marquetry_format::writer::ClusterInput;
use marquetry_format::*;
use support::*;

/// A key frame of 16 × 24 texels: red grows along a row, green from row to row.
const FRAME: &[u8] = include_bytes!("data/texture_16x24.vp8");

fn textured(node: &mut ClusterInput, texel: f32) {
    let places = (0..node.mesh.positions.len()).map(|k| [(k * 7 % 16) as u8, (k * 5 % 24) as u8]);
    node.mesh.texture = Some(ClusterTexture {
        places: places.collect(),
        frame: FRAME.to_vec(),
    });
    node.texel = Some(texel);
}

/// The root and one leaf have textures, the others none.
fn tree(has_colours: bool) -> Vec<ClusterInput> {
    let mut nodes = clusters(10, has_colours);
    textured(&mut nodes[0], 2.5e4);
    textured(&mut nodes[5], 0.3);
    nodes
}

fn written(nodes: &[ClusterInput], has_colours: bool) -> Result<Vec<u8>, Error> {
    without_charts(10, has_colours).write_with(nodes)
}

#[test]
fn textures_survive() {
    for has_colours in [true, false] {
        let inputs = tree(has_colours);
        let file = written(&inputs, has_colours).unwrap();
        let report = verify(&SliceSource(&file)).unwrap();
        assert!(report.ok, "{report:#?}");
        let decoding = report
            .checks
            .iter()
            .find(|check| check.name == "cluster textures decode");
        assert_eq!(decoding.unwrap().count, 2);
        let document = open(&file);
        let nodes = &document.clusters.as_ref().unwrap().nodes;
        let meshes = decode_clusters(&document, &SliceSource(&file));
        for ((given, node), mesh) in inputs.iter().zip(nodes).zip(&meshes) {
            assert_eq!(given.texel.is_some(), mesh.texture.is_some());
            let (Some(given_texel), Some(texel)) = (given.texel, node.texel) else {
                assert_eq!(given.texel.is_some(), node.texel.is_some());
                continue;
            };
            assert!(texel >= given_texel && texel < 1.1 * given_texel);
            let triangles = |mesh: &ClusterMesh| {
                let places = &mesh.texture.as_ref().unwrap().places;
                triangles_of(mesh, |v| (mesh.positions[v], places[v]))
            };
            assert_eq!(triangles(&given.mesh), triangles(mesh));
            let texels = mesh.texture.as_ref().unwrap().decode().unwrap();
            assert_eq!((texels.width, texels.height), (16, 24));
            let at = |i: usize, j: usize| &texels.rgb[3 * (16 * j + i)..][..3];
            assert!(at(15, 0)[0] > 200 && at(0, 0)[0] < 40);
            assert!(at(0, 23)[1] > 190 && at(0, 0)[1] < 40);
        }
    }
}

#[test]
fn a_tree_without_textures_says_nothing_of_them() {
    let file = written(&clusters(10, true), true).unwrap();
    let report = verify(&SliceSource(&file)).unwrap();
    assert!(
        report
            .checks
            .iter()
            .all(|check| !check.name.contains("texture"))
    );
    let document = open(&file);
    let nodes = &document.clusters.as_ref().unwrap().nodes;
    assert!(nodes.iter().all(|node| node.texel.is_none()));
}

#[test]
fn what_is_wrong_is_not_written() {
    let spoilt = |spoil: fn(&mut ClusterInput)| {
        let mut nodes = tree(false);
        spoil(&mut nodes[0]);
        written(&nodes, false).is_err()
    };
    assert!(!spoilt(|_| ()));
    assert!(spoilt(|root| root.texel = None));
    assert!(spoilt(|root| root.texel = Some(f32::NAN)));
    assert!(spoilt(|root| root.texel = Some(0.0)));
    assert!(spoilt(|root| root.mesh.texture = None));
    assert!(spoilt(|root| root
        .mesh
        .texture
        .as_mut()
        .unwrap()
        .places
        .truncate(3)));
    assert!(spoilt(
        |root| root.mesh.texture.as_mut().unwrap().places[0] = [16, 0]
    ));
    assert!(spoilt(
        |root| root.mesh.texture.as_mut().unwrap().places[0] = [0, 24]
    ));
    assert!(spoilt(|root| root
        .mesh
        .texture
        .as_mut()
        .unwrap()
        .frame
        .truncate(9)));
    // Twelve is no multiple of eight.
    let small = include_bytes!("data/tile_12x12.vp8");
    let mut nodes = tree(false);
    nodes[0].mesh.texture = Some(ClusterTexture {
        places: vec![[0, 0]; nodes[0].mesh.positions.len()],
        frame: small.to_vec(),
    });
    assert!(written(&nodes, false).is_err());
}

/// The codec has no checksum, the page has: damage is found there.
#[test]
fn damaged_textures_are_found() {
    let file = written(&tree(false), false).unwrap();
    let document = open(&file);
    let node = document
        .clusters
        .as_ref()
        .unwrap()
        .nodes
        .iter()
        .skip(1)
        .find(|n| n.texel.is_some());
    let end = usize::try_from(node.unwrap().range.end).unwrap();
    let mut damaged = file.clone();
    damaged[end - 20] ^= 4;
    assert!(!verify(&SliceSource(&damaged)).unwrap().ok);
}
