//! Where the model is seen from.
//!
//! Right-handed; vertical field of view 45°; the metadata's up axis points up. World coordinates in f64; what goes to
//! the GPU is relative to the eye in lattice units, so that no precision is lost far from the origin ([`LatticeEye`]).

use crate::{EngineError, Viewport};
use glam::{DMat4, DVec2, DVec3, DVec4};
use marquetry_format::{Bounds, Lattice, Metadata};

/// Vertical field of view, radians.
pub const FIELD_OF_VIEW: f64 = std::f64::consts::FRAC_PI_4;

/// Distance of a standard view, in radii of the bounding sphere.
pub const STANDARD_DISTANCE: f64 = 2.5;

/// Number of standard views.
pub const STANDARD_VIEWS: usize = 26;

/// Cosine above which the direction of view counts as parallel to the up axis: less than half a degree.
const PARALLEL: f64 = 0.999_97;

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
    pub fn standard(metadata: &Metadata, index: usize, distance: f64) -> Result<Self, EngineError> {
        let direction = standard_direction(index).ok_or(EngineError::NoSuchView(index))?;
        if !(distance.is_finite() && distance > 0.0) {
            return Err(EngineError::Option {
                name: "distance",
                value: distance.to_string(),
                expected: "a finite number of bounding-sphere radii above 0",
            });
        }
        let sphere = BoundingSphere::of(metadata);
        let direction = direction.normalize_or_zero();
        let eye = sphere.centre + direction * (distance * sphere.radius);
        Ok(Self {
            eye,
            target: sphere.centre,
            up: picture_up(direction, up_axis(metadata)),
        })
    }

    /// Standard view `index` from where the model fits `viewport`: [`STANDARD_DISTANCE`], or as much farther as a
    /// picture is taller than wide, so that what is seen across it stays the same.
    ///
    /// # Errors
    /// [`EngineError::NoSuchView`] above 25.
    pub fn framing(
        metadata: &Metadata,
        index: usize,
        viewport: Viewport,
    ) -> Result<Self, EngineError> {
        let taller = f64::from(viewport.height) / f64::from(viewport.width);
        Self::standard(metadata, index, STANDARD_DISTANCE * taller.max(1.0))
    }

    /// Reads `eye.x,eye.y,eye.z,target.x,target.y,target.z`; up follows from the metadata.
    /// [`std::fmt::Display`] writes the same.
    ///
    /// # Errors
    /// [`EngineError::Camera`].
    pub fn parse(metadata: &Metadata, text: &str) -> Result<Self, EngineError> {
        let wrong = |reason| EngineError::Camera {
            text: text.to_owned(),
            reason,
        };
        let mut numbers = [0.0f64; 6];
        let mut parts = text.split(',');
        for number in &mut numbers {
            let part = parts.next().ok_or_else(|| wrong("too few numbers"))?;
            *number = part
                .trim()
                .parse()
                .ok()
                .filter(|n: &f64| n.is_finite())
                .ok_or_else(|| wrong("not a number"))?;
        }
        if parts.next().is_some() {
            return Err(wrong("too many numbers"));
        }
        let [ex, ey, ez, tx, ty, tz] = numbers;
        let (eye, target) = (DVec3::new(ex, ey, ez), DVec3::new(tx, ty, tz));
        let direction = (eye - target)
            .try_normalize()
            .ok_or_else(|| wrong("eye and target are the same point"))?;
        Ok(Self {
            eye,
            target,
            up: picture_up(direction, up_axis(metadata)),
        })
    }

    /// Right, up and back (towards the eye) of the picture: unit vectors at right angles, in world coordinates.
    pub fn frame(&self) -> [DVec3; 3] {
        let back = (self.eye - self.target).try_normalize().unwrap_or(DVec3::Z);
        let right = self
            .up
            .cross(back)
            .try_normalize()
            .unwrap_or_else(|| back.any_orthonormal_vector());
        [right, back.cross(right), back]
    }
}

impl std::fmt::Display for Camera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (e, t) = (self.eye, self.target);
        write!(f, "{},{},{},{},{},{}", e.x, e.y, e.z, t.x, t.y, t.z)
    }
}

