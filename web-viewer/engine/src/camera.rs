//! Where the model is seen from.
//!
//! Right-handed; vertical field of view 45°; the metadata's up axis points up. World coordinates in f64.

use crate::EngineError;
use glam::DVec3;

/// Vertical field of view, radians.
pub const FIELD_OF_VIEW: f64 = std::f64::consts::FRAC_PI_4;

/// Distance of a standard view, in radii of the bounding sphere.
pub const STANDARD_DISTANCE: f64 = 2.5;

/// An eye that looks at a target, in world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where the eye is.
    pub eye: DVec3,
    /// What it looks at; never the eye.
    pub target: DVec3,
    /// Unit vector that points up in the picture, as far as the direction of view allows.
    pub up: DVec3,
}

impl Camera {
    /// Standard view `index` (0 = front, see [`standard_direction`]) of a model, from `distance` bounding-sphere radii.
    ///
    /// # Errors
    /// [`EngineError::NoSuchView`] above 25; [`EngineError::Option`] for a distance that is not finite and above 0.
    pub fn standard(
        metadata: &marquetry_format::Metadata,
        index: usize,
        distance: f64,
    ) -> Result<Self, EngineError> {
        let _ = (metadata, index, distance);
        unimplemented!()
    }

    /// Reads `eye.x,eye.y,eye.z,target.x,target.y,target.z`; up follows from the metadata. [`std::fmt::Display`] writes the same.
    ///
    /// # Errors
    /// [`EngineError::Camera`].
    pub fn parse(metadata: &marquetry_format::Metadata, text: &str) -> Result<Self, EngineError> {
        let _ = (metadata, text);
        unimplemented!()
    }
}

impl std::fmt::Display for Camera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (e, t) = (self.eye, self.target);
        write!(f, "{},{},{},{},{},{}", e.x, e.y, e.z, t.x, t.y, t.z)
    }
}
