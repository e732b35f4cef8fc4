//! Plain meshes are drawn as files are.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use glam::{DVec3, Vec2, Vec3};
use marquetry_engine::lod::mesh::extract_mesh;
use marquetry_engine::lod::uniform::{Fineness, uniform_cut};
use marquetry_engine::testing::{Random, Shape, random_finest};
use marquetry_engine::{Background, Camera, Shade, Transition, ViewerOptions, Viewport};
use marquetry_format::{ByteSource, Document, Limits};
use marquetry_native::mesh::{Looks, MeshPainter, MeshTexture, Part, PlainMesh, Vertex, Wrap};
use marquetry_native::{Headless, NativeError, Picture};
use std::sync::Arc;

const SIZE: Viewport = Viewport {
    width: 240,
    height: 200,
};

fn headless() -> Option<Headless> {
    Headless::new()
        .map_err(|error| println!("ignored: {error}"))
        .ok()
}

fn file() -> (Arc<dyn ByteSource>, Document) {
    let shape = Shape::Torus;
    let finest = random_finest(&mut Random::new(3), &shape.charts(5), 2, 5);
    let source: Arc<dyn ByteSource> = Arc::new(shape.write(&finest).unwrap());
    let mut document = Document::open(source.as_ref(), Limits::default()).unwrap();
    document.load_index(source.as_ref()).unwrap();
    (source, document)
}

/// Pixels that differ by more than rounding.
fn differing(a: &Picture, b: &Picture) -> usize {
    let pairs = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    pairs
        .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 3))
        .count()
}

/// The finest surface of a file, once as the viewer draws it and once as a plain mesh: the same picture but for a few pixels, whose
/// samples lie on edges (tolerance: 0.3% of all).
#[test]
fn a_plain_mesh_looks_as_the_file_that_it_was_taken_from() {
    let Some(headless) = headless() else { return };
    let (source, document) = file();
    let cut = uniform_cut(&document, Fineness::Finest).unwrap();
    let mesh = extract_mesh(&document, source.as_ref(), &cut).unwrap();
    let lattice = document.metadata.lattice;
    let vertices = mesh.positions.iter().zip(&mesh.normals);
    let vertices = vertices.zip(&mesh.colours);
    let plain = PlainMesh {
        vertices: vertices
            .map(|((position, normal), colour)| Vertex {
                position: DVec3::from_array(lattice.origin) + lattice.step * *position,
                normal: *normal,
                colour: *colour,
                uv: Vec2::ZERO,
            })
            .collect(),
        parts: vec![Part {
            triangles: 0..mesh.triangles.len(),
            texture: None,
        }],
        triangles: mesh.triangles,
    };
    for shade in [Shade::Lit, Shade::Normal] {
        let looks = Looks {
            shade,
            background: Background([10, 20, 30]),
            has_colours: true,
        };
        let options = ViewerOptions {
            shade,
            background: looks.background,
            error_px: 1e-3,
            transition: Transition::None,
            ..ViewerOptions::default()
        };
        let mut session = headless.session(&source, options).unwrap();
        let mut painter = MeshPainter::new(&headless, &document.metadata, looks, &[]);
        let buffers = painter.upload(&plain).unwrap();
        assert_eq!(buffers.triangles(), plain.triangles.len() as u64);
        for (view, distance) in [(0, 2.5), (12, 1.7), (20, 6.0)] {
            let camera = Camera::standard(&document.metadata, view, distance).unwrap();
            let expected = session.picture(camera, SIZE).unwrap();
            painter.draw(&buffers, &camera, SIZE).unwrap();
            let found = painter.read_back().unwrap();
            let wrong = differing(&expected, &found);
            assert!(wrong < 150, "{wrong} pixels differ, {shade:?} view {view}");
            let background = |p: &Picture| p.pixel(0, 0).unwrap();
            assert_eq!(background(&expected), background(&found));
        }
    }
}

/// A square in front of the eye whose left half has a texture and whose right half none.
#[test]
fn each_part_shows_its_own_texture() {
    let Some(headless) = headless() else { return };
    let (_, document) = file();
    let camera = Camera::standard(&document.metadata, 0, 2.5).unwrap();
    let [right, up, back] = camera.frame();
    let reach = 0.2 * (camera.eye - camera.target).length();
    let corner = |x: f64, y: f64| Vertex {
        position: camera.target + reach * (x * right + y * up),
        normal: back.as_vec3(),
        colour: [255; 3],
        uv: Vec2::new(0.5, 0.5),
    };
    let quad = |left: f64| {
        [
            (left, -1.0),
            (left + 1.0, -1.0),
            (left + 1.0, 1.0),
            (left, 1.0),
        ]
    };
    let vertices = [quad(-1.0), quad(0.0)].concat();
    let mesh = PlainMesh {
        vertices: vertices.iter().map(|&(x, y)| corner(x, y)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        parts: vec![
            Part {
                triangles: 0..2,
                texture: Some(0),
            },
            Part {
                triangles: 2..4,
                texture: None,
            },
        ],
    };
    let looks = Looks {
        shade: Shade::Unlit,
        background: Background([0, 0, 0]),
        has_colours: true,
    };
    let texture = MeshTexture {
        width: 2,
        height: 2,
        texels: vec![[200, 30, 60]; 4],
        wrap: [Wrap::Repeat; 2],
    };
    let mut painter = MeshPainter::new(&headless, &document.metadata, looks, &[texture]);
    let buffers = painter.upload(&mesh).unwrap();
    painter.draw(&buffers, &camera, SIZE).unwrap();
    let picture = painter.read_back().unwrap();
    let at = |x| picture.pixel(x, 100).unwrap();
    assert_eq!(at(100), [200, 30, 60, 255]);
    assert_eq!(at(140), [255, 255, 255, 255]);
    assert_eq!(at(2), [0, 0, 0, 255]);
}

#[test]
fn pictures_of_no_size_and_of_nothing_are_errors() {
    let Some(headless) = headless() else { return };
    let (_, document) = file();
    let looks = Looks {
        shade: Shade::Lit,
        background: Background([0; 3]),
        has_colours: false,
    };
    let mut painter = MeshPainter::new(&headless, &document.metadata, looks, &[]);
    assert!(matches!(painter.read_back(), Err(NativeError::ReadBack(_))));
    let vertex = Vertex {
        position: DVec3::NAN,
        normal: Vec3::ZERO,
        colour: [0; 3],
        uv: Vec2::ZERO,
    };
    let mesh = PlainMesh {
        vertices: vec![vertex; 3],
        triangles: vec![[0, 1, 2]],
        parts: Vec::new(),
    };
    let buffers = painter.upload(&mesh).unwrap();
    let camera = Camera::standard(&document.metadata, 0, 2.5).unwrap();
    let none = Viewport {
        width: 0,
        height: 5,
    };
    let refused = painter.draw(&buffers, &camera, none);
    assert!(matches!(refused, Err(NativeError::Size { .. })));
    painter.draw(&buffers, &camera, SIZE).unwrap();
}
