//! Pictures: no hole in any state of the cache, and the same picture by every way to it.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use marquetry_engine::camera::STANDARD_VIEWS;
use marquetry_engine::testing::{Random, Shape, Wall, random_finest};
use marquetry_engine::{Background, Camera, Shade, Transition, ViewerOptions, Viewport};
use marquetry_format::ByteSource;
use marquetry_native::{Headless, Picture, Session};
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

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

/// The picture as it is just now, over a background.
fn now(session: &mut Session, background: [u8; 3]) -> Picture {
    let options = ViewerOptions {
        background: Background(background),
        ..session.viewer().options().clone()
    };
    session.viewer().set_options(options).unwrap();
    session.draw(SIZE).unwrap();
    session.read_back().unwrap()
}

#[test]
fn pictures_that_give_way_to_others_are_never_open_and_settle_to_the_same() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Cube, 37);
    let mut settled = Vec::new();
    for transition in [Transition::None, Transition::Alpha, Transition::Dither] {
        let options = ViewerOptions {
            transition,
            ..ViewerOptions::default()
        };
        let mut session = headless.session(&source, options).unwrap();
        let metadata = session.viewer().document().metadata.clone();
        let mut changing = 0;
        for view in [0, 18] {
            session
                .viewer()
                .set_camera(Camera::standard(&metadata, view, 1.1).unwrap());
            for _ in 0..30 {
                session.step(0.04, SIZE, Duration::from_millis(20));
                if !session.viewer().is_animating() {
                    continue;
                }
                changing += 1;
                // The middle of the picture shows the model, however coarse.
                let (one, other) = (
                    now(&mut session, [255, 0, 255]),
                    now(&mut session, [0, 255, 0]),
                );
                for (x, y) in (80..240).flat_map(|x| (60..180).map(move |y| (x, y))) {
                    assert_eq!(one.pixel(x, y), other.pixel(x, y), "{transition:?} {x} {y}");
                }
            }
        }
        assert_eq!(changing > 5, transition != Transition::None, "{changing}");
        let camera = Camera::standard(&metadata, 3, 1.3).unwrap();
        settled.push(over(&mut session, [0, 0, 0], camera));
    }
    assert!(settled.iter().all(|picture| *picture == settled[0]));
}

/// Mean difference of two pictures, levels of a channel.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let levels = a.rgba.iter().zip(&b.rgba);
    levels.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.rgba.len() as f64
}

/// Greatest and sum of the differences between one frame and the next while the wall gets finer, and coarser again.
fn changes(headless: &Headless, wall: &Wall, transition: Transition) -> (f64, f64) {
    let source: Arc<dyn ByteSource> = Arc::new(wall.file.clone());
    let options = |error_px| ViewerOptions {
        transition,
        error_px,
        ..ViewerOptions::default()
    };
    let mut session = headless.session(&source, options(1.0)).unwrap();
    let metadata = session.viewer().document().metadata.clone();
    let world = |point| metadata.lattice.world_from_lattice(point);
    let target = world([300_000, 65_000, 100_000]);
    let camera = Camera {
        eye: target + glam::DVec3::new(0.1, 0.2, 1.0) * 500_000.0 * metadata.lattice.step,
        target,
        up: glam::DVec3::Y,
    };
    // Everything is in memory, and coarse.
    session.settle(camera, SIZE).unwrap();
    session.viewer().set_options(options(60.0)).unwrap();
    session.settle(camera, SIZE).unwrap();
    let coarse = now(&mut session, [255, 0, 255]);
    let (mut before, mut greatest, mut sum) = (Some(coarse.clone()), 0.0f64, 0.0);
    for error_px in [1.0, 60.0] {
        session.viewer().set_options(options(error_px)).unwrap();
        let mut frames = 0;
        loop {
            session.step(1.0 / 60.0, SIZE, Duration::ZERO);
            // Before backgrounds are options that change.
            let is_settled = session.viewer().is_settled();
            let (one, other) = (
                now(&mut session, [255, 0, 255]),
                now(&mut session, [0, 255, 0]),
            );
            for (x, y) in (120..200).flat_map(|x| (100..140).map(move |y| (x, y))) {
                assert_eq!(one.pixel(x, y), other.pixel(x, y), "a crack at {x} {y}");
            }
            let change = before.map_or(0.0, |before| difference(&before, &one));
            greatest = greatest.max(change);
            sum += change;
            before = Some(one);
            frames += 1;
            assert!(frames < 300, "stuck");
            if is_settled {
                break;
            }
        }
    }
    assert_eq!(before, Some(coarse), "the way back ends where it began");
    (greatest, sum)
}