/// Direction from the model to the eye of standard view `index`, not normalized; `None` above 25.
///
/// 0 = +z (front), 1 = +x, 2 = −z, 3 = −x, 4 = +y, 5 = −y, then the 12 edge and the 8 corner directions of {−1, 0, 1}³
/// in lexicographic order of (x, y, z). Model axes, whatever axis is up.
pub fn standard_direction(index: usize) -> Option<DVec3> {
    const FACES: [[i8; 3]; 6] = [
        [0, 0, 1],
        [1, 0, 0],
        [0, 0, -1],
        [-1, 0, 0],
        [0, 1, 0],
        [0, -1, 0],
    ];
    let lexicographic = (0..27i8).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1]);
    let off_axis = |count| move |v: &[i8; 3]| v.iter().filter(|c| **c != 0).count() == count;
    let edges = lexicographic.clone().filter(off_axis(2));
    let corners = lexicographic.filter(off_axis(3));
    let direction = FACES.into_iter().chain(edges).chain(corners).nth(index)?;
    Some(DVec3::from_array(direction.map(f64::from)))
}

/// The up axis of a model, world coordinates.
pub fn up_axis(metadata: &Metadata) -> DVec3 {
    match metadata.up_axis {
        0 => DVec3::X,
        2 => DVec3::Z,
        _ => DVec3::Y,
    }
}

/// What is up in a picture seen along `direction` (unit, target to eye) of a model whose axis `pole` points up.
fn picture_up(direction: DVec3, pole: DVec3) -> DVec3 {
    let along = direction.dot(pole);
    if along.abs() < PARALLEL {
        return pole;
    }
    // From above, the front (+z of a model whose y is up) is at the bottom of the picture.
    if pole == DVec3::Y {
        -DVec3::Z * along.signum()
    } else {
        DVec3::Y
    }
}

/// A sphere around the whole model, world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundingSphere {
    /// Centre of the bounds.
    pub centre: DVec3,
    /// Half the bounds' diagonal; never 0.
    pub radius: f64,
}

impl BoundingSphere {
    /// That of the metadata's bounds; at least one lattice step in radius, so that a single point can be looked at.
    pub fn of(metadata: &Metadata) -> Self {
        let (min, max) = (
            DVec3::from_array(metadata.bounds_min),
            DVec3::from_array(metadata.bounds_max),
        );
        let radius = 0.5 * (max - min).length();
        Self {
            centre: 0.5 * (min + max),
            radius: radius.max(metadata.lattice.step),
        }
    }
}

/// The eye on the lattice: an integer point, subtracted exactly, and the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeEye {
    /// Whole lattice units; clamped to ±2^29, so that differences to lattice points fit an `i32`.
    pub whole: [i32; 3],
    /// What is left, lattice units, 0..1.
    pub fraction: [f64; 3],
}

impl LatticeEye {
    /// Splits `eye` (lattice units).
    fn new(eye: DVec3) -> Self {
        const LIMIT: f64 = (1 << 29) as f64;
        let eye = eye.clamp(DVec3::splat(-LIMIT), DVec3::splat(LIMIT - 1.0));
        let whole = eye.floor();
        let fraction = (eye - whole).to_array();
        #[expect(clippy::cast_possible_truncation, reason = "clamped to ±2^29 above")]
        let whole = whole.to_array().map(|c| c as i32);
        Self { whole, fraction }
    }
}

/// A camera and a viewport, on the lattice: everything the cut and the shaders need to know of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The eye.
    pub eye: LatticeEye,
    /// Clip coordinates of an offset from the eye (lattice units): depth 1 at the near plane, 0 at the far plane.
    pub clip_from_offset: DMat4,
    /// Right, up and back of the picture.
    pub frame: [DVec3; 3],
    eye_lattice: DVec3,
    /// Inward normals of the four side planes, which pass through the eye.
    planes: [DVec3; 4],
    px_per_slope: f64,
    nearest: f64,
    /// Distance of the near plane, lattice units.
    near: f64,
    size_px: DVec2,
}

/// A ray through a place of the picture, lattice coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// The eye.
    pub origin: DVec3,
    /// One unit of depth along the direction of view; not normalized.
    pub direction: DVec3,
    /// Least depth that is drawn.
    pub near: f64,
}

