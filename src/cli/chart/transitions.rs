//! What changing levels looks like: a camera that moves away from the model and back, through all levels.
//!
//! Frames are those of a viewer at 60 frames a second with everything loaded before, so that only the change itself is seen. Each is
//! compared with the whole input from the same eye (`marquetry_evaluation::popping`). The camera is slow: what the error looks like moves
//! with it, and that is change from frame to frame as well, which would hide what levels do. Nearly all frames of so slow a flight
//! show no change of levels; pictures are taken around some of the changes, evenly spread over the flight, and there it is slower still.
//! Limit: one model; what many cost is in [`super::row`].

use super::data::TransitionPoint;
use super::pictures::{BACKGROUND, LARGEST, Studio, looks};
use super::quality::Shot;
use super::split::SplitMesh;
use marquetry_engine::{Camera, Transition, ViewerOptions, Viewport};
use marquetry_evaluation::popping::{Popping, Spread};
use marquetry_native::mesh::MeshTexture;
use marquetry_native::{MeshPainter, Session};
use std::time::Duration;

/// Seconds between frames.
pub(super) const FRAME_SECONDS: f64 = 1.0 / 60.0;
/// Part of the distance that the camera moves in a frame: in pictures of 400 pixels their edges move by a fiftieth of one.
const RATE: f64 = 1e-4;
/// Where the path begins, bounding-sphere radii.
pub(super) const NEAREST: f64 = 1.5;
/// Where it turns.
const FARTHEST: f64 = 40.0;
/// Views that the path is flown from.
const VIEWS: [usize; 2] = [0, 9];
/// Changes that are looked at, of each view and direction.
const CHANGES: usize = 6;
/// Frames of a look: one before the change, and all that a transition of a quarter of a second takes.
const LOOK: usize = 18;
/// How much slower the camera is where one looks: at full speed what moves with it was more than all that `geomorph` does to a frame.
const SLOWER: usize = 10;
/// Frames of the path that hold a look, which begins between the first two.
const SPAN: usize = 2 + LOOK.div_ceil(SLOWER);
/// Frames of the path in one step on the way to the next change.
const STRIDE: usize = 50;
/// Each load of pages before a flight is from so many times nearer than the one before.
const NEARER: f64 = 1.5;
/// Screen-space error, pixels: coarse enough for changes to be seen.
const ERROR_PX: f64 = 2.0;
/// Pixels that are drawn, each way, in place of one, of the file and of the reference: edges that move by a part of a pixel are
/// change from frame to frame as well, and four samples a pixel make steps of it that hide what levels do.
const REFINED: u32 = 4;
/// All there are.
pub(super) const TRANSITIONS: [Transition; 4] = [
    Transition::None,
    Transition::Alpha,
    Transition::Dither,
    Transition::Geomorph,
];

/// Flies the path from every view with every transition.
///
/// # Errors
/// When the file cannot be shown, or the device fails.
pub(super) fn points(
    studio: &Studio<'_>,
    whole: &SplitMesh,
    textures: &[MeshTexture],
) -> anyhow::Result<Vec<TransitionPoint>> {
    let mut painter = MeshPainter::new(
        studio.headless,
        studio.metadata,
        looks(studio.metadata),
        textures,
    );
    let mesh = painter.upload(&whole.plain())?;
    let mut points = Vec::new();
    for (number, &view) in VIEWS.iter().enumerate() {
        let looks = looks_at_changes(studio, view)?;
        let mut references = Vec::new();
        let (fine, factor) = fine(studio.size);
        for camera in looks.iter().flat_map(|look| &look.seen) {
            painter.draw(&mesh, camera, fine)?;
            references.push(Shot::shrunk(&painter.read_back()?, factor, BACKGROUND.0)?);
        }
        for (k, transition) in TRANSITIONS.into_iter().enumerate() {
            points.push(flown(studio, view, transition, &looks, &references)?);
            let done = (number * TRANSITIONS.len() + k + 1) as f64;
            (studio.tell)(done / (VIEWS.len() * TRANSITIONS.len()) as f64);
        }
    }
    Ok(points)
}

/// The size that pictures of `size` are drawn in, and what it is times that.
fn fine(size: Viewport) -> (Viewport, u32) {
    let factor = (LARGEST / size.width.max(size.height).max(1)).clamp(1, REFINED);
    (
        Viewport::new(factor * size.width, factor * size.height),
        factor,
    )
}

