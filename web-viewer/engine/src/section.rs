//! A plane that cuts the model open: what lies beyond it is neither drawn nor picked.

use crate::EngineError;
use crate::camera::lattice_from_world;
use glam::DVec3;
use marquetry_format::{Lattice, Metadata};
use std::str::FromStr;

/// Where the model is cut open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Section {
    /// At right angles to an axis.
    Axis {
        /// 0 = x, 1 = y, 2 = z.
        axis: usize,
        /// Part of the bounds along the axis, 0..=1.
        part: f64,
        /// Whether the upper part stays, and not the lower.
        upper: bool,
    },
    /// Any plane: what has `normal · position <= offset` stays.
    Plane {
        /// World vector, not 0.
        normal: DVec3,
        /// World length times that of `normal`.
        offset: f64,
    },
}

impl Section {
    /// The plane for a model: unit normal, and what `normal · position` is at most; world coordinates.
    pub fn plane(self, metadata: &Metadata) -> HalfSpace {
        match self {
            Self::Axis { axis, part, upper } => {
                let sign = if upper { -1.0 } else { 1.0 };
                let end = |ends: [f64; 3]| ends.get(axis).copied().unwrap_or(0.0);
                let (min, max) = (end(metadata.bounds_min), end(metadata.bounds_max));
                HalfSpace {
                    normal: DVec3::AXES.get(axis).copied().unwrap_or(DVec3::X) * sign,
                    offset: sign * (min + (max - min) * part),
                }
            }
            Self::Plane { normal, offset } => {
                let length = normal.length();
                HalfSpace {
                    normal: normal.normalize_or(DVec3::X),
                    offset: if length > 0.0 { offset / length } else { 0.0 },
                }
            }
        }
    }
}

impl FromStr for Section {
    type Err = EngineError;

    /// Reads `AXIS,PART`: `x`, `y` or `z` and a part of the bounds, 0 to 1; the lower part stays, or the upper with a
    /// minus sign before the axis. Or `NX,NY,NZ,OFFSET`: any plane, world coordinates.
    fn from_str(text: &str) -> Result<Self, EngineError> {
        let wrong = || EngineError::Option {
            name: "section",
            value: text.to_owned(),
            expected: "AXIS,PART such as x,0.5 or -x,0.5, or NX,NY,NZ,OFFSET",
        };
        let number = |text: &str| text.trim().parse().ok().filter(|n: &f64| n.is_finite());
        let parts: Vec<&str> = text.split(',').collect();
        match parts.as_slice() {
            [axis, part] => {
                let name = axis.trim();
                let upper = name.starts_with('-');
                let axis = match name.strip_prefix('-').unwrap_or(name) {
                    "x" => 0,
                    "y" => 1,
                    "z" => 2,
                    _ => return Err(wrong()),
                };
                let part = number(part)
                    .filter(|part| (0.0..=1.0).contains(part))
                    .ok_or_else(wrong)?;
                Ok(Self::Axis { axis, part, upper })
            }
            [x, y, z, offset] => {
                let all = [x, y, z, offset].map(|text| number(text));
                let [Some(x), Some(y), Some(z), Some(offset)] = all else {
                    return Err(wrong());
                };
                let normal = DVec3::new(x, y, z);
                normal.try_normalize().ok_or_else(wrong)?;
                Ok(Self::Plane { normal, offset })
            }
            _ => Err(wrong()),
        }
    }
}

impl std::fmt::Display for Section {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Axis { axis, part, upper } => {
                let name = ["x", "y", "z"].get(*axis).copied().unwrap_or("x");
                write!(f, "{}{name},{part}", if *upper { "-" } else { "" })
            }
            Self::Plane { normal: n, offset } => write!(f, "{},{},{},{offset}", n.x, n.y, n.z),
        }
    }
}

/// The points with `normal · point <= offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Unit vector out of it.
    pub normal: DVec3,
    /// Distance of its plane from the origin, along the normal.
    pub offset: f64,
}

impl HalfSpace {
    /// The same in lattice coordinates.
    #[must_use]
    pub fn on_lattice(self, lattice: &Lattice) -> Self {
        let on_plane = lattice_from_world(lattice, self.normal * self.offset);
        Self {
            normal: self.normal,
            offset: self.normal.dot(on_plane),
        }
    }

    /// Whether `point` is in it.
    pub fn contains(self, point: DVec3) -> bool {
        self.normal.dot(point) <= self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::metadata;

    #[test]
    fn text_round_trips_and_faults_are_refused() {
        for text in ["x,0.5", "-z,0.25", "y,1", "1,0,-2,0.75"] {
            assert_eq!(Section::from_str(text).unwrap().to_string(), text);
        }
        for bad in [
            "",
            "x",
            "w,0.5",
            "x,1.5",
            "x,NaN",
            "--x,0.5",
            "0,0,0,1",
            "1,2,3",
            "1,2,3,inf",
        ] {
            assert!(Section::from_str(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn both_halves_together_are_everything() {
        let metadata = metadata();
        let half = |text: &str| Section::from_str(text).unwrap().plane(&metadata);
        for x in [-0.9, -0.1, 0.1, 0.9] {
            let point = DVec3::new(x, 0.3, -0.4);
            assert_eq!(half("x,0.5").contains(point), x < 0.0);
            assert_eq!(half("-x,0.5").contains(point), x > 0.0);
            let lattice = half("2,0,0,1").on_lattice(&metadata.lattice);
            let on_lattice = lattice_from_world(&metadata.lattice, point);
            assert_eq!(lattice.contains(on_lattice), x < 0.5);
        }
    }
}