impl View {
    /// The view of `camera` on a picture of `viewport`.
    pub fn new(camera: &Camera, metadata: &Metadata, viewport: Viewport) -> Self {
        let lattice = &metadata.lattice;
        let sphere = BoundingSphere::of(metadata);
        let eye_lattice = lattice_from_world(lattice, camera.eye);
        let radius = sphere.radius / lattice.step;
        let distance = (camera.eye - sphere.centre).length() / lattice.step;
        let frame = camera.frame();
        let [right, up, back] = frame;

        let far = distance + 1.01 * radius;
        let near = (distance - 1.01 * radius).max(1e-4 * radius);
        let slope_y = (0.5 * FIELD_OF_VIEW).tan();
        let slope_x = slope_y * f64::from(viewport.width) / f64::from(viewport.height);
        let projection = DMat4::from_cols(
            DVec4::new(1.0 / slope_x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 1.0 / slope_y, 0.0, 0.0),
            DVec4::new(0.0, 0.0, near / (far - near), -1.0),
            DVec4::new(0.0, 0.0, near * far / (far - near), 0.0),
        );
        let rotation = DMat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            back.extend(0.0),
            DVec4::W,
        )
        .transpose();
        Self {
            eye: LatticeEye::new(eye_lattice),
            clip_from_offset: projection * rotation,
            frame,
            eye_lattice,
            planes: [
                right - slope_x * back,
                -right - slope_x * back,
                up - slope_y * back,
                -up - slope_y * back,
            ],
            px_per_slope: f64::from(viewport.height) / (2.0 * slope_y),
            nearest: 1e-3 * radius,
            near,
            size_px: DVec2::new(f64::from(viewport.width), f64::from(viewport.height)),
        }
    }

    /// The ray through `position_px`, from the picture's upper left corner; `None` where that is not finite.
    pub fn ray(&self, position_px: DVec2) -> Option<Ray> {
        let [right, up, back] = self.frame;
        let offset = (position_px - 0.5 * self.size_px) / self.px_per_slope;
        let ray = Ray {
            origin: self.eye_lattice,
            direction: right * offset.x - up * offset.y - back,
            near: self.near,
        };
        ray.direction.is_finite().then_some(ray)
    }

    /// Where `point` (lattice coordinates) is in the picture, pixels from the upper left corner, and its depth, lattice
    /// units; `None` for what is not in front of the eye.
    pub fn project(&self, point: DVec3) -> Option<(DVec2, f64)> {
        let [right, up, back] = self.frame;
        let offset = point - self.eye_lattice;
        let depth = -offset.dot(back);
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let slope = DVec2::new(offset.dot(right), -offset.dot(up)) / depth;
        Some((0.5 * self.size_px + slope * self.px_per_slope, depth))
    }

    /// Screen-space error, pixels, of a geometric error (lattice units) somewhere in `bounds`.
    pub fn error_px(&self, error: f32, bounds: &Bounds) -> f64 {
        let (min, max) = corners(bounds);
        let distance = (self.eye_lattice - self.eye_lattice.clamp(min, max)).length();
        f64::from(error) * self.px_per_slope / distance.max(self.nearest)
    }

    /// Whether anything in `bounds` may be in the picture; never false for what is.
    pub fn sees(&self, bounds: &Bounds) -> bool {
        let (min, max) = corners(bounds);
        // One lattice unit of slack covers every rounding between here and the GPU.
        let (low, high) = (min - self.eye_lattice - 1.0, max - self.eye_lattice + 1.0);
        self.planes.iter().all(|plane| {
            let farthest = DVec3::select(plane.cmpge(DVec3::ZERO), high, low);
            plane.dot(farthest) >= 0.0
        })
    }
}

/// World position of lattice coordinates.
pub fn world_from_lattice(lattice: &Lattice, point: DVec3) -> DVec3 {
    DVec3::from_array(lattice.origin) + point * lattice.step
}

/// Lattice coordinates, not rounded, of a world position.
pub fn lattice_from_world(lattice: &Lattice, world: DVec3) -> DVec3 {
    (world - DVec3::from_array(lattice.origin)) / lattice.step
}

