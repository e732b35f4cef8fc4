//! How likely a cluster's numbers are: what a [`Coder`] writes or reads of a mesh.
//!
//! Writer and reader run the same functions. The writer's are told what there is; those of the reader are told nothing, and find it.
//!
//! A vertex across an edge differs from the parallelogram mostly within the surface, so two components of that come first, and the third, along the axis nearest to
//! the normal of the triangle beside it, is predicted to lie in its plane (Touma & Gotsman, "Triangle mesh compression", 1998).

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "coordinates have 21 bits, and what is added to them 31; indices are below the sizes of the arrays"
)]

use super::morph::UNRANKED;
use super::predict;
use super::twins::Twins;
use super::walk::{self, Prediction};
use crate::Error;
use crate::codec::range::{Bit, Coder, Number};
use crate::codec::sample::{Colour, Normal, Position, Sample};

/// Operations of a walk, and the corners that they ask for.
pub(crate) fn operations(
    coder: &mut impl Coder,
    count: usize,
    told: (&[u8], &[u8]),
) -> (Vec<u8>, Vec<u8>) {
    let mut places = [Number::new(3), Number::new(3)];
    let mut apexes = [[Bit::default(); 4]; 4];
    let mut corners: [Number; 4] = std::array::from_fn(|_| Number::new(4));
    let (mut operations, mut given) = (Vec::with_capacity(count), Vec::new());
    let mut before = 0u8;
    for number in 0..count {
        let told_operation = told.0.get(number).copied().unwrap_or_default();
        let (place, apex) = walk::parts(told_operation);
        let kind = usize::from(before >> walk::APEX_BITS != 0);
        let place = places[kind].unsigned(coder, u32::from(place));
        let place = place.min(u32::from(walk::START));
        let nodes = &mut apexes[usize::from(walk::parts(before).1)];
        let high = coder.bit(&mut nodes[1], apex & 2 != 0);
        let low = coder.bit(&mut nodes[2 | usize::from(high)], apex & 1 != 0);
        let apex = u8::from(high) << 1 | u8::from(low);
        #[expect(clippy::cast_possible_truncation, reason = "at most START, of 6 bits")]
        let operation = (place as u8) << walk::APEX_BITS | apex;
        let numbers = match walk::given_by(operation) {
            0 => &mut [][..],
            1 => &mut corners[3..],
            _ => &mut corners[..3],
        };
        for number in numbers {
            let corner = told.1.get(given.len()).copied().unwrap_or_default();
            let corner = number.unsigned(coder, u32::from(corner));
            given.push(u8::try_from(corner).unwrap_or(u8::MAX));
        }
        operations.push(operation);
        before = operation;
    }
    (operations, given)
}

/// Positions, below `limit`, and which of them are those of `twins`.
pub(crate) fn positions(
    coder: &mut impl Coder,
    predictions: &[Prediction],
    limit: i32,
    twins: &mut Twins,
    told: &[Position],
) -> Result<Vec<Position>, Error> {
    let mut near = Number::new(5);
    let mut within = Number::new(5);
    let mut above = Number::new(5);
    let mut positions: Vec<Position> = Vec::with_capacity(predictions.len());
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let from = predict::position(prediction, &positions);
        let told = told.get(vertex).copied();
        if let Some(twin) = twins.next(coder, prediction, from, &positions, told)? {
            positions.push(twin);
            continue;
        }
        let (Position(from), Position(told)) = (from, told.unwrap_or(from));
        let way = [0, 1, 2].map(|k| told[k] - from[k]);
        let mut found = [0i32; 3];
        if let Some(normal) = predict::plane(prediction, &positions) {
            let [i, j, k] = axes(normal);
            found[i] = within.signed(coder, way[i]);
            found[j] = within.signed(coder, way[j]);
            let level = level(normal, [i, j, k], found);
            found[k] = above
                .signed(coder, way[k].wrapping_sub(level))
                .wrapping_add(level);
        } else {
            for k in 0..3 {
                found[k] = near.signed(coder, way[k]);
            }
        }
        let position = [0, 1, 2].map(|k| from[k].checked_add(found[k]));
        match position {
            [Some(x), Some(y), Some(z)] if [x, y, z].iter().all(|c| (0..limit).contains(c)) => {
                positions.push(Position([x, y, z]));
            }
            _ => {
                return Err(Error::Value {
                    what: "position of a cluster's vertex",
                    found: vertex as u64,
                });
            }
        }
    }
    Ok(positions)
}

/// The axes of a vector, the last the one along which it is longest.
fn axes(normal: [i64; 3]) -> [usize; 3] {
    let [x, y, z] = normal.map(i64::unsigned_abs);
    if x >= y && x >= z {
        [1, 2, 0]
    } else if y >= z {
        [2, 0, 1]
    } else {
        [0, 1, 2]
    }
}

/// How far the plane is along the last axis at a way along the others; rounded down where the normal is positive there, else up.
fn level(normal: [i64; 3], [i, j, k]: [usize; 3], way: [i32; 3]) -> i32 {
    // 30 bits times 31, twice; the quotient has at most one more than the ways.
    let sum = normal[i] * i64::from(way[i]) + normal[j] * i64::from(way[j]);
    i32::try_from((-sum).div_euclid(normal[k])).unwrap_or_default()
}

