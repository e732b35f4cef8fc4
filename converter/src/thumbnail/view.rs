//! From where the model is seen, and where its points are in the picture.

use super::raster::SAMPLES;
use super::{HEIGHT, WIDTH};
use glam::{DVec2, DVec3, Vec3};
use marquetry_format::LatticePoint;

/// Pixels that stay free on every side.
const MARGIN: f64 = 6.0;

/// Cosine and sine of the angle by which the eye is to the right of the front: 35 degrees. Numbers, as these are equal on every machine.
const AROUND: [f64; 2] = [0.819_152_044_288_991_8, 0.573_576_436_351_046];
/// Cosine and sine of the angle by which the eye is above: 20 degrees.
const ABOVE: [f64; 2] = [0.939_692_620_785_908_4, 0.342_020_143_325_668_7];

/// A view without perspective.
#[derive(Debug)]
pub(super) struct View {
    /// Right, up and towards the eye: unit vectors along the axes of the lattice.
    axes: [DVec3; 3],
    /// Samples for a lattice unit.
    scale: f64,
    /// The middle of the picture along right and up, lattice units.
    middle: DVec2,
}

impl View {
    /// A view in which all `points` are as large as the picture allows.
    pub(super) fn framing(points: impl Iterator<Item = LatticePoint>, up_axis: u8) -> Self {
        let axes = axes(up_axis);
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for point in points {
            let point = lattice(point);
            let place = DVec2::new(point.dot(axes[0]), point.dot(axes[1]));
            (min, max) = (min.min(place), max.max(place));
        }
        if !min.is_finite() {
            (min, max) = (DVec2::ZERO, DVec2::ZERO);
        }
        let free = DVec2::new(f64::from(WIDTH), f64::from(HEIGHT)) - 2.0 * MARGIN;
        // A single point has no size.
        let scale = (free / (max - min).max(DVec2::splat(1e-3))).min_element();
        Self {
            axes,
            scale: scale * SAMPLES as f64,
            middle: 0.5 * (min + max),
        }
    }

    /// Lattice units that a pixel shows.
    pub(super) fn pixel(&self) -> f64 {
        SAMPLES as f64 / self.scale
    }

    /// Where a point is: samples from the left and from the bottom, and how near it is, lattice units.
    pub(super) fn place(&self, point: LatticePoint) -> DVec3 {
        let point = lattice(point);
        let [right, up, back] = self.axes.map(|axis| point.dot(axis));
        let size = DVec2::new(f64::from(WIDTH), f64::from(HEIGHT)) * SAMPLES as f64;
        let place = (DVec2::new(right, up) - self.middle) * self.scale + 0.5 * size;
        place.extend(back)
    }

    /// A direction, to the right, up and towards the eye.
    pub(super) fn direction(&self, direction: [f32; 3]) -> Vec3 {
        let direction = Vec3::from_array(direction).as_dvec3();
        let [right, up, back] = self.axes.map(|axis| direction.dot(axis));
        DVec3::new(right, up, back).as_vec3()
    }
}

fn lattice(point: LatticePoint) -> DVec3 {
    DVec3::from_array(point.map(f64::from))
}

/// Right, up and towards the eye, for a model whose axis `up_axis` points up: 0 x, 1 y, 2 z.
///
/// Its front is +z, but where z is up −y.
fn axes(up_axis: u8) -> [DVec3; 3] {
    let [right, up, front] = match up_axis {
        0 => [DVec3::NEG_Y, DVec3::X, DVec3::Z],
        2 => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        _ => [DVec3::X, DVec3::Y, DVec3::Z],
    };
    let ([cos_a, sin_a], [cos_b, sin_b]) = (AROUND, ABOVE);
    let level = sin_a * right + cos_a * front;
    [
        cos_a * right - sin_a * front,
        cos_b * up - sin_b * level,
        sin_b * up + cos_b * level,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_at_right_angles_and_up_is_up() {
        for up_axis in 0..3 {
            let [right, up, back] = axes(up_axis);
            assert!(right.cross(up).distance(back) < 1e-12, "{up_axis}");
            assert!(right.is_normalized() && up.is_normalized(), "{up_axis}");
            let pole = DVec3::AXES[usize::from(up_axis)];
            assert!(up.dot(pole) > 0.9 && back.dot(pole) > 0.3 && right.dot(pole) == 0.0);
        }
    }

    #[test]
    fn all_points_are_within_the_margin_and_touch_it() {
        let points = [
            [0, 0, 0],
            [900, 20, 3],
            [1 << 20, 7, 1 << 19],
            [5, 1000, 70_000],
        ];
        let view = View::framing(points.into_iter(), 2);
        let size = DVec2::new(f64::from(WIDTH), f64::from(HEIGHT));
        let places = points.map(|point| view.place(point).truncate() / SAMPLES as f64);
        let room = places.map(|p| (p - MARGIN).min(size - MARGIN - p).min_element());
        assert!(room.iter().all(|&room| room > -1e-6), "{room:?}");
        assert!(room.iter().any(|&room| room < 1e-6), "{room:?}");
        let one = View::framing([[7, 7, 7]].into_iter(), 1).place([7, 7, 7]);
        assert_eq!(one.truncate(), 0.5 * SAMPLES as f64 * size);
    }
}