/// A stretch of the path around a change of levels.
struct Look {
    /// Where it begins anew, everything at rest.
    start: Option<Camera>,
    /// The way there, in long steps.
    way: Vec<Camera>,
    /// Frame by frame.
    seen: Vec<Camera>,
}

/// A session with all pages that the way from `farthest` to [`NEAREST`] takes, to be drawn `factor` times as wide and high with the levels of
/// the studio's size.
///
/// # Errors
/// When the file cannot be shown.
pub(super) fn loaded(
    studio: &Studio<'_>,
    transition: Transition,
    view: usize,
    farthest: f64,
    factor: u32,
) -> anyhow::Result<Session> {
    let options = ViewerOptions {
        background: BACKGROUND,
        error_px: ERROR_PX * f64::from(factor),
        transition,
        ..ViewerOptions::default()
    };
    let mut session = studio.headless.session(&studio.source, options)?;
    let mut distance = farthest;
    while distance > NEAREST {
        session.settle(
            Camera::standard(studio.metadata, view, distance)?,
            Viewport::new(factor * studio.size.width, factor * studio.size.height),
        )?;
        distance /= NEARER;
    }
    Ok(session)
}

/// Flies all of the path with changes at once, to see where they are, and picks some of them.
fn looks_at_changes(studio: &Studio<'_>, view: usize) -> anyhow::Result<Vec<Look>> {
    let mut session = loaded(studio, Transition::None, view, FARTHEST, 1)?;
    let mut path = Vec::new();
    let mut distance = NEAREST;
    while distance < FARTHEST {
        path.push(Camera::standard(studio.metadata, view, distance)?);
        distance *= 1.0 + RATE;
    }
    let mut looks = Vec::new();
    for _ in ["away", "back"] {
        let changes = changes(studio, &mut session, &path)?;
        looks.extend(looks_of(&path, &changes));
        path.reverse();
    }
    for look in &mut looks {
        slow_down(studio, &mut session, look)?;
    }
    Ok(looks)
}

/// Flies to a look, and puts frames of a slower camera in place of those of the path, from the one before the change on.
fn slow_down(studio: &Studio<'_>, session: &mut Session, look: &mut Look) -> anyhow::Result<()> {
    fly_to(session, look, studio.size)?;
    let slow = slowed(&look.seen);
    let mut last = None;
    let mut before_change = 0;
    for (frame, &camera) in slow.iter().take(SLOWER + 1).enumerate() {
        session.viewer().set_camera(camera);
        session.step(FRAME_SECONDS, studio.size, Duration::ZERO);
        let cut = &session.viewer().drawn().cut;
        if last.as_ref().is_some_and(|last| last != cut) {
            before_change = frame - 1;
            break;
        }
        last = Some(cut.clone());
    }
    look.seen = slow[before_change..].iter().take(LOOK).copied().collect();
    Ok(())
}

/// The way to a look, in long steps.
fn fly_to(session: &mut Session, look: &Look, size: Viewport) -> anyhow::Result<()> {
    if let Some(start) = look.start {
        session.settle(start, size)?;
    }
    for &camera in &look.way {
        session.viewer().set_camera(camera);
        session.step(STRIDE as f64 * FRAME_SECONDS, size, Duration::ZERO);
    }
    Ok(())
}

/// The path flown [`SLOWER`] times slower.
fn slowed(path: &[Camera]) -> Vec<Camera> {
    let between = path.windows(2).flat_map(|pair| {
        (0..SLOWER).map(|k| {
            let part = k as f64 / SLOWER as f64;
            Camera {
                eye: pair[0].eye.lerp(pair[1].eye, part),
                ..pair[0]
            }
        })
    });
    between.chain(path.last().copied()).collect()
}

/// Frames of the path that draw other levels than the one before.
fn changes(
    studio: &Studio<'_>,
    session: &mut Session,
    path: &[Camera],
) -> anyhow::Result<Vec<usize>> {
    let mut changes = Vec::new();
    if let Some(&start) = path.first() {
        session.settle(start, studio.size)?;
    }
    let mut last = session.viewer().drawn().cut.clone();
    for (frame, &camera) in path.iter().enumerate() {
        session.viewer().set_camera(camera);
        session.step(FRAME_SECONDS, studio.size, Duration::ZERO);
        let drawn = &session.viewer().drawn().cut;
        if *drawn != last {
            last = drawn.clone();
            changes.push(frame);
        }
    }
    Ok(changes)
}

