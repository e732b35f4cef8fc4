//! Orbit, pan and zoom from abstract input, the same in every shell.
//!
//! The eye turns around its target with the up axis kept upright; nothing here has inertia, so that a view is where the
//! user put it.

mod input;

pub use input::{InputEvent, Key, Modifiers, PointerButton, PointerKind};

use crate::camera::{BoundingSphere, FIELD_OF_VIEW, STANDARD_DISTANCE, up_axis};
use crate::{Camera, EngineError, Shade, Viewport};
use glam::{DVec2, DVec3};
use marquetry_format::Metadata;

/// Pixels of the viewport's height that a full turn takes: 2.
const TURNS_PER_HEIGHT: f64 = 0.5;
/// Steepest view from above or below, radians: short of the pole, where left and right lose their meaning.
const STEEPEST: f64 = 1.553_343;
/// Factor of distance for one notch of the wheel.
const ZOOM_PER_NOTCH: f64 = 1.15;
/// What an arrow key orbits, radians.
const KEY_ANGLE: f64 = 0.12;
/// What an arrow key pans, as a part of the viewport's height.
const KEY_PAN: f64 = 0.08;

/// What a control changed besides the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The event means nothing here.
    Ignored,
    /// The event was taken; the camera may have moved.
    Taken,
    /// Show this, or lit again if it is shown already.
    ToggleShade(Shade),
}

#[derive(Debug, Clone, Copy)]
struct Pointer {
    id: u64,
    position: DVec2,
    gesture: Gesture,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Gesture {
    Orbit,
    Pan,
    Zoom,
}

/// Turns input into camera moves around one model.
#[derive(Debug, Clone)]
pub struct Controls {
    sphere: BoundingSphere,
    pole: DVec3,
    home: [Camera; 6],
    pointers: Vec<Pointer>,
}

impl Controls {
    /// Controls for the model that `metadata` describes.
    ///
    /// # Errors
    /// Never for the standard views it asks for; the type follows from [`Camera::standard`].
    pub fn new(metadata: &Metadata) -> Result<Self, EngineError> {
        let mut home = [Camera::standard(metadata, 0, STANDARD_DISTANCE)?; 6];
        for (index, camera) in home.iter_mut().enumerate() {
            *camera = Camera::standard(metadata, index, STANDARD_DISTANCE)?;
        }
        Ok(Self {
            sphere: BoundingSphere::of(metadata),
            pole: up_axis(metadata),
            home,
            pointers: Vec::new(),
        })
    }

    /// Applies `event` to `camera`, seen on `viewport`.
    pub fn handle(&mut self, event: InputEvent, camera: &mut Camera, viewport: Viewport) -> Action {
        match event {
            InputEvent::PointerDown {
                pointer,
                kind,
                button,
                position,
                modifiers,
            } => {
                if kind == PointerKind::Mouse {
                    self.pointers.clear();
                }
                self.pointers.retain(|known| known.id != pointer);
                let gesture = match button {
                    _ if modifiers.control => Gesture::Zoom,
                    PointerButton::Primary if !modifiers.shift => Gesture::Orbit,
                    _ => Gesture::Pan,
                };
                self.pointers.push(Pointer {
                    id: pointer,
                    position: DVec2::from_array(position),
                    gesture,
                });
                Action::Taken
            }
            InputEvent::PointerMove { pointer, position } => {
                self.moved(pointer, DVec2::from_array(position), camera, viewport)
            }
            InputEvent::PointerUp { pointer } => {
                let before = self.pointers.len();
                self.pointers.retain(|known| known.id != pointer);
                if self.pointers.len() < before {
                    Action::Taken
                } else {
                    Action::Ignored
                }
            }
            InputEvent::Wheel { notches, position } => {
                let notches = if notches.is_finite() {
                    notches.clamp(-20.0, 20.0)
                } else {
                    0.0
                };
                self.zoom(
                    camera,
                    ZOOM_PER_NOTCH.powf(notches),
                    DVec2::from_array(position),
                    viewport,
                );
                Action::Taken
            }
            InputEvent::KeyDown { key, modifiers } => self.key(key, modifiers, camera, viewport),
        }
    }

    fn moved(
        &mut self,
        pointer: u64,
        to: DVec2,
        camera: &mut Camera,
        viewport: Viewport,
    ) -> Action {
        if !to.is_finite() {
            return Action::Ignored;
        }
        let Some(index) = self.pointers.iter().position(|known| known.id == pointer) else {
            return Action::Ignored;
        };
        let height = f64::from(viewport.height);
        let from = self.pointers[index].position;
        self.pointers[index].position = to;
        let delta = to - from;
        if self.pointers.len() == 1 {
            match self.pointers[index].gesture {
                Gesture::Orbit => {
                    let angle = delta * (std::f64::consts::TAU * TURNS_PER_HEIGHT / height);
                    self.orbit(camera, -angle.x, angle.y);
                }
                Gesture::Pan => pan(camera, delta / height),
                Gesture::Zoom => self.zoom(camera, (4.0 * delta.y / height).exp2(), to, viewport),
            }
        } else if let Some(other) = self.pointers.iter().find(|known| known.id != pointer) {
            // Two fingers: their middle moves half as far as the one that moved.
            let still = other.position;
            pan(camera, 0.5 * delta / height);
            let (before, after) = (
                (from - still).length().max(1.0),
                (to - still).length().max(1.0),
            );
            self.zoom(camera, before / after, 0.5 * (to + still), viewport);
        }
        Action::Taken
    }

