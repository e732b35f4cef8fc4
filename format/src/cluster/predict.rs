//! What a cluster's vertices are predicted to be, from vertices before them and, for normals, from the triangles.

use super::walk::Prediction;
use crate::codec::sample::{Colour, Position};
use crate::codec::shading::{cross, difference, lowered};
use crate::lattice::LATTICE_BITS;

/// Bits of the components of a plane's normal.
const PLANE_BITS: u32 = 30;

fn of<T: Copy>(values: &[T], vertex: u8) -> Option<T> {
    values.get(usize::from(vertex)).copied()
}

/// The position of a vertex: that of another, or the fourth corner of a parallelogram.
pub(crate) fn position(prediction: Prediction, before: &[Position]) -> Position {
    match prediction {
        Prediction::Nothing => Position::default(),
        Prediction::Near(vertex) => of(before, vertex).unwrap_or_default(),
        Prediction::Across(vertices) => {
            let [a, b, c] = vertices.map(|vertex| of(before, vertex).unwrap_or_default().0);
            // Below 2^21 each.
            let sum = |k: usize| {
                let value = |p: [i32; 3]| p.get(k).copied().unwrap_or_default();
                value(a).saturating_add(value(b)).saturating_sub(value(c))
            };
            Position([sum(0), sum(1), sum(2)].map(|c| c.clamp(0, (1 << LATTICE_BITS) - 1)))
        }
    }
}

/// A vector of at most 30 bits along the normal of the triangle that a vertex lies across from, if it does and that has an area.
pub(crate) fn plane(prediction: Prediction, before: &[Position]) -> Option<[i64; 3]> {
    let Prediction::Across(vertices) = prediction else {
        return None;
    };
    let [a, b, c] = vertices.map(|vertex| of(before, vertex).unwrap_or_default());
    let normal = cross(difference(a, c), difference(b, c));
    let largest = normal.iter().map(|c| c.unsigned_abs()).max().unwrap_or(0);
    let shift = u64::BITS
        .saturating_sub(largest.leading_zeros())
        .saturating_sub(PLANE_BITS);
    (largest != 0).then_some(normal.map(|c| c.checked_shr(shift).unwrap_or_default()))
}

/// The colour of a vertex: that of another, or the mean of an edge's ends.
pub(crate) fn colour(prediction: Prediction, before: &[[u8; 3]]) -> Colour {
    match prediction {
        Prediction::Nothing => Colour::default(),
        Prediction::Near(vertex) => of(before, vertex).map_or(Colour::default(), Colour),
        Prediction::Across([a, b, _]) => {
            let ends = [a, b].map(|vertex| of(before, vertex).unwrap_or_default());
            let [[r, g, b], [p, q, s]] = ends;
            Colour([r.midpoint(p), g.midpoint(q), b.midpoint(s)])
        }
    }
}

/// The place of a vertex on the texture, as its position.
pub(crate) fn place(prediction: Prediction, before: &[[u8; 2]]) -> [u8; 2] {
    match prediction {
        Prediction::Nothing => [0; 2],
        Prediction::Near(vertex) => of(before, vertex).unwrap_or_default(),
        Prediction::Across(vertices) => {
            let [[a, b], [c, d], [e, f]] = vertices.map(|v| of(before, v).unwrap_or_default());
            [
                a.wrapping_add(c).wrapping_sub(e),
                b.wrapping_add(d).wrapping_sub(f),
            ]
        }
    }
}

/// Codes of the normals of the vertices: sums of those of the triangles around them, weighted by area, exact in integers.
pub(crate) fn normals(positions: &[Position], triangles: &[[u8; 3]]) -> Vec<[u8; 2]> {
    let mut sums = vec![[0i64; 3]; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| of(positions, v).unwrap_or_default());
        // 44 bits; sums of 256 of them have 52.
        let normal = cross(difference(b, a), difference(c, a));
        for vertex in triangle {
            if let Some(sum) = sums.get_mut(usize::from(*vertex)) {
                for (sum, part) in sum.iter_mut().zip(normal) {
                    *sum = sum.saturating_add(part);
                }
            }
        }
    }
    sums.into_iter()
        .map(|sum| lowered(sum).unwrap_or_default())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::octahedral;

    #[test]
    fn the_fourth_corner_of_a_parallelogram_is_met() {
        let before = [[0, 0, 5], [10, 0, 5], [4, 8, 5]].map(Position);
        let found = position(Prediction::Across([1, 2, 0]), &before);
        assert_eq!(found.0, [14, 8, 5]);
        // Beyond the lattice there is nothing.
        let found = position(Prediction::Across([0, 0, 1]), &before);
        assert_eq!(found.0, [0, 0, 5]);
    }

    #[test]
    fn normals_of_a_flat_mesh_point_up_at_any_size() {
        for size in [1, 1000, (1 << LATTICE_BITS) - 1] {
            let positions = [[0, 0, 0], [size, 0, 0], [0, size, 0]].map(Position);
            for normal in normals(&positions, &[[0, 1, 2]]) {
                let [x, y, z] = octahedral::decode(normal);
                assert!(z > 0.99 && x.abs() < 0.01 && y.abs() < 0.01);
            }
        }
    }
}
