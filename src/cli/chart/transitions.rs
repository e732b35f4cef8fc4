//! What changing levels looks like: a camera that moves away from the model and back, through all levels.
//!
//! Frames are those of a viewer at 30 frames a second with everything loaded before, so that only the change itself is seen. Each is
//! compared with the whole input from the same eye (`marquetry_evaluation::popping`).
//! Limit: one model, not many at once: the engine draws one file.

use super::data::TransitionPoint;
use super::pictures::{BACKGROUND, Studio, looks, refined};
use super::quality::Shot;
use super::split::SplitMesh;
use marquetry_engine::{Camera, Transition, ViewerOptions};
use marquetry_evaluation::popping::{Popping, Spread};
use marquetry_native::MeshPainter;
use marquetry_native::mesh::MeshTexture;
use std::time::Duration;

/// Seconds between frames.
const FRAME_SECONDS: f64 = 1.0 / 30.0;
/// Frames away from the model; as many come back. Slow enough, 0.6% a frame, that what the error looks like moves by less than a pixel:
/// else that alone is change from frame to frame, and hides what levels do.
const FRAMES: u32 = 120;
/// Where the path begins and turns, bounding-sphere radii.
const NEAREST: f64 = 2.5;
const FARTHEST: f64 = 5.0;
/// Views that the path is flown from.
const VIEWS: [usize; 2] = [0, 9];
/// Screen-space error, pixels: coarse enough for changes to be seen.
const ERROR_PX: f64 = 2.0;
const TRANSITIONS: [Transition; 4] = [
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
        let cameras = path(studio, view)?;
        let mut references = Vec::new();
        for camera in &cameras {
            painter.draw(&mesh, camera, studio.size)?;
            let shot = Shot::new(painter.read_back()?, BACKGROUND.0)?;
            references.push(refined(&mut painter, &mesh, camera, &shot)?);
        }
        for (k, transition) in TRANSITIONS.into_iter().enumerate() {
            points.push(flown(studio, view, transition, &cameras, &references)?);
            let done = (number * TRANSITIONS.len() + k + 1) as f64;
            (studio.tell)(done / (VIEWS.len() * TRANSITIONS.len()) as f64);
        }
    }
    Ok(points)
}

/// Away and back, by equal factors.
fn path(studio: &Studio<'_>, view: usize) -> anyhow::Result<Vec<Camera>> {
    (0..2 * FRAMES)
        .map(|frame| {
            let part = f64::from(frame.min(2 * FRAMES - 1 - frame)) / f64::from(FRAMES - 1);
            let distance = NEAREST * (FARTHEST / NEAREST).powf(part);
            Ok(Camera::standard(studio.metadata, view, distance)?)
        })
        .collect()
}

fn flown(
    studio: &Studio<'_>,
    view: usize,
    transition: Transition,
    cameras: &[Camera],
    references: &[Shot],
) -> anyhow::Result<TransitionPoint> {
    let options = ViewerOptions {
        background: BACKGROUND,
        error_px: ERROR_PX,
        transition,
        ..ViewerOptions::default()
    };
    let mut session = studio.headless.session(&studio.source, options)?;
    // The way back first, so that it ends where the flight begins, with all pages that it takes.
    for camera in cameras.iter().rev() {
        session.settle(*camera, studio.size)?;
    }
    let mut popping = Popping::default();
    let mut triangles = 0.0;
    for (camera, reference) in cameras.iter().zip(references) {
        session.viewer().set_camera(*camera);
        session.step(FRAME_SECONDS, studio.size, Duration::ZERO);
        session.draw(studio.size)?;
        let shot = Shot::new(session.read_back()?, BACKGROUND.0)?;
        triangles += session.viewer().stats().triangles as f64;
        let mask = shot.mask.union(&reference.mask)?;
        popping.add(shot.image()?, reference.image()?, &mask)?;
    }
    Ok(TransitionPoint {
        transition: transition.name().to_owned(),
        view,
        frames: cameras.len(),
        temporal: Spread::of(popping.temporal()),
        fidelity: Spread::of(popping.fidelity()),
        triangles: triangles / cameras.len().max(1) as f64,
    })
}
