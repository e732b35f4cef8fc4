//! Payloads of earlier writers, which are still read: byte planes, each packed by itself, of a walk or of corners named one by one.

use super::super::walk::{self, Prediction, Walk};
use super::super::{ClusterMesh, ClusterTexture, predict};
use super::{Counts, WHAT, limit, on_lattice};
use crate::Error;
use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::codec::page::Coding;
use crate::codec::payload::unzigzag;
use crate::codec::sample::{Colour, Normal, Position, Sample};

/// Second byte: planes of the positions less one, whether there is a texture, how its places are packed, whether the triangles
/// are a walk.
const CODING_RESERVED: u8 = 0b1100_0000;
const CODING_WALK: u8 = 0b0010_0000;
const CODING_TEXTURED: u8 = 0b0000_0100;
const PLACES_METHOD_SHIFT: u32 = 3;

/// The parts of a payload.
struct Streams<'a> {
    methods: [Method; 4],
    planes: usize,
    /// Corners of a walk that are given by their numbers; `None` without a walk.
    given: Option<usize>,
    bodies: [&'a [u8]; 4],
    /// How places are packed, these, and the frame.
    texture: Option<(Method, &'a [u8], &'a [u8])>,
}

impl<'a> Streams<'a> {
    fn parse(has_colours: bool, bytes: &'a [u8]) -> Result<Self, Error> {
        let mut cursor = Cursor::new(WHAT, bytes);
        let (methods, coding) = (cursor.u8()?, cursor.u8()?);
        if coding & CODING_RESERVED != 0 {
            return Err(Error::Reserved {
                what: WHAT,
                value: u64::from(coding),
            });
        }
        let planes = usize::from(coding & 3).saturating_add(1);
        if planes > 3 {
            return Err(Error::Value {
                what: WHAT,
                found: planes as u64,
            });
        }
        let code = |shift: u32| Method::from_code(WHAT, methods >> shift & 3);
        let methods = [code(0)?, code(2)?, code(4)?, code(6)?];
        let [.., colours] = methods;
        if !has_colours && colours != Method::Zero {
            return Err(Error::Value {
                what: WHAT,
                found: colours as u64,
            });
        }
        let mut length = || -> Result<usize, Error> {
            Ok(usize::try_from(cursor.leb128()?).unwrap_or(usize::MAX))
        };
        let given = (coding & CODING_WALK != 0).then(&mut length).transpose()?;
        let [triangles, positions, normals] = [length()?, length()?, length()?];
        let is_textured = coding & CODING_TEXTURED != 0;
        let texture_lengths = if is_textured {
            Some([length()?, length()?])
        } else {
            None
        };
        let places_method = Method::from_code(WHAT, coding >> PLACES_METHOD_SHIFT & 3)?;
        if !is_textured && places_method != Method::Zero {
            return Err(Error::Value {
                what: WHAT,
                found: places_method as u64,
            });
        }
        let rest = cursor.rest();
        let mut cursor = Cursor::new(WHAT, rest);
        let first = [
            cursor.take(triangles)?,
            cursor.take(positions)?,
            cursor.take(normals)?,
        ];
        let (colours, texture) = match texture_lengths {
            None => (cursor.rest(), None),
            Some([colours, places]) => (
                cursor.take(colours)?,
                Some((places_method, cursor.take(places)?, cursor.rest())),
            ),
        };
        let [triangles, positions, normals] = first;
        Ok(Self {
            methods,
            planes,
            given,
            bodies: [triangles, positions, normals, colours],
            texture,
        })
    }
}

