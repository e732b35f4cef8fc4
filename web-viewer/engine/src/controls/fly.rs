//! Flying: keys move eye and target together, dragging turns the look about the eye.

use super::{Key, STEEPEST};
use crate::Camera;
use glam::{DVec2, DVec3};

/// Radii of the model that the eye flies in a second, at first.
const RADII_PER_SECOND: f64 = 0.5;
/// Factor of speed for one notch of the wheel.
const FASTER_PER_NOTCH: f64 = 1.25;
/// Slowest and fastest, radii a second.
const SPEEDS: [f64; 2] = [1e-4, 20.0];
/// Longest step, seconds: after a stall one is not far away.
const LONGEST_STEP: f64 = 0.1;

/// Keys that fly; the first of each pair moves along the positive axis: right, up, back.
const AXES: [[char; 2]; 3] = [['d', 'a'], ['e', 'q'], ['s', 'w']];

/// A flight under way.
#[derive(Debug, Clone)]
pub(super) struct Flight {
    held: Vec<char>,
    /// World length a second.
    speed: f64,
    radius: f64,
}

impl Flight {
    /// A flight around a model of `radius`.
    pub(super) fn new(radius: f64) -> Self {
        Self {
            held: Vec::new(),
            speed: RADII_PER_SECOND * radius,
            radius,
        }
    }

    /// Takes a key that goes down; whether it flies.
    pub(super) fn press(&mut self, key: Key) -> bool {
        let Key::Letter(letter) = key else {
            return false;
        };
        let flies = AXES.as_flattened().contains(&letter);
        if flies && !self.held.contains(&letter) {
            self.held.push(letter);
        }
        flies
    }

    /// Takes a key that goes up; whether it was held.
    pub(super) fn release(&mut self, key: Key) -> bool {
        let before = self.held.len();
        self.held.retain(|held| key != Key::Letter(*held));
        self.held.len() < before
    }

    /// Lets go of everything.
    pub(super) fn release_all(&mut self) {
        self.held.clear();
    }

    /// Whether a key is held.
    pub(super) fn is_moving(&self) -> bool {
        !self.held.is_empty()
    }

    /// Flies faster by `notches`, slower by negative ones.
    pub(super) fn faster(&mut self, notches: f64) {
        let [slowest, fastest] = SPEEDS.map(|speed| speed * self.radius);
        self.speed = (self.speed * FASTER_PER_NOTCH.powf(notches)).clamp(slowest, fastest);
    }

    /// Moves `camera` by what `seconds` of the held keys do.
    pub(super) fn advance(&self, seconds: f64, camera: &mut Camera, pole: DVec3) {
        let [right, _, back] = camera.frame();
        let mut direction = DVec3::ZERO;
        for ([more, less], axis) in AXES.into_iter().zip([right, pole, back]) {
            let along = |letter: char| f64::from(u8::from(self.held.contains(&letter)));
            direction += axis * (along(more) - along(less));
        }
        let step = direction.normalize_or_zero() * (self.speed * seconds.clamp(0.0, LONGEST_STEP));
        camera.eye += step;
        camera.target += step;
    }
}

/// Turns the look about the eye by `angle` (right and down, radians), kept upright.
pub(super) fn look(camera: &mut Camera, pole: DVec3, angle: DVec2) {
    let [right, _, back] = camera.frame();
    let distance = (camera.eye - camera.target).length();
    let right = (right - pole * right.dot(pole))
        .try_normalize()
        .unwrap_or(right);
    let (sin, cos) = (-angle.x).sin_cos();
    let right = right * cos + pole.cross(right) * sin;
    let level = right.cross(pole);
    let pitch = (back.dot(pole).clamp(-1.0, 1.0).asin() + angle.y).clamp(-STEEPEST, STEEPEST);
    camera.target = camera.eye - (level * pitch.cos() + pole * pitch.sin()) * distance;
    camera.up = pole;
}