#[test]
fn clusters_change_level_without_a_jump() {
    let Some(headless) = headless() else { return };
    let wall = Wall::new(100, None).unwrap();
    let (jump, all_at_once) = changes(&headless, &wall, Transition::None);
    let (step, bit_by_bit) = changes(&headless, &wall, Transition::Geomorph);
    println!("greatest change: {step} in place of {jump}; sums: {bit_by_bit}, {all_at_once}");
    assert!(
        jump > 0.5 && bit_by_bit > all_at_once,
        "there is something to see"
    );
    // What is left is the light on edges of the coarser columns, which are long fans.
    assert!(step < 0.5 * jump, "{step} {jump}");
}

#[test]
fn halfway_both_pictures_are_seen() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Cube, 39);
    let brightness = |p: [u8; 4]| i32::from(p[0]) + i32::from(p[1]) + i32::from(p[2]);
    for transition in [Transition::Alpha, Transition::Dither] {
        let mut session = headless
            .session(
                &source,
                ViewerOptions {
                    transition,
                    shade: Shade::Lod,
                    ..ViewerOptions::default()
                },
            )
            .unwrap();
        let metadata = session.viewer().document().metadata.clone();
        let far = Camera::standard(&metadata, 0, 30.0).unwrap();
        session.viewer().set_page_filter(Some(Box::new(|_| false)));
        session.settle(far, SIZE).unwrap();
        let near = Camera::standard(&metadata, 0, 1.2).unwrap();
        // What is drawn stays that of afar until the picture of near by begins to take its place.
        let mut last = None;
        for _ in 0..40 {
            session.viewer().set_camera(near);
            session.step(0.05, SIZE, Duration::ZERO);
            let picture = now(&mut session, [0, 0, 0]);
            if session.viewer().is_animating() {
                last = Some(picture);
            } else if let Some(during) = last.take() {
                let middle = || (100..220).flat_map(|x| (70..170).map(move |y| (x, y)));
                let changed = middle()
                    .filter(|(x, y)| during.pixel(*x, *y) != picture.pixel(*x, *y))
                    .count();
                let same = middle().count() - changed;
                if transition == Transition::Dither {
                    // At four fifths of the change some pixels have changed already, and others not.
                    assert!(changed > 100 && same > 1000, "{changed} {same}");
                } else {
                    let difference = |(x, y): (u32, u32)| {
                        (brightness(during.pixel(x, y).unwrap())
                            - brightness(picture.pixel(x, y).unwrap()))
                        .abs()
                    };
                    let sum: i32 = middle().map(difference).sum();
                    assert!(sum > 0 && changed > same, "{changed} {same} {sum}");
                }
                break;
            }
        }
    }
}

#[test]
fn a_section_shows_one_half_and_is_picked_so() {
    let Some(headless) = headless() else { return };
    let source = file(Shape::Cube, 38);
    for (section, shown, hidden) in [("x,0.5", 130, 190), ("-x,0.5", 190, 130)] {
        let options = ViewerOptions {
            section: Some(marquetry_engine::Section::from_str(section).unwrap()),
            ..ViewerOptions::default()
        };
        let mut session = headless.session(&source, options).unwrap();
        let metadata = session.viewer().document().metadata.clone();
        let camera = Camera::standard(&metadata, 0, 2.5).unwrap();
        let picture = session.picture(camera, SIZE).unwrap();
        let background = picture.pixel(0, 0);
        assert_ne!(picture.pixel(shown, 120), background);
        assert_eq!(picture.pixel(hidden, 120), background);
        let mut pick = |x: u32| session.viewer().pick([f64::from(x) + 0.5, 120.5]);
        let [shown, hidden] = [shown, hidden].map(&mut pick);
        assert!(shown.is_some() && hidden.is_none());
    }
}
