#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "test data are small"
)]

use super::*;
use crate::texture::encode::frame;
use glam::Vec3;
use marquetry_format::cluster::ClusterTexture;
use marquetry_format::writer::{ChartInput, ClusterInput, NodeInput};
use marquetry_format::{
    ClusterMesh, ContentKind, Lattice, NormalCone, PageSamples, octahedral, thumbnail,
};
use std::f64::consts::{PI, TAU};

/// Radius of the sphere, lattice units.
const RADIUS: f64 = 900_000.0;
/// Around and from pole to pole.
const CELLS: [u32; 2] = [16, 8];

fn metadata(up_axis: u8) -> Metadata {
    Metadata {
        kind: ContentKind::Scan,
        lattice: Lattice {
            origin: [0.0; 3],
            step: 1.0,
            shift: 0,
        },
        bounds_min: [0.0; 3],
        bounds_max: [2.0 * RADIUS; 3],
        up_axis,
        has_colours: false,
        target_error_rel: 1e-4,
        max_error_rel: 1e-4,
        rms_error_rel: 1e-4,
        source_triangles: 1,
        source_vertices: 1,
        source_name: String::new(),
        generator: String::new(),
    }
}

/// A place of the sphere, u around the y axis and v from the lower pole, both 0 to 1; its position and its normal.
fn on_sphere(u: f64, v: f64) -> ([u32; 3], [u8; 2]) {
    let (around, height) = (TAU * u, PI * v);
    let ring = height.sin();
    let normal = [ring * around.sin(), -height.cos(), ring * around.cos()];
    let position = normal.map(|c| num(1_000_000.0 + RADIUS * c));
    (position, octahedral::encode(normal.map(|c| c as f32)))
}

fn num(c: f64) -> u32 {
    c.round() as u32
}