/// Normals, of which `predicted` is known. Those of `twins` are mostly alike.
pub(crate) fn normals(
    coder: &mut impl Coder,
    predicted: &[[u8; 2]],
    twins: &Twins,
    told: &[[u8; 2]],
) -> Vec<[u8; 2]> {
    let mut number = Number::new(4);
    let mut is_alike = Bit::default();
    let mut normals: Vec<[u8; 2]> = Vec::with_capacity(predicted.len());
    for (vertex, &predicted) in predicted.iter().enumerate() {
        let told = told.get(vertex).copied().unwrap_or(predicted);
        if let Some(twin) = twins.of(vertex).map(|first| normals[first])
            && coder.bit(&mut is_alike, told == twin)
        {
            normals.push(twin);
            continue;
        }
        let [u, v, _] = Normal::new(told).residual(predicted);
        let [u, v] = [u, v].map(|code| byte(&mut number, coder, code));
        let restored = Normal::restore(predicted, [u, v, 0]);
        normals.push(restored.map_or(predicted, Normal::code));
    }
    normals
}

/// Colours. Those of `twins` are mostly alike.
pub(crate) fn colours(
    coder: &mut impl Coder,
    predictions: &[Prediction],
    twins: &Twins,
    told: &[[u8; 3]],
) -> Vec<[u8; 3]> {
    let mut is_alike = Bit::default();
    let mut numbers: [Number; 3] = std::array::from_fn(|_| Number::new(4));
    let mut colours: Vec<[u8; 3]> = Vec::with_capacity(predictions.len());
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let predicted = predict::colour(prediction, &colours);
        let told = told.get(vertex).map_or(predicted, |&colour| Colour(colour));
        if let Some(twin) = twins.of(vertex).map(|first| colours[first])
            && coder.bit(&mut is_alike, told.0 == twin)
        {
            colours.push(twin);
            continue;
        }
        let residual = told.residual(predicted);
        let residual = [0, 1, 2].map(|k| byte(&mut numbers[k], coder, residual[k]));
        let restored = Colour::restore(predicted, residual);
        colours.push(restored.unwrap_or(predicted).0);
    }
    colours
}

/// Places on a texture.
pub(crate) fn places(
    coder: &mut impl Coder,
    predictions: &[Prediction],
    told: &[[u8; 2]],
) -> Vec<[u8; 2]> {
    let mut numbers = [Number::new(4), Number::new(4)];
    let mut places: Vec<[u8; 2]> = Vec::with_capacity(predictions.len());
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let from = predict::place(prediction, &places);
        let told = told.get(vertex).copied().unwrap_or(from);
        places.push([0, 1].map(|k: usize| {
            let code = i32::from(told[k].wrapping_sub(from[k]));
            let code = byte(&mut numbers[k], coder, code);
            from[k].wrapping_add(wrapped(code))
        }));
    }
    places
}

/// Ranks of what `count` vertices become, those of `twins` the same.
pub(crate) fn ranks(coder: &mut impl Coder, count: usize, twins: &Twins, told: &[u8]) -> Vec<u8> {
    let mut numbers = [Number::new(4), Number::new(4)];
    let mut ranks: Vec<u8> = Vec::with_capacity(count);
    let mut before = 0;
    for vertex in 0..count {
        if let Some(first) = twins.of(vertex) {
            ranks.push(ranks[first]);
            continue;
        }
        let told = told.get(vertex).copied().unwrap_or_default();
        let rank = numbers[usize::from(before != 0)].unsigned(coder, u32::from(told));
        before = u8::try_from(rank).unwrap_or(UNRANKED);
        ranks.push(before);
    }
    ranks
}

/// A difference of bytes, 0 to 255, small ones both ways around in few bits.
fn byte(number: &mut Number, coder: &mut impl Coder, told: i32) -> i32 {
    let told = i32::from(wrapped(told).cast_signed());
    i32::from(wrapped(number.signed(coder, told)))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "differences of bytes wrap around"
)]
fn wrapped(code: i32) -> u8 {
    code as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};

    #[test]
    fn a_flat_surface_takes_nothing_along_its_normal() {
        // On 2x + y + 3z = 1080, away from the parallelogram within it.
        let on = |x: i32, y: i32| Position([x, y, (1080 - 2 * x - y) / 3]);
        let told = [on(0, 0), on(300, 0), on(0, 300), on(363, 272)];
        let predictions = [
            Prediction::Nothing,
            Prediction::Near(0),
            Prediction::Near(1),
            Prediction::Across([1, 2, 0]),
        ];
        let normal = predict::plane(predictions[3], &told[..3]).unwrap();
        let ([i, j, k], mut way) = (axes(normal), [0; 3]);
        for axis in [i, j] {
            way[axis] = told[3].0[axis] - predict::position(predictions[3], &told).0[axis];
        }
        let from = predict::position(predictions[3], &told).0[k];
        assert!((level(normal, [i, j, k], way) + from - told[3].0[k]).abs() <= 1);

        let mut encoder = Encoder::new();
        positions(
            &mut encoder,
            &predictions,
            1 << 20,
            &mut Twins::new(false),
            &told,
        )
        .unwrap();
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes);
        assert_eq!(
            positions(
                &mut decoder,
                &predictions,
                1 << 20,
                &mut Twins::new(false),
                &[]
            )
            .unwrap(),
            told
        );
        // The last corner is beyond a smaller lattice.
        let refused = positions(
            &mut Decoder::new(&bytes),
            &predictions,
            363,
            &mut Twins::new(false),
            &[],
        );
        assert!(matches!(refused, Err(Error::Value { found: 3, .. })));
    }

    #[test]
    fn bytes_wrap_around() {
        for (told, from) in [(255u8, 0u8), (0, 255), (128, 0), (7, 7)] {
            let mut encoder = Encoder::new();
            let code = i32::from(told.wrapping_sub(from));
            byte(&mut Number::new(4), &mut encoder, code);
            let bytes = encoder.finish();
            let found = byte(&mut Number::new(4), &mut Decoder::new(&bytes), 0);
            assert_eq!(from.wrapping_add(wrapped(found)), told);
            assert!(bytes.len() <= 3);
        }
    }
}
