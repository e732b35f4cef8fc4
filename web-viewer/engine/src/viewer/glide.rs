//! The camera on its way to what was double-clicked.

use crate::Camera;
use glam::DVec3;

/// Seconds that it takes.
const SECONDS: f64 = 0.3;

/// A camera on its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Glide {
    from: Camera,
    to: Camera,
    seconds: f64,
}

impl Glide {
    /// From `camera` to one that looks at `point` from the same side and the same distance of it.
    pub(super) fn to(camera: Camera, point: DVec3) -> Self {
        let [_, _, back] = camera.frame();
        let distance = (camera.eye - point).length();
        Self {
            from: camera,
            to: Camera {
                eye: point + back * distance,
                target: point,
                ..camera
            },
            seconds: 0.0,
        }
    }

    /// Where it ends.
    pub(super) fn end(&self) -> Camera {
        self.to
    }

    /// Goes on by `seconds`; the camera, and whether it has arrived.
    pub(super) fn advance(&mut self, seconds: f64) -> (Camera, bool) {
        self.seconds += seconds;
        let part = (self.seconds / SECONDS).min(1.0);
        if part >= 1.0 {
            return (self.to, true);
        }
        let eased = part * part * (3.0 - 2.0 * part);
        let camera = Camera {
            eye: self.from.eye.lerp(self.to.eye, eased),
            target: self.from.target.lerp(self.to.target, eased),
            up: self.from.up,
        };
        (camera, false)
    }
}
