//! Pictures: no hole in any state of the cache, and the same picture by every way to it.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use marquetry_engine::camera::STANDARD_VIEWS;
use marquetry_engine::testing::{Random, Shape, random_finest};
use marquetry_engine::{Background, Camera, Shade, ViewerOptions, Viewport};
use marquetry_format::ByteSource;
use marquetry_native::{Headless, Picture, Session};
use std::sync::Arc;

const SIZE: Viewport = Viewport {
    width: 320,
    height: 240,
};

fn headless() -> Option<Headless> {
    Headless::new()
        .map_err(|error| println!("ignored: {error}"))
        .ok()
}

fn file(shape: Shape, seed: u64) -> Arc<dyn ByteSource> {
    let finest = random_finest(&mut Random::new(seed), &shape.charts(5), 2, 5);
    Arc::new(shape.write(&finest).unwrap())
}

fn over(session: &mut Session, background: [u8; 3], camera: Camera) -> Picture {
    let options = ViewerOptions {
        background: Background(background),
        ..session.viewer().options().clone()
    };
    session.viewer().set_options(options).unwrap();
    session.picture(camera, SIZE).unwrap()
}

/// Pixels that something of the background reaches.
fn uncovered(session: &mut Session, camera: Camera) -> Vec<bool> {
    let (one, other) = (
        over(session, [255, 0, 255], camera),
        over(session, [0, 255, 0], camera),
    );
    one.rgba
        .chunks_exact(4)
        .zip(other.rgba.chunks_exact(4))
        .map(|(a, b)| a != b)
        .collect()
}

/// Uncovered pixels that are not connected to the picture's border, nor within one pixel of what is.
fn holes(uncovered: &[bool]) -> usize {
    let (width, height) = (SIZE.width as usize, SIZE.height as usize);
    let around = |n: usize| {
        let (x, y) = (n % width, n / width);
        let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
        rows.flat_map(move |y| {
            (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |x| y * width + x)
        })
    };
    let mut outside = vec![false; uncovered.len()];
    let mut stack: Vec<usize> = (0..uncovered.len())
        .filter(|n| {
            (n % width == 0 || n % width == width - 1 || n / width == 0 || n / width == height - 1)
                && uncovered[*n]
        })
        .collect();
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut outside[n], true) {
            stack.extend(around(n).filter(|m| uncovered[*m] && !outside[*m]));
        }
    }
    (0..uncovered.len())
        .filter(|n| uncovered[*n] && around(*n).all(|m| !outside[m]))
        .count()
}

#[test]
fn closed_surface_has_no_hole_in_any_cache_state() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Cube, 31);
    let mut random = Random::new(32);
    for state in 0..10u64 {
        let mut session = headless
            .session(
                &source,
                ViewerOptions {
                    error_px: 0.5,
                    ..ViewerOptions::default()
                },
            )
            .unwrap();
        let (salt, share) = (random.next_u64(), 1 + state % 5);
        session.viewer().set_page_filter(Some(Box::new(move |page| {
            (u64::from(page.0) ^ salt).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32 & 7 <= share
        })));
        for _ in 0..3 {
            let metadata = session.viewer().document().metadata.clone();
            let view = random.below(u32::try_from(STANDARD_VIEWS).unwrap()) as usize;
            let camera = Camera::standard(&metadata, view, 1.3 + 2.0 * random.unit()).unwrap();
            let uncovered = uncovered(&mut session, camera);
            let covered = uncovered.iter().filter(|u| !**u).count();
            assert!(covered > 3000, "only {covered} pixels show the model");
            assert_eq!(holes(&uncovered), 0, "state {state}, view {view}");
        }
    }
}

#[test]
fn settled_picture_is_the_same_by_every_way_to_it() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Torus, 33);
    let mut fresh = headless.session(&source, ViewerOptions::default()).unwrap();
    let camera = Camera::standard(&fresh.viewer().document().metadata.clone(), 14, 1.2).unwrap();
    let expected = fresh.picture(camera, SIZE).unwrap();
    let mut wandering = headless
        .session(
            &source,
            ViewerOptions {
                cache_bytes: 900_000,
                ..ViewerOptions::default()
            },
        )
        .unwrap();
    for view in [3, 20, 8] {
        let elsewhere =
            Camera::standard(&fresh.viewer().document().metadata.clone(), view, 0.9).unwrap();
        wandering.settle(elsewhere, SIZE).unwrap();
        wandering.draw(SIZE).unwrap();
    }
    let options = ViewerOptions {
        cache_bytes: 1 << 30,
        ..ViewerOptions::default()
    };
    wandering.viewer().set_options(options).unwrap();
    assert_eq!(wandering.picture(camera, SIZE).unwrap(), expected);
}

#[test]
fn background_is_exact_and_shades_differ() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Strip, 34);
    let mut pictures = Vec::new();
    for shade in [Shade::Lit, Shade::Normal, Shade::Lod, Shade::Wire] {
        let background = Background([0x12, 0x34, 0x56]);
        let options = ViewerOptions {
            shade,
            background,
            ..ViewerOptions::default()
        };
        let mut session = headless.session(&source, options).unwrap();
        let camera =
            Camera::standard(&session.viewer().document().metadata.clone(), 0, 2.5).unwrap();
        let picture = session.picture(camera, SIZE).unwrap();
        assert_eq!(picture.pixel(0, 0), Some([0x12, 0x34, 0x56, 255]));
        assert_ne!(picture.pixel(160, 120), picture.pixel(0, 0));
        assert!(!pictures.contains(&picture));
        pictures.push(picture);
    }
}

#[test]
fn normals_point_to_the_viewer_on_the_front() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Cube, 35);
    let mut session = headless
        .session(
            &source,
            ViewerOptions {
                shade: Shade::Normal,
                ..ViewerOptions::default()
            },
        )
        .unwrap();
    // In the middle of the picture of a ball from +x, +y, +z the normal is that axis.
    for (view, axis) in [(1, 0), (4, 1), (0, 2)] {
        let camera =
            Camera::standard(&session.viewer().document().metadata.clone(), view, 2.5).unwrap();
        let pixel = session
            .picture(camera, SIZE)
            .unwrap()
            .pixel(160, 120)
            .unwrap();
        assert!(pixel[axis] > 230, "{pixel:?}");
    }
}

#[test]
fn surface_seen_from_behind_is_lit() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Strip, 36);
    let mut session = headless.session(&source, ViewerOptions::default()).unwrap();
    let brightness = |picture: &Picture| {
        let pixel = picture.pixel(160, 120).unwrap();
        u32::from(pixel[0]) + u32::from(pixel[1]) + u32::from(pixel[2])
    };
    let metadata = session.viewer().document().metadata.clone();
    for view in [0, 2] {
        let picture = session
            .picture(Camera::standard(&metadata, view, 2.5).unwrap(), SIZE)
            .unwrap();
        assert!(brightness(&picture) > 150);
    }
}