/// Looks at [`CHANGES`] of the `changes`, or all, as frames of the path; one look does for those that it shows anyway.
fn looks_of(path: &[Camera], changes: &[usize]) -> Vec<Look> {
    let count = changes.len().min(CHANGES);
    let mut looks: Vec<Look> = Vec::new();
    // Frames before this one have been flown.
    let mut flown = 0;
    for k in 0..count {
        let change = changes[k * (changes.len() - 1) / (count - 1).max(1)];
        let begin = change.saturating_sub(1);
        let end = (begin + SPAN).min(path.len());
        if begin < flown {
            continue;
        }
        looks.push(Look {
            start: path.first().copied().filter(|_| looks.is_empty()),
            way: path[flown..begin].iter().step_by(STRIDE).copied().collect(),
            seen: path[begin..end].to_vec(),
        });
        flown = end;
    }
    looks
}

fn flown(
    studio: &Studio<'_>,
    view: usize,
    transition: Transition,
    looks: &[Look],
    references: &[Shot],
) -> anyhow::Result<TransitionPoint> {
    let (size, factor) = fine(studio.size);
    let mut session = loaded(studio, transition, view, FARTHEST, factor)?;
    let (mut temporal, mut fidelity, mut unchanged) = (Vec::new(), Vec::new(), Vec::new());
    let mut triangles = 0.0;
    let mut references = references.iter();
    for look in looks {
        fly_to(&mut session, look, size)?;
        let mut popping = Popping::default();
        let mut last = None;
        for (&camera, reference) in look.seen.iter().zip(&mut references) {
            session.viewer().set_camera(camera);
            session.step(FRAME_SECONDS, size, Duration::ZERO);
            session.draw(size)?;
            let shot = Shot::shrunk(&session.read_back()?, factor, BACKGROUND.0)?;
            triangles += session.viewer().stats().triangles as f64;
            let mask = shot.mask.union(&reference.mask)?;
            popping.add(shot.image()?, reference.image()?, &mask)?;
            let cut = &session.viewer().drawn().cut;
            if last.as_ref() == Some(cut) {
                unchanged.extend(popping.temporal().last());
            }
            last = Some(cut.clone());
        }
        temporal.extend_from_slice(popping.temporal());
        fidelity.extend_from_slice(popping.fidelity());
    }
    Ok(TransitionPoint {
        transition: transition.name().to_owned(),
        view,
        changes: looks.len(),
        frames: fidelity.len(),
        temporal: Spread::of(&temporal),
        unchanged: (transition == Transition::None).then(|| Spread::of(&unchanged)),
        fidelity: Spread::of(&fidelity),
        triangles: triangles / fidelity.len().max(1) as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn looks_are_spread_over_changes_and_do_not_overlap() {
        let path: Vec<Camera> = (1..=1000)
            .map(|k| Camera {
                eye: DVec3::X * f64::from(k),
                target: DVec3::ZERO,
                up: DVec3::Z,
            })
            .collect();
        let at = |camera: &Camera| camera.eye.x - 1.0;
        let changes = [0, 100, 102, 300, 301, 302, 500, 700, 999];
        let looks = looks_of(&path, &changes);
        let begins: Vec<f64> = looks.iter().map(|look| at(&look.seen[0])).collect();
        assert_eq!(begins, [0.0, 99.0, 299.0, 499.0, 998.0]);
        assert!(looks[0].start.is_some() && looks[1..].iter().all(|look| look.start.is_none()));
        assert_eq!(looks[0].seen.len(), SPAN);
        assert_eq!(looks[4].seen.len(), 2);
        // On the way nothing that was seen comes again, and all before the look.
        for pair in looks.windows(2) {
            let end = at(pair[0].seen.last().unwrap());
            assert!((at(&pair[1].way[0]) - (end + 1.0)).abs() < 0.5);
            assert!(at(pair[1].way.last().unwrap()) < at(&pair[1].seen[0]));
        }
        assert!(looks_of(&path, &[]).is_empty());
        assert_eq!(looks_of(&path, &[7]).len(), 1);
        // Slower, every frame is as far from the next.
        let slow = slowed(&looks[0].seen);
        assert_eq!(slow.len(), (SPAN - 1) * SLOWER + 1);
        assert!(slow.len() >= SLOWER + LOOK);
        for pair in slow.windows(2) {
            assert!((at(&pair[1]) - at(&pair[0]) - 1.0 / SLOWER as f64).abs() < 1e-9);
        }
    }
}
