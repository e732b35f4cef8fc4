//! Orbit, pan, zoom and flight from abstract input, the same in every shell.
//!
//! The eye turns around its target with the up axis kept upright; nothing here has inertia, so that a view is where the
//! user put it. What is below the pointer, where something is, decides how far a pan goes and what a zoom is about: the
//! caller finds it, at [`Controls::place_of_interest`].

mod fly;
mod input;

pub use input::{InputEvent, Key, Modifiers, PointerButton, PointerKind};

use crate::camera::{BoundingSphere, FIELD_OF_VIEW, up_axis};
use crate::{Camera, Shade, Viewport};
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
/// Standard views along an axis, which digits choose.
const FACE_VIEWS: usize = 6;

/// What a control changed besides the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// The event means nothing here.
    Ignored,
    /// The event was taken; the camera may have moved.
    Taken,
    /// Show this, or lit again if it is shown already.
    ToggleShade(Shade),
    /// Stop choosing what is drawn, or choose again.
    ToggleFreeze,
    /// Look at this point, from the same side.
    Focus(DVec3),
    /// Show the whole model from this standard view.
    Frame(usize),
}

#[derive(Debug, Clone, Copy)]
struct Pointer {
    id: u64,
    position: DVec2,
    gesture: Gesture,
    /// What was below it when it went down, world coordinates.
    held: Option<DVec3>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Gesture {
    Orbit,
    Pan,
    Zoom,
    Look,
}

/// Turns input into camera moves around one model.
#[derive(Debug, Clone)]
pub struct Controls {
    sphere: BoundingSphere,
    pole: DVec3,
    pointers: Vec<Pointer>,
    flight: Option<fly::Flight>,
}

impl Controls {
    /// Controls for the model that `metadata` describes.
    pub fn new(metadata: &Metadata) -> Self {
        Self {
            sphere: BoundingSphere::of(metadata),
            pole: up_axis(metadata),
            pointers: Vec::new(),
            flight: None,
        }
    }

    /// Where `event` asks what is below: a place of the picture, pixels. `None` where it does not matter.
    pub fn place_of_interest(&self, event: &InputEvent, viewport: Viewport) -> Option<DVec2> {
        let place = match event {
            InputEvent::Wheel { position, .. } if self.flight.is_none() => *position,
            InputEvent::PointerDown { position, .. } | InputEvent::DoubleClick { position } => {
                *position
            }
            InputEvent::PointerMove { pointer, .. } => {
                let [a, b] = self.pointers.as_slice() else {
                    return None;
                };
                if *pointer != a.id && *pointer != b.id {
                    return None;
                }
                return Some(0.5 * (a.position + b.position));
            }
            InputEvent::KeyDown {
                key: Key::Plus | Key::Minus,
                ..
            } => return Some(middle(viewport)),
            _ => return None,
        };
        Some(DVec2::from_array(place))
    }