/// Decodes the mesh stored in `bytes`.
pub(super) fn decode(coding: Coding, counts: Counts, bytes: &[u8]) -> Result<ClusterMesh, Error> {
    let Counts {
        vertices,
        triangles,
    } = counts;
    let streams = Streams::parse(coding.has_colours, bytes)?;
    let stream = |index: usize, length: usize| {
        let parts = streams.methods.get(index).zip(streams.bodies.get(index));
        let (&method, body) = parts.ok_or(Error::Value {
            what: WHAT,
            found: index as u64,
        })?;
        packing::unpack(WHAT, method, body, length)
    };
    let walk = if let Some(given) = streams.given {
        if given > triangles.saturating_mul(3) {
            return Err(Error::Value {
                what: WHAT,
                found: given as u64,
            });
        }
        let codes = stream(0, triangles.saturating_add(given))?;
        let (operations, given) = codes.split_at_checked(triangles).unwrap_or_default();
        walk::read(operations, given, vertices)?
    } else {
        read_corners(
            &stream(0, triangles.saturating_mul(3))?,
            triangles,
            vertices,
        )?
    };
    let positions = stream(1, vertices.saturating_mul(streams.planes).saturating_mul(3))?;
    let positions = read_positions(coding, &positions, streams.planes, &walk.predictions)?;
    let normals = stream(2, vertices.saturating_mul(2))?;
    let faced = (streams.given.is_some()).then(|| predict::normals(&positions, &walk.triangles));
    let normals = read_normals(&normals, &walk.predictions, faced.as_deref())?;
    let coloured = if coding.has_colours { vertices } else { 0 };
    let colours = read_colours(
        &stream(3, coloured.saturating_mul(3))?,
        walk.predictions.get(..coloured).unwrap_or_default(),
    )?;
    let texture = streams.texture.map(|(method, places, frame)| {
        let codes = packing::unpack(WHAT, method, places, vertices.saturating_mul(2))?;
        read_texture(&codes, &walk.predictions, frame)
    });
    Ok(ClusterMesh {
        positions: on_lattice(coding, &positions),
        normals,
        colours,
        triangles: walk.triangles,
        texture: texture.transpose()?,
        ranks: Vec::new(),
    })
}

/// A byte of a plane.
fn byte(codes: &[u8], plane: usize, vertices: usize, vertex: usize) -> u8 {
    let index = plane.saturating_mul(vertices).saturating_add(vertex);
    codes.get(index).copied().unwrap_or_default()
}

fn read_positions(
    coding: Coding,
    codes: &[u8],
    planes: usize,
    predictions: &[Prediction],
) -> Result<Vec<Position>, Error> {
    let vertices = predictions.len();
    let limit = limit(coding);
    let mut positions: Vec<Position> = Vec::with_capacity(vertices);
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let code = |component: usize| {
            (0..planes).zip([0, 8, 16]).fold(0, |code, (plane, shift)| {
                let plane = plane.saturating_mul(3).saturating_add(component);
                code | u32::from(byte(codes, plane, vertices, vertex)) << shift
            })
        };
        let outside = || Error::Value {
            what: "position of a cluster's vertex",
            found: vertex as u64,
        };
        let residual = [code(0), code(1), code(2)].map(unzigzag);
        let near = predict::position(prediction, &positions);
        let position = Position::restore(near, residual).ok_or_else(outside)?;
        if position.0.iter().any(|&c| c >= limit) {
            return Err(outside());
        }
        positions.push(position);
    }
    Ok(positions)
}

/// Normals that are predicted by the triangles (`faced`), or else by vertices before.
fn read_normals(
    codes: &[u8],
    predictions: &[Prediction],
    faced: Option<&[[u8; 2]]>,
) -> Result<Vec<[u8; 2]>, Error> {
    let vertices = predictions.len();
    let mut normals: Vec<[u8; 2]> = Vec::with_capacity(vertices);
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let near = match (faced, prediction) {
            (Some(faced), _) => faced.get(vertex).copied(),
            (None, Prediction::Near(before)) => normals.get(usize::from(before)).copied(),
            (None, _) => None,
        };
        let residual = [0, 1].map(|plane| i32::from(byte(codes, plane, vertices, vertex)));
        let [u, v] = residual;
        let normal = Normal::restore(near.unwrap_or_default(), [u, v, 0]);
        normals.push(normal.ok_or_else(|| wrong("normal", vertex))?.code());
    }
    Ok(normals)
}

