//! What lies below a node: where the texels of its image come from.

use super::super::appearance::Wrap;
use super::super::light::Light;
use super::super::source::weights;
use super::Painted;
use glam::{DVec2, DVec3, Vec2, Vec3};
use marquetry_evaluation::distance::{Bvh, closest_point};
use std::cell::Cell;

/// The children of a node as one surface with colours.
pub(super) struct Below<'a> {
    tree: Bvh,
    /// Child and triangle of every triangle of the tree.
    of: Vec<(usize, usize)>,
    children: &'a [Painted],
}

impl<'a> Below<'a> {
    pub(super) fn new(children: &'a [Painted]) -> Option<Self> {
        let (mut positions, mut triangles, mut of) = (Vec::new(), Vec::new(), Vec::new());
        for (number, child) in children.iter().enumerate() {
            let first = u32::try_from(positions.len()).ok()?;
            positions.extend_from_slice(&child.positions);
            triangles.extend(child.triangles.iter().map(|t| t.map(|v| first + v)));
            of.extend((0..child.triangles.len()).map(|t| (number, t)));
        }
        let tree = Bvh::new(&positions, &triangles).ok()?;
        (!tree.is_empty()).then_some(Self { tree, of, children })
    }

    /// Most texels a lattice unit; 0 where nothing needs an image.
    pub(super) fn finest(&self) -> f64 {
        let scales = self.children.iter().map(|child| {
            let of_image = child.image.as_ref().map(|(_, _, scale)| *scale);
            of_image.unwrap_or(child.scale)
        });
        scales.fold(0.0, f64::max)
    }

    /// Corners of a triangle of the tree, and the child that it is of.
    fn triangle(&self, number: u32) -> Option<(&'a Painted, [u32; 3])> {
        let &(child, triangle) = self.of.get(number as usize)?;
        let child = self.children.get(child)?;
        Some((child, *child.triangles.get(triangle)?))
    }

    /// The triangle nearest to `point`, and the nearest point of it. `found_last` is what was: texels side by side mostly have the
    /// same triangle.
    fn nearest(&self, point: DVec3, found_last: &Cell<Option<u32>>) -> Option<(u32, DVec3)> {
        let last = found_last.get().and_then(|number| {
            let (child, corners) = self.triangle(number)?;
            let corners = corners.map(|v| child.positions[v as usize]);
            Some((number, closest_point(corners, point)))
        });
        let within = last.map_or(f64::INFINITY, |(_, found)| found.distance_squared(point));
        let found = self.tree.closest(point, within);
        let nearest = found.map(|found| (found.triangle, found.point)).or(last);
        found_last.set(nearest.map(|(number, _)| number));
        nearest
    }

    /// The colour nearest to `point`, as a texel of which there are `scale` a unit of length shows it.
    pub(super) fn colour(
        &self,
        point: DVec3,
        scale: f64,
        light: &Light,
        found_last: &Cell<Option<u32>>,
    ) -> Vec3 {
        let nearest = self.nearest(point, found_last);
        let found = nearest.and_then(|(number, found)| Some((self.triangle(number)?, found)));
        let Some(((child, corners), found)) = found else {
            return Vec3::ZERO;
        };
        let weights = weights_within(corners.map(|v| child.positions[v as usize]), found);
        let Some((places, image, own_scale)) = &child.image else {
            let [a, b, c] = corners.map(|v| child.colours[v as usize]);
            return a + (b - a) * weights.x + (c - a) * weights.y;
        };
        let [a, b, c] = corners.map(|v| places[v as usize]);
        let place = a + (b - a) * weights.x + (c - a) * weights.y;
        #[expect(clippy::cast_possible_truncation, reason = "a ratio")]
        let half = (0.25 * own_scale / scale) as f32;
        let around = [[-half, -half], [half, -half], [-half, half], [half, half]];
        around
            .into_iter()
            .map(|offset| image.sample(light, place + Vec2::from_array(offset), [Wrap::Clamp; 2]))
            .sum::<Vec3>()
            / 4.0
    }
}

/// Weights of the second and third corner at a point of a triangle; of a flat one some that are near.
fn weights_within(corners: [DVec3; 3], point: DVec3) -> Vec2 {
    let weights = weights(corners, point);
    if weights.is_finite() {
        let weights = weights.max(DVec2::ZERO);
        return (weights / weights.element_sum().max(1.0)).as_vec2();
    }
    let [a, b, _] = corners;
    let along = (point - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE);
    DVec2::new(along.clamp(0.0, 1.0), 0.0).as_vec2()
}