    /// Applies `event` to `camera`, seen on `viewport`. `below` is the point of the model at
    /// [`Controls::place_of_interest`], world coordinates.
    pub fn handle(
        &mut self,
        event: InputEvent,
        camera: &mut Camera,
        viewport: Viewport,
        below: Option<DVec3>,
    ) -> Action {
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
                    _ if self.flight.is_some() => Gesture::Look,
                    _ if modifiers.control => Gesture::Zoom,
                    PointerButton::Primary if !modifiers.shift => Gesture::Orbit,
                    _ => Gesture::Pan,
                };
                self.pointers.push(Pointer {
                    id: pointer,
                    position: DVec2::from_array(position),
                    gesture,
                    held: below,
                });
                Action::Taken
            }
            InputEvent::PointerMove { pointer, position } => self.moved(
                pointer,
                DVec2::from_array(position),
                camera,
                viewport,
                below,
            ),
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
                if let Some(flight) = &mut self.flight {
                    flight.faster(-notches);
                } else {
                    let factor = ZOOM_PER_NOTCH.powf(notches);
                    let place = DVec2::from_array(position);
                    self.zoom(camera, factor, place, viewport, below);
                }
                Action::Taken
            }
            InputEvent::DoubleClick { .. } => below.map_or(Action::Ignored, Action::Focus),
            InputEvent::KeyDown { key, modifiers } => {
                self.key(key, modifiers, camera, viewport, below)
            }
            InputEvent::KeyUp { key } => {
                let taken = self
                    .flight
                    .as_mut()
                    .is_some_and(|flight| flight.release(key));
                if taken {
                    Action::Taken
                } else {
                    Action::Ignored
                }
            }
            InputEvent::Blur => {
                self.pointers.clear();
                if let Some(flight) = &mut self.flight {
                    flight.release_all();
                }
                Action::Ignored
            }
        }
    }

    /// Whether keys fly instead of orbiting.
    pub fn is_flying(&self) -> bool {
        self.flight.is_some()
    }

    /// Starts or ends flying.
    pub fn set_flying(&mut self, on: bool) {
        if on != self.is_flying() {
            self.flight = on.then(|| fly::Flight::new(self.sphere.radius));
            self.pointers.clear();
        }
    }

    /// Whether a held key moves the camera.
    pub fn is_moving(&self) -> bool {
        self.flight.as_ref().is_some_and(fly::Flight::is_moving)
    }

    /// Moves `camera` by what the held keys do in `seconds`.
    pub fn advance(&self, seconds: f64, camera: &mut Camera) {
        if let Some(flight) = &self.flight {
            flight.advance(seconds, camera, self.pole);
        }
    }

    fn moved(
        &mut self,
        pointer: u64,
        to: DVec2,
        camera: &mut Camera,
        viewport: Viewport,
        below: Option<DVec3>,
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
        let Pointer { gesture, held, .. } = self.pointers[index];
        if self.pointers.len() == 1 {
            match gesture {
                Gesture::Orbit => {
                    let angle = delta * (std::f64::consts::TAU * TURNS_PER_HEIGHT / height);
                    self.orbit(camera, -angle.x, angle.y);
                }
                Gesture::Look => {
                    let angle = delta * (std::f64::consts::TAU * TURNS_PER_HEIGHT / height);
                    fly::look(camera, self.pole, 0.5 * angle);
                }
                Gesture::Pan => pan(camera, delta / height, held),
                Gesture::Zoom => {
                    self.zoom(camera, (4.0 * delta.y / height).exp2(), to, viewport, held);
                }
            }
        } else if let Some(other) = self.pointers.iter().find(|known| known.id != pointer) {
            // Two fingers: their middle moves half as far as the one that moved.
            let still = other.position;
            pan(camera, 0.5 * delta / height, below);
            let (before, after) = (
                (from - still).length().max(1.0),
                (to - still).length().max(1.0),
            );
            self.zoom(camera, before / after, 0.5 * (to + still), viewport, below);
        }
        Action::Taken
    }

    fn key(
        &mut self,
        key: Key,
        modifiers: Modifiers,
        camera: &mut Camera,
        viewport: Viewport,
        below: Option<DVec3>,
    ) -> Action {
        if modifiers.control || modifiers.alt {
            return Action::Ignored;
        }
        if let Some(flight) = &mut self.flight
            && flight.press(key)
        {
            return Action::Taken;
        }
        let arrow = match key {
            Key::ArrowLeft => DVec2::NEG_X,
            Key::ArrowRight => DVec2::X,
            Key::ArrowUp => DVec2::Y,
            Key::ArrowDown => DVec2::NEG_Y,
            Key::Plus => {
                let factor = 1.0 / ZOOM_PER_NOTCH;
                self.zoom(camera, factor, middle(viewport), viewport, below);
                return Action::Taken;
            }
            Key::Minus => {
                let factor = ZOOM_PER_NOTCH;
                self.zoom(camera, factor, middle(viewport), viewport, below);
                return Action::Taken;
            }
            Key::Home => return Action::Frame(0),
            Key::Digit(digit) => {
                let view = usize::from(digit).checked_sub(1);
                return view
                    .filter(|view| *view < FACE_VIEWS)
                    .map_or(Action::Ignored, Action::Frame);
            }
            Key::Letter('l') => return Action::ToggleShade(Shade::Lod),
            Key::Letter('w') => return Action::ToggleShade(Shade::Wire),
            Key::Letter('n') => return Action::ToggleShade(Shade::Normal),
            Key::Letter('z') => return Action::ToggleFreeze,
            Key::Letter('g') => {
                self.set_flying(!self.is_flying());
                return Action::Taken;
            }
            Key::Escape if self.is_flying() => {
                self.set_flying(false);
                return Action::Taken;
            }
            Key::Escape | Key::Letter(_) => return Action::Ignored,
        };
        if self.is_flying() {
            fly::look(camera, self.pole, arrow * DVec2::new(KEY_ANGLE, -KEY_ANGLE));
        } else if modifiers.shift {
            pan(camera, DVec2::new(-arrow.x, arrow.y) * KEY_PAN, None);
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

    /// Multiplies the distances of eye and target from `below` by `factor`; without it, the distance from the target, keeping
    /// what is below `position` on the target's plane there.
    fn zoom(
        &self,
        camera: &mut Camera,
        factor: f64,
        position: DVec2,
        viewport: Viewport,
        below: Option<DVec3>,
    ) {
        let offset = camera.eye - camera.target;
        let distance = offset.length();
        let (nearest, farthest) = (1e-4 * self.sphere.radius, 100.0 * self.sphere.radius);
        if let Some(below) = below {
            let reach = (camera.eye - below).length();
            let (least, most) = (reach.min(distance), reach.max(distance));
            // A view that is closer or farther already may still go the other way.
            let factor = factor.clamp((nearest / least).min(1.0), (farthest / most).max(1.0));
            camera.eye = below + (camera.eye - below) * factor;
            camera.target = below + (camera.target - below) * factor;
            return;
        }
        let wanted = (distance * factor).clamp(nearest, farthest);
        let factor = wanted / distance;
        let below = (position - middle(viewport)) / f64::from(viewport.height);
        camera.eye = camera.target + offset * factor;
        if below.is_finite() {
            let shift = plane_offset(camera, below, distance - wanted);
            camera.eye += shift;
            camera.target += shift;
        }
    }
}

fn middle(viewport: Viewport) -> DVec2 {
    0.5 * DVec2::new(f64::from(viewport.width), f64::from(viewport.height))
}

/// World vector of a picture offset (parts of the viewport's height, y down) on a plane at `distance` from the eye.
fn plane_offset(camera: &Camera, offset: DVec2, distance: f64) -> DVec3 {
    let [right, up, _] = camera.frame();
    (right * offset.x - up * offset.y) * (2.0 * (0.5 * FIELD_OF_VIEW).tan() * distance)
}

/// Moves the picture by `offset`, what is at the depth of `held` exactly; without it, the target.
fn pan(camera: &mut Camera, offset: DVec2, held: Option<DVec3>) {
    let [_, _, back] = camera.frame();
    let depth = back.dot(camera.eye - held.unwrap_or(camera.target));
    let shift = -plane_offset(camera, offset, depth.max(0.0));
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
            Controls::new(&metadata),
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
        controls.handle(down, camera, VIEWPORT, None);
        let to = [100.0 + by[0], 100.0 + by[1]];
        controls.handle(
            InputEvent::PointerMove {
                pointer: 1,
                position: to,
            },
            camera,
            VIEWPORT,
            None,
        );
        controls.handle(InputEvent::PointerUp { pointer: 1 }, camera, VIEWPORT, None);
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
            None,
        );
        assert!((place(&camera) - before).length() < 1e-9);
        assert!((camera.eye - camera.target).length() < 2.5 * BoundingSphere::of(&metadata).radius);
    }

    #[test]
    fn zoom_is_about_the_point_below_and_keeps_the_direction() {
        let (mut controls, camera) = start();
        let point = DVec3::new(0.3, 0.2, 0.7);
        let radius = BoundingSphere::of(&metadata()).radius;
        for notches in [-5.0, -1.0, 2.0, 20.0] {
            let mut moved = camera;
            for _ in 0..20 {
                let before = moved;
                let wheel = InputEvent::Wheel {
                    notches,
                    position: [10.0, 20.0],
                };
                controls.handle(wheel, &mut moved, VIEWPORT, Some(point));
                let direction = |from: DVec3, to: DVec3| (to - from).normalize_or_zero();
                assert!(
                    (direction(moved.eye, point) - direction(before.eye, point)).length() < 1e-9
                );
                assert!(
                    (direction(moved.eye, moved.target) - direction(before.eye, before.target))
                        .length()
                        < 1e-9
                );
            }
            let reach = (moved.eye - point).length();
            assert!(reach >= 0.999e-4 * radius && reach <= 101.0 * radius);
            assert_eq!(notches < 0.0, reach < (camera.eye - point).length());
        }
    }

    #[test]
    fn a_pan_carries_what_was_taken_hold_of() {
        let (mut controls, mut camera) = start();
        let view = |camera: &Camera| crate::camera::View::new(camera, &metadata(), VIEWPORT);
        let point = DVec3::new(0.3, 0.2, 0.7);
        let lattice = crate::camera::lattice_from_world(&metadata().lattice, point);
        let (from, _) = view(&camera).project(lattice).unwrap();
        let to = from + DVec2::new(-33.0, 12.0);
        let down = InputEvent::PointerDown {
            pointer: 1,
            kind: PointerKind::Mouse,
            button: PointerButton::Secondary,
            position: from.to_array(),
            modifiers: Modifiers::default(),
        };
        let drag = InputEvent::PointerMove {
            pointer: 1,
            position: to.to_array(),
        };
        assert_eq!(controls.place_of_interest(&down, VIEWPORT), Some(from));
        controls.handle(down, &mut camera, VIEWPORT, Some(point));
        assert_eq!(controls.place_of_interest(&drag, VIEWPORT), None);
        controls.handle(drag, &mut camera, VIEWPORT, None);
        let (now, _) = view(&camera).project(lattice).unwrap();
        assert!((now - to).length() < 1e-6);
    }

    #[test]
    fn held_keys_fly_until_released() {
        let (mut controls, mut camera) = start();
        let before = camera;
        let key = |key| InputEvent::KeyDown {
            key,
            modifiers: Modifiers::default(),
        };
        let mut press =
            |controls: &mut Controls, event| controls.handle(event, &mut camera, VIEWPORT, None);
        assert_eq!(press(&mut controls, key(Key::Letter('g'))), Action::Taken);
        assert_eq!(press(&mut controls, key(Key::Letter('w'))), Action::Taken);
        assert!(controls.is_flying() && controls.is_moving());
        let mut flown = before;
        controls.advance(0.5, &mut flown);
        let ahead = (before.target - before.eye).normalize_or_zero();
        let moved = flown.eye - before.eye;
        assert!(moved.length() > 0.0 && (moved.normalize_or_zero() - ahead).length() < 1e-9);
        assert!((flown.target - before.target - moved).length() < 1e-9);
        let up = InputEvent::KeyUp {
            key: Key::Letter('w'),
        };
        assert_eq!(press(&mut controls, up), Action::Taken);
        assert!(!controls.is_moving());
        press(&mut controls, key(Key::Letter('d')));
        assert_eq!(press(&mut controls, InputEvent::Blur), Action::Ignored);
        assert!(!controls.is_moving());
        assert_eq!(press(&mut controls, key(Key::Escape)), Action::Taken);
        assert!(!controls.is_flying());
        assert_eq!(
            press(&mut controls, key(Key::Letter('w'))),
            Action::ToggleShade(Shade::Wire)
        );
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
            controls.handle(down, &mut camera, VIEWPORT, None);
        }
        controls.handle(
            InputEvent::PointerMove {
                pointer: 2,
                position: [260.0, 100.0],
            },
            &mut camera,
            VIEWPORT,
            None,
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
            controls.handle(event(true), &mut camera, VIEWPORT, None),
            Action::Ignored
        );
        assert_eq!(
            controls.handle(event(false), &mut camera, VIEWPORT, None),
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
        controls.handle(wheel, &mut camera, VIEWPORT, None);
        assert!(camera.eye.is_finite() && camera.target.is_finite());
    }
}