/// A closed sphere in one cluster: red where x is less than in the middle, else green, if there are colours.
fn sphere(has_colours: bool) -> ClusterInput {
    let mut mesh = ClusterMesh::default();
    for j in 0..=CELLS[1] {
        for i in 0..CELLS[0] {
            let [u, v] = [i, j].map(f64::from);
            let (position, normal) = on_sphere(u / f64::from(CELLS[0]), v / f64::from(CELLS[1]));
            mesh.positions.push(position);
            mesh.normals.push(normal);
            if has_colours {
                let left = position[0] < 1_000_000;
                mesh.colours
                    .push(if left { [255, 0, 0] } else { [0, 255, 0] });
            }
            if j < CELLS[1] {
                let at = |i: u32, j: u32| (j * CELLS[0] + i % CELLS[0]) as u8;
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let [a, b, c, d] = corners;
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    ClusterInput {
        mesh,
        ..ClusterInput::default()
    }
}

fn drawn(clusters: &[ClusterInput], up_axis: u8) -> Vec<u8> {
    let content = Content {
        clusters,
        ..Content::default()
    };
    pixels(&content, &metadata(up_axis)).unwrap()
}

fn pixel(rgba: &[u8], x: usize, y: usize) -> [u8; 4] {
    let at = 4 * (y * WIDTH as usize + x);
    rgba[at..at + 4].try_into().unwrap()
}

/// Pixels of which all is covered, from the first to the last of a row.
fn row(rgba: &[u8], y: usize) -> Vec<usize> {
    let all = 0..WIDTH as usize;
    all.filter(|&x| pixel(rgba, x, y)[3] == 255).collect()
}

#[test]
fn a_closed_shape_covers_its_silhouette_without_a_hole() {
    for up_axis in 0..3 {
        let rgba = drawn(&[sphere(false)], up_axis);
        assert_eq!(rgba.len(), 4 * (WIDTH * HEIGHT) as usize);
        let area: f64 = rgba.chunks(4).map(|p| f64::from(p[3]) / 255.0).sum();
        // Of a polyhedron within the circle that the margin leaves.
        let circle = PI * (f64::from(HEIGHT) / 2.0 - 6.0).powi(2);
        assert!((0.95..1.06).contains(&(area / circle)), "{}", area / circle);
        for y in 0..HEIGHT as usize {
            let covered = row(&rgba, y);
            let gaps = covered.windows(2).filter(|pair| pair[1] != pair[0] + 1);
            assert_eq!(gaps.count(), 0, "row {y}");
        }
        assert_eq!(
            row(&rgba, 5).len() + row(&rgba, HEIGHT as usize - 6).len(),
            0
        );
        assert_eq!(pixel(&rgba, 0, 96)[3], 0);
    }
}

#[test]
fn light_comes_from_above_and_the_left() {
    let rgba = drawn(&[sphere(false)], 1);
    let at = |x, y| pixel(&rgba, x, y)[1];
    let (key, far) = (at(100, 60), at(170, 150));
    assert!(key > 180 && far < 130, "{key} and {far}");
    // Of a surface without colours, nearly grey.
    let [r, _, b, _] = pixel(&rgba, 128, 96);
    assert!(r.abs_diff(b) < 30);
}

#[test]
fn what_is_seen_is_the_near_side_in_its_colours() {
    // The eye is on the side of +x, so that most of what it sees is green.
    let rgba = drawn(&[sphere(true)], 1);
    let [r, g, ..] = pixel(&rgba, 170, 96);
    assert!(g > 150 && r < 60, "{r} {g}");
    let [r, g, ..] = pixel(&rgba, 45, 96);
    assert!(r > 150 && g < 60, "{r} {g}");
    // Where z is up, the front is −y and right is +x, as before.
    let [r, g, ..] = pixel(&drawn(&[sphere(true)], 2), 170, 96);
    assert!(g > 150 && r < 60, "{r} {g}");
}

#[test]
fn images_take_the_place_of_colours() {
    let mut node = sphere(true);
    // Left half blue, right half white, whatever the vertices are.
    let rgb: Vec<u8> = (0..64 * 64)
        .flat_map(|k| if k % 64 < 32 { [20, 40, 230] } else { [250; 3] })
        .collect();
    node.texel = Some(1000.0);
    node.mesh.texture = Some(ClusterTexture {
        places: node
            .mesh
            .positions
            .iter()
            .map(|p| [if p[0] < 1_000_000 { 8 } else { 56 }, 30])
            .collect(),
        frame: frame(&rgb, 64, 64).unwrap(),
    });
    let rgba = drawn(&[node.clone()], 1);
    let [r, g, b, _] = pixel(&rgba, 60, 96);
    assert!(b > 100 && r < 60 && g < 80, "{r} {g} {b}");
    let [r, g, b, _] = pixel(&rgba, 170, 96);
    assert!(r > 150 && g > 150 && b > 130, "{r} {g} {b}");
    node.mesh.texture.as_mut().unwrap().frame.truncate(9);
    let content = Content {
        clusters: &[node],
        ..Content::default()
    };
    let error = draw(&content, &metadata(1)).unwrap_err();
    assert!(matches!(error, ThumbnailError::Texture(_)));
}

/// Its triangles are less than a pixel each, so that the colours of their corners show as much as the image.
#[test]
fn images_of_small_clusters_are_not_needed() {
    let root = ClusterInput {
        error: 1e6,
        children: vec![1, 2],
        ..sphere(true)
    };
    let mut small = sphere(true);
    for position in &mut small.mesh.positions {
        *position = position.map(|c| 2_000_000 + c / 50);
    }
    small.mesh.colours.fill([255, 0, 0]);
    small.texel = Some(100.0);
    small.mesh.texture = Some(ClusterTexture {
        places: vec![[9, 9]; small.mesh.positions.len()],
        frame: frame(&[20, 40, 230].repeat(64 * 64), 64, 64).unwrap(),
    });
    let counts = |rgba: &[u8]| {
        let red = rgba
            .chunks(4)
            .filter(|p| p[0] > 120 && p[1] < 60 && p[3] == 255);
        let blue = rgba.chunks(4).filter(|p| p[2] > 120 && p[1] < 90);
        [red.count(), blue.count()]
    };
    let mut large = sphere(false);
    large.mesh.colours = vec![[60, 200, 60]; large.mesh.positions.len()];
    let mut nodes = [root, large, small];
    let [red, blue] = counts(&drawn(&nodes, 1));
    assert!(red > 4 && blue == 0, "{red} {blue}");
    // Without colours there is nothing but the image.
    nodes[2].mesh.colours.clear();
    let [red, blue] = counts(&drawn(&nodes, 1));
    assert!(red == 0 && blue > 4, "{red} {blue}");
}

/// The sphere as a chart, in which `split` nodes have children.
fn chart(level: u32, [x, y]: [u32; 2], levels: u32) -> NodeInput {
    let mut samples = PageSamples {
        resolution: 5,
        ..PageSamples::default()
    };
    for j in 0..33 {
        for i in 0..33 {
            let [u, v] = [(x, i), (y, j)]
                .map(|(n, k)| (f64::from(n) + f64::from(k) / 32.0) / f64::from(1 << level));
            let (position, normal) = on_sphere(u, v);
            samples.positions.push(position);
            samples.normals.push(normal);
        }
    }
    let children = (level < levels).then(|| {
        let child = |q: u32| chart(level + 1, [2 * x + q % 2, 2 * y + q / 2], levels);
        Box::new([0, 1, 2, 3].map(child))
    });
    NodeInput {
        samples,
        errors: Vec::new(),
        cone: NormalCone {
            axis: [0.0, 0.0, 1.0],
            cos: -1.0,
        },
        children,
    }
}

#[test]
fn charts_and_clusters_of_one_surface_look_alike() {
    let charts = [0, 2].map(|levels| {
        let root = chart(0, [0, 0], levels);
        let charts = [ChartInput {
            glue: [None; 4],
            root,
        }];
        let content = Content {
            charts: &charts,
            ..Content::default()
        };
        pixels(&content, &metadata(1)).unwrap()
    });
    let clusters = drawn(&[sphere(false)], 1);
    for rgba in &charts {
        // Inside, away from the edges of the polyhedron.
        let differences = (40..152)
            .flat_map(|y| (70..186).map(move |x| (x, y)))
            .map(|(x, y)| {
                let [a, b] = [pixel(rgba, x, y), pixel(&clusters, x, y)].map(|p| p.map(f32::from));
                (Vec3::new(a[0], a[1], a[2]) - Vec3::new(b[0], b[1], b[2]))
                    .abs()
                    .max_element()
            });
        let (count, sum) = differences.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + d));
        assert!(sum / count < 6.0, "{}", sum / count);
    }
}

#[test]
fn the_picture_is_a_small_webp_file_and_the_same_every_time() {
    let sphere = [sphere(true)];
    let content = Content {
        clusters: &sphere,
        ..Content::default()
    };
    let files = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| draw(&content, &metadata(1)).unwrap())
    });
    assert_eq!(files[0], files[1]);
    assert!(files[0].len() < 4000, "{}", files[0].len());
    let picture = thumbnail::decode(&files[0]).unwrap();
    assert_eq!((picture.width, picture.height), (WIDTH, HEIGHT));
    assert!(picture.has_alpha);
    // What is transparent stays so, and what is covered.
    let rgba = pixels(&content, &metadata(1)).unwrap();
    for (stored, drawn) in picture.pixels.chunks(4).zip(rgba.chunks(4)) {
        assert_eq!(stored[3], drawn[3]);
    }
}

#[test]
fn nothing_to_draw_is_an_empty_picture() {
    let rgba = drawn(&[], 1);
    assert!(rgba.iter().all(|&byte| byte == 0));
}