fn read_colours(codes: &[u8], predictions: &[Prediction]) -> Result<Vec<[u8; 3]>, Error> {
    let vertices = predictions.len();
    let mut colours: Vec<[u8; 3]> = Vec::with_capacity(vertices);
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let residual = [0, 1, 2].map(|plane| i32::from(byte(codes, plane, vertices, vertex)));
        let colour = Colour::restore(predict::colour(prediction, &colours), residual);
        colours.push(colour.ok_or_else(|| wrong("colour", vertex))?.0);
    }
    Ok(colours)
}

fn wrong(what: &'static str, vertex: usize) -> Error {
    Error::Value {
        what,
        found: vertex as u64,
    }
}

/// A texture, from columns of all vertices, then rows.
fn read_texture(
    codes: &[u8],
    predictions: &[Prediction],
    frame: &[u8],
) -> Result<ClusterTexture, Error> {
    let vertices = predictions.len();
    let mut places: Vec<[u8; 2]> = Vec::with_capacity(vertices);
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let [column, row] = predict::place(prediction, &places);
        places.push([
            column.wrapping_add(byte(codes, 0, vertices, vertex)),
            row.wrapping_add(byte(codes, 1, vertices, vertex)),
        ]);
    }
    let texture = ClusterTexture {
        places,
        frame: frame.to_vec(),
    };
    texture.check()?;
    Ok(texture)
}

/// From three planes of codes: how far each corner is behind the next new vertex. Every vertex is predicted by the corner before it.
fn read_corners(codes: &[u8], count: usize, vertices: usize) -> Result<Walk, Error> {
    let mut walk = Walk::default();
    for index in 0..count {
        let mut before = walk.by_last();
        let mut triangle = [0u8; 3];
        for (plane, corner) in triangle.iter_mut().enumerate() {
            let vertex = walk.vertex(byte(codes, plane, count, index))?;
            *corner = walk.corner(vertex, vertices, before)?;
            before = Prediction::Near(*corner);
        }
        walk.push(triangle)?;
    }
    walk.finish(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: Counts = Counts {
        vertices: 3,
        triangles: 1,
    };
    const CODING: Coding = Coding {
        shift: 0,
        has_colours: false,
    };
    /// Methods, planes and the rest, lengths, then three new corners one by one, all at (0, 0, 0).
    const CORNERS: [u8; 8] = [1, 0, 3, 0, 0, 0, 0, 0];
    /// The same as a walk: an operation that starts, with three corners given.
    const WALK: [u8; 10] = [1, 1 << 5, 3, 4, 0, 0, 63 << 2, 0, 0, 0];

    #[test]
    fn corners_and_walks_are_read() {
        for bytes in [&CORNERS[..], &WALK] {
            let mesh = decode(CODING, COUNTS, bytes).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
            assert_eq!(mesh.positions, [[0; 3]; 3]);
        }
    }

    #[test]
    fn what_no_writer_made_is_refused() {
        let changed = |at: usize, value: u8| {
            let mut bytes = WALK;
            bytes[at] = value;
            decode(CODING, COUNTS, &bytes).unwrap_err()
        };
        assert!(matches!(
            changed(1, 1 << 6),
            Error::Reserved { value: 64, .. }
        ));
        // Four planes; places packed without a texture; colours without colours; a method that is none.
        assert!(matches!(
            changed(1, 1 << 5 | 3),
            Error::Value { found: 4, .. }
        ));
        assert!(matches!(
            changed(1, 1 << 5 | 8),
            Error::Value { found: 1, .. }
        ));
        assert!(matches!(
            changed(0, 1 << 6 | 1),
            Error::Value { found: 1, .. }
        ));
        assert!(matches!(changed(0, 3), Error::Value { found: 3, .. }));
        // More corners than all of a triangle; fewer bytes than codes.
        assert!(matches!(changed(2, 4), Error::Value { found: 4, .. }));
        assert!(matches!(changed(2, 2), Error::TrailingBytes { .. }));
        let short = decode(CODING, COUNTS, &WALK[..9]);
        assert!(matches!(short, Err(Error::Truncated { .. })));
        let long = [&WALK[..], &[0]].concat();
        let long = decode(CODING, COUNTS, &long);
        assert!(matches!(long, Err(Error::TrailingBytes { .. })));
    }
}