    fn key(
        &self,
        key: Key,
        modifiers: Modifiers,
        camera: &mut Camera,
        viewport: Viewport,
    ) -> Action {
        if modifiers.control || modifiers.alt {
            return Action::Ignored;
        }
        let middle = 0.5 * DVec2::new(f64::from(viewport.width), f64::from(viewport.height));
        let arrow = match key {
            Key::ArrowLeft => DVec2::NEG_X,
            Key::ArrowRight => DVec2::X,
            Key::ArrowUp => DVec2::Y,
            Key::ArrowDown => DVec2::NEG_Y,
            Key::Plus => {
                self.zoom(camera, 1.0 / ZOOM_PER_NOTCH, middle, viewport);
                return Action::Taken;
            }
            Key::Minus => {
                self.zoom(camera, ZOOM_PER_NOTCH, middle, viewport);
                return Action::Taken;
            }
            Key::Home => {
                *camera = self.home[0];
                return Action::Taken;
            }
            Key::Digit(digit) => {
                let Some(view) = usize::from(digit)
                    .checked_sub(1)
                    .and_then(|n| self.home.get(n))
                else {
                    return Action::Ignored;
                };
                *camera = *view;
                return Action::Taken;
            }
            Key::Letter('l') => return Action::ToggleShade(Shade::Lod),
            Key::Letter('w') => return Action::ToggleShade(Shade::Wire),
            Key::Letter('n') => return Action::ToggleShade(Shade::Normal),
            Key::Letter(_) => return Action::Ignored,
        };
        if modifiers.shift {
            pan(camera, DVec2::new(-arrow.x, arrow.y) * KEY_PAN);
        } else {
            self.orbit(camera, arrow.x * KEY_ANGLE, arrow.y * KEY_ANGLE);
        }
        Action::Taken
    }

    /// Turns the eye around the target: `yaw` around the up axis, `pitch` upwards; radians.
    fn orbit(&self, camera: &mut Camera, yaw: f64, pitch: f64) {
        let [right, _, back] = camera.frame();
        let distance = (camera.eye - camera.target).length();
        // The right vector stays horizontal, so it tells the heading even from straight above.
        let right = (right - self.pole * right.dot(self.pole))
            .try_normalize()
            .unwrap_or(right);
        let (sin, cos) = yaw.sin_cos();
        let right = right * cos + self.pole.cross(right) * sin;
        let level = right.cross(self.pole);
        let pitch =
            (back.dot(self.pole).clamp(-1.0, 1.0).asin() + pitch).clamp(-STEEPEST, STEEPEST);
        let back = level * pitch.cos() + self.pole * pitch.sin();
        camera.eye = camera.target + back * distance;
        camera.up = self.pole;
    }