fn corners(bounds: &Bounds) -> (DVec3, DVec3) {
    (
        DVec3::from_array(bounds.min.map(f64::from)),
        DVec3::from_array(bounds.max.map(f64::from)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::metadata;

    #[test]
    fn standard_directions_are_26_and_distinct() {
        let all: Vec<_> = (0..STANDARD_VIEWS)
            .map(|n| standard_direction(n).unwrap().to_array())
            .collect();
        for (n, a) in all.iter().enumerate() {
            assert!(!all[..n].contains(a));
        }
        for (index, expected) in [
            (3, DVec3::NEG_X),
            (6, DVec3::new(-1.0, -1.0, 0.0)),
            (17, DVec3::new(1.0, 1.0, 0.0)),
            (18, DVec3::NEG_ONE),
            (25, DVec3::ONE),
        ] {
            assert_eq!(standard_direction(index), Some(expected));
        }
        assert!(standard_direction(26).is_none());
    }

    #[test]
    fn camera_text_round_trips() {
        let metadata = metadata();
        let camera = Camera::standard(&metadata, 20, 1.7).unwrap();
        assert_eq!(
            Camera::parse(&metadata, &camera.to_string()).unwrap(),
            camera
        );
        for bad in [
            "",
            "1,2,3",
            "1,2,3,4,5,6,7",
            "1,2,3,1,2,3",
            "1,2,x,1,2,3",
            "1,2,NaN,1,2,3",
        ] {
            assert!(Camera::parse(&metadata, bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn near_plane_has_depth_one_and_far_plane_zero() {
        let metadata = metadata();
        let camera = Camera::standard(&metadata, 0, 2.5).unwrap();
        let view = View::new(&camera, &metadata, Viewport::new(200, 100));
        let radius = BoundingSphere::of(&metadata).radius / metadata.lattice.step;
        for (distance, depth) in [(1.49, 1.0), (3.51, 0.0)] {
            let clip = view.clip_from_offset * (DVec3::NEG_Z * distance * radius).extend(1.0);
            assert!((clip.z / clip.w - depth).abs() < 1e-9);
        }
    }

    #[test]
    fn rays_pass_through_what_projects_to_their_place() {
        let metadata = metadata();
        let camera = Camera::standard(&metadata, 20, 1.3).unwrap();
        let view = View::new(&camera, &metadata, Viewport::new(300, 100));
        for place in [[0.0, 0.0], [150.0, 50.0], [299.5, 20.25]] {
            let ray = view.ray(DVec2::from_array(place)).unwrap();
            let (back, depth) = view.project(ray.origin + 3e5 * ray.direction).unwrap();
            assert!((back - DVec2::from_array(place)).length() < 1e-6);
            assert!((depth - 3e5).abs() < 1e-4);
            assert!(view.project(ray.origin - ray.direction).is_none());
        }
        assert!(view.ray(DVec2::NAN).is_none());
    }

    #[test]
    fn frustum_keeps_what_projects_into_the_picture() {
        let metadata = metadata();
        let camera = Camera::standard(&metadata, 25, 0.4).unwrap();
        let view = View::new(&camera, &metadata, Viewport::new(300, 100));
        let mut outside = 0;
        for n in 0..4096u32 {
            let point = [n % 16, n / 16 % 16, n / 256].map(|c| c << 17);
            let bounds = Bounds {
                min: point,
                max: point,
            };
            let offset = DVec3::from_array(point.map(f64::from)) - view.eye_lattice;
            let clip = view.clip_from_offset * offset.extend(1.0);
            let inside = clip.w > 0.0 && clip.x.abs() <= clip.w && clip.y.abs() <= clip.w;
            assert!(!inside || view.sees(&bounds));
            outside += usize::from(!view.sees(&bounds));
        }
        assert!(outside > 0);
    }

    #[test]
    fn error_does_not_grow_with_distance_and_is_finite_inside() {
        let metadata = metadata();
        let bounds = Bounds {
            min: [1 << 19; 3],
            max: [3 << 19; 3],
        };
        let mut last = f64::INFINITY;
        for distance in [0.01, 0.5, 1.0, 2.0, 8.0] {
            let camera = Camera::standard(&metadata, 3, distance).unwrap();
            let error =
                View::new(&camera, &metadata, Viewport::new(640, 480)).error_px(3.0, &bounds);
            assert!(error.is_finite() && error <= last);
            last = error;
        }
    }
}
