//! Attributes between vertices: linear, normals of unit length again.

use crate::atlas::patch::Attributes;

/// The attributes between three vertices; `weights` sum to 1.
pub(super) fn within_triangle(corners: [Attributes; 3], weights: [f64; 3]) -> Attributes {
    let mut blend = Attributes::default();
    for (corner, weight) in corners.iter().zip(weights.map(narrow)) {
        blend.normal += corner.normal * weight;
        blend.colour += corner.colour * weight;
    }
    blend.normal = blend.normal.normalize_or_zero();
    blend
}

/// The attributes at fraction `along` of the way between two vertices.
pub(super) fn within_segment(from: Attributes, to: Attributes, along: f64) -> Attributes {
    let along = narrow(along);
    Attributes {
        normal: (from.normal + (to.normal - from.normal) * along).normalize_or_zero(),
        colour: from.colour + (to.colour - from.colour) * along,
        cap: from.cap + (to.cap - from.cap) * along,
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "attributes are f32, rounding is meant"
)]
fn narrow(weight: f64) -> f32 {
    weight as f32
}