    /// Multiplies the distance by `factor`, keeping what is below `position` there.
    fn zoom(&self, camera: &mut Camera, factor: f64, position: DVec2, viewport: Viewport) {
        let offset = camera.eye - camera.target;
        let distance = offset.length();
        let wanted =
            (distance * factor).clamp(1e-4 * self.sphere.radius, 100.0 * self.sphere.radius);
        let factor = wanted / distance;
        let size = DVec2::new(f64::from(viewport.width), f64::from(viewport.height));
        let below = (position - 0.5 * size) / size.y;
        camera.eye = camera.target + offset * factor;
        if below.is_finite() {
            let shift = plane_offset(camera, below, distance - wanted);
            camera.eye += shift;
            camera.target += shift;
        }
    }
}

/// World vector of a picture offset (parts of the viewport's height, y down) on a plane at `distance` from the eye.
fn plane_offset(camera: &Camera, offset: DVec2, distance: f64) -> DVec3 {
    let [right, up, _] = camera.frame();
    (right * offset.x - up * offset.y) * (2.0 * (0.5 * FIELD_OF_VIEW).tan() * distance)
}

fn pan(camera: &mut Camera, offset: DVec2) {
    let shift = -plane_offset(camera, offset, (camera.eye - camera.target).length());
    camera.eye += shift;
    camera.target += shift;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::metadata;

    const VIEWPORT: Viewport = Viewport {
        width: 400,
        height: 200,
    };

    fn start() -> (Controls, Camera) {
        let metadata = metadata();
        (
            Controls::new(&metadata).unwrap(),
            Camera::standard(&metadata, 0, 2.5).unwrap(),
        )
    }

    fn drag(controls: &mut Controls, camera: &mut Camera, button: PointerButton, by: [f64; 2]) {
        let down = InputEvent::PointerDown {
            pointer: 1,
            kind: PointerKind::Mouse,
            button,
            position: [100.0, 100.0],
            modifiers: Modifiers::default(),
        };
        controls.handle(down, camera, VIEWPORT);
        let to = [100.0 + by[0], 100.0 + by[1]];
        controls.handle(
            InputEvent::PointerMove {
                pointer: 1,
                position: to,
            },
            camera,
            VIEWPORT,
        );
        controls.handle(InputEvent::PointerUp { pointer: 1 }, camera, VIEWPORT);
    }

    #[test]
    fn dragging_left_and_right_turns_half_a_circle_over_the_height() {
        let (mut controls, mut camera) = start();
        let before = camera;
        drag(
            &mut controls,
            &mut camera,
            PointerButton::Primary,
            [200.0, 0.0],
        );
        assert!(
            (camera.eye - (2.0 * before.target - before.eye)).length() < 1e-9 * before.eye.length()
        );
        assert_eq!(camera.target, before.target);
    }

    #[test]
    fn orbit_keeps_the_distance_and_stops_short_of_the_pole() {
        let (mut controls, mut camera) = start();
        let distance = (camera.eye - camera.target).length();
        drag(
            &mut controls,
            &mut camera,
            PointerButton::Primary,
            [13.0, 5000.0],
        );
        assert!(((camera.eye - camera.target).length() - distance).abs() < 1e-9 * distance);
        let back = (camera.eye - camera.target) / distance;
        assert!(back.y > 0.99 && back.y < 1.0);
    }

    #[test]
    fn panning_moves_eye_and_target_alike() {
        let (mut controls, mut camera) = start();
        let before = camera;
        drag(
            &mut controls,
            &mut camera,
            PointerButton::Secondary,
            [30.0, -20.0],
        );
        let shift = camera.eye - before.eye;
        assert!((shift - (camera.target - before.target)).length() < 1e-9);
        assert!(shift.x < 0.0 && shift.y < 0.0);
    }

    #[test]
    fn zoom_keeps_the_point_below_the_pointer() {
        let (mut controls, mut camera) = start();
        let metadata = metadata();
        let point = camera.target + DVec3::new(0.3, 0.2, 0.0);
        let place = |camera: &Camera| {
            let [right, up, back] = camera.frame();
            let offset = point - camera.eye;
            DVec2::new(offset.dot(right), offset.dot(up)) / -offset.dot(back)
        };
        let before = place(&camera);
        let pixels = before * (f64::from(VIEWPORT.height) / (2.0 * (0.5 * FIELD_OF_VIEW).tan()));
        let position = [200.0 + pixels.x, 100.0 - pixels.y];
        controls.handle(
            InputEvent::Wheel {
                notches: -3.0,
                position,
            },
            &mut camera,
            VIEWPORT,
        );
        assert!((place(&camera) - before).length() < 1e-9);
        assert!((camera.eye - camera.target).length() < 2.5 * BoundingSphere::of(&metadata).radius);
    }

    #[test]
    fn two_fingers_apart_come_closer() {
        let (mut controls, mut camera) = start();
        let before = (camera.eye - camera.target).length();
        for (pointer, x) in [(1, 180.0), (2, 220.0)] {
            let down = InputEvent::PointerDown {
                pointer,
                kind: PointerKind::Touch,
                button: PointerButton::Primary,
                position: [x, 100.0],
                modifiers: Modifiers::default(),
            };
            controls.handle(down, &mut camera, VIEWPORT);
        }
        controls.handle(
            InputEvent::PointerMove {
                pointer: 2,
                position: [260.0, 100.0],
            },
            &mut camera,
            VIEWPORT,
        );
        assert!(((camera.eye - camera.target).length() - 0.5 * before).abs() < 1e-9 * before);
    }

    #[test]
    fn keys_are_left_alone_with_control() {
        let (mut controls, mut camera) = start();
        let event = |control| InputEvent::KeyDown {
            key: Key::Letter('w'),
            modifiers: Modifiers {
                control,
                ..Modifiers::default()
            },
        };
        assert_eq!(
            controls.handle(event(true), &mut camera, VIEWPORT),
            Action::Ignored
        );
        assert_eq!(
            controls.handle(event(false), &mut camera, VIEWPORT),
            Action::ToggleShade(Shade::Wire)
        );
    }

    #[test]
    fn numbers_that_are_not_finite_do_not_reach_the_camera() {
        let (mut controls, mut camera) = start();
        drag(
            &mut controls,
            &mut camera,
            PointerButton::Primary,
            [f64::NAN, 1.0],
        );
        let wheel = InputEvent::Wheel {
            notches: f64::INFINITY,
            position: [f64::NAN, 0.0],
        };
        controls.handle(wheel, &mut camera, VIEWPORT);
        assert!(camera.eye.is_finite() && camera.target.is_finite());
    }
}
