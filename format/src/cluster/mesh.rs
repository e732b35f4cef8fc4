//! Coding of one cluster's mesh.
//!
//! Triangles are told as a walk over the mesh ([`super::walk`]), which numbers the vertices and says what each is predicted by
//! ([`super::predict`]); positions, normals, colours and places on a texture are stored as what they differ from that. The texture's key
//! frame comes last. Payloads of earlier writers name all corners, and predict by the corner before.

#[cfg(not(target_arch = "wasm32"))]
use super::MAX_CLUSTER_TRIANGLES;
use super::walk::{self, Prediction, Walk};
use super::{ClusterMesh, ClusterTexture, predict};
use crate::Error;
use crate::bytes::Cursor;
use crate::codec::packing::{self, Method};
use crate::codec::page::Coding;
#[cfg(not(target_arch = "wasm32"))]
use crate::codec::payload::PartBytes;
use crate::codec::payload::unzigzag;
use crate::codec::sample::{Colour, Normal, Position, Sample};
use crate::lattice::LATTICE_BITS;

const WHAT: &str = "cluster";
/// Second byte: planes of the positions less one, whether there is a texture, how its places are packed, whether the triangles
/// are a walk.
const CODING_RESERVED: u8 = 0b1100_0000;
const CODING_WALK: u8 = 0b0010_0000;
const CODING_TEXTURED: u8 = 0b0000_0100;
const PLACES_METHOD_SHIFT: u32 = 3;

/// How many vertices and triangles a mesh has; bounded by their types in the directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
}

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
pub(crate) fn decode(coding: Coding, counts: Counts, bytes: &[u8]) -> Result<ClusterMesh, Error> {
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
    let shift = u32::from(coding.shift);
    Ok(ClusterMesh {
        positions: positions
            .iter()
            .map(|point| point.0.map(|c| c.cast_unsigned() << shift))
            .collect(),
        normals,
        colours,
        triangles: walk.triangles,
        texture: texture.transpose()?,
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
    let limit = 1i32 << LATTICE_BITS.saturating_sub(u32::from(coding.shift));
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
    faced: Option<&[Normal]>,
) -> Result<Vec<[u8; 2]>, Error> {
    let vertices = predictions.len();
    let mut normals: Vec<[u8; 2]> = Vec::with_capacity(vertices);
    for (vertex, &prediction) in predictions.iter().enumerate() {
        let near = match (faced, prediction) {
            (Some(faced), _) => faced.get(vertex).copied(),
            (None, Prediction::Near(before)) => {
                normals.get(usize::from(before)).copied().map(Normal)
            }
            (None, _) => None,
        };
        let residual = [0, 1].map(|plane| i32::from(byte(codes, plane, vertices, vertex)));
        let [u, v] = residual;
        let normal = Normal::restore(near.unwrap_or_default(), [u, v, 0]);
        normals.push(normal.ok_or_else(|| wrong("normal", vertex))?.0);
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

/// `mesh` with its triangles in the order in which they are told, and its vertices in the order in which these use them first; those that none
/// uses are dropped.
///
/// `None` when a triangle names a vertex that does not exist, or one twice.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn in_order(mesh: &ClusterMesh) -> Option<ClusterMesh> {
    fn pick<T: Copy>(values: &[T], order: &[u8]) -> Option<Vec<T>> {
        let value = |&vertex: &u8| values.get(usize::from(vertex)).copied();
        order.iter().map(value).collect()
    }
    let told = walk::tell(&mesh.triangles).ok()?;
    let texture = mesh.texture.as_ref().map(|texture| {
        Some(ClusterTexture {
            places: pick(&texture.places, &told.order)?,
            frame: texture.frame.clone(),
        })
    });
    Some(ClusterMesh {
        positions: pick(&mesh.positions, &told.order)?,
        normals: pick(&mesh.normals, &told.order)?,
        colours: if mesh.colours.is_empty() {
            Vec::new()
        } else {
            pick(&mesh.colours, &told.order)?
        },
        triangles: told.walk.triangles,
        texture: if let Some(texture) = texture {
            Some(texture?)
        } else {
            None
        },
    })
}

/// Codes a mesh that is [`in_order`] and keeps the rules of the format.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "no bytes of a file come here, and the caller has checked the mesh"
)]
pub(crate) fn encode(coding: Coding, mesh: &ClusterMesh) -> Result<(Vec<u8>, PartBytes), Error> {
    use crate::codec::payload::zigzag;
    debug_assert!(mesh.triangles.len() <= MAX_CLUSTER_TRIANGLES);
    let walk::Told {
        operations,
        given,
        walk,
        ..
    } = walk::tell(&mesh.triangles)?;
    debug_assert_eq!(walk.triangles, mesh.triangles);
    let predictions = || walk.predictions.iter().copied().enumerate();
    let units: Vec<Position> = mesh
        .positions
        .iter()
        .map(|point| Position(point.map(|c| (c >> coding.shift).cast_signed())))
        .collect();
    let positions: Vec<[u32; 3]> = predictions()
        .map(|(v, prediction)| {
            let near = predict::position(prediction, &units);
            units[v].residual(near).map(zigzag)
        })
        .collect();
    let normals: Vec<[i32; 3]> = predict::normals(&units, &mesh.triangles)
        .into_iter()
        .zip(&mesh.normals)
        .map(|(near, &normal)| Normal(normal).residual(near))
        .collect();
    let colours: Vec<[i32; 3]> = predictions()
        .take(mesh.colours.len())
        .map(|(v, prediction)| {
            let near = predict::colour(prediction, &mesh.colours);
            Colour(mesh.colours[v]).residual(near)
        })
        .collect();
    let places: Vec<[u8; 2]> = mesh.texture.as_ref().map_or_else(Vec::new, |texture| {
        predictions()
            .map(|(v, prediction)| {
                let [near_i, near_j] = predict::place(prediction, &texture.places);
                let [i, j] = texture.places[v];
                [i.wrapping_sub(near_i), j.wrapping_sub(near_j)]
            })
            .collect()
    });
    let largest = positions.iter().flatten().copied().max().unwrap_or(0);
    let planes = match largest {
        0..0x100 => 1u8,
        0x100..0x1_0000 => 2,
        _ => 3,
    };
    let mut bodies: [Vec<u8>; 4] = Default::default();
    bodies[0].extend(operations);
    bodies[0].extend(&given);
    for plane in 0..planes {
        for component in 0..3 {
            bodies[1].extend(
                positions
                    .iter()
                    .map(|code| (code[component] >> (8 * u32::from(plane))) as u8),
            );
        }
    }
    for (values, body, components) in [(&normals, 2, 2), (&colours, 3, 3)] {
        for component in 0..components {
            bodies[body].extend(values.iter().map(|value: &[i32; 3]| value[component] as u8));
        }
    }
    let mut methods = 0;
    for (index, body) in bodies.iter_mut().enumerate() {
        let (method, packed) = packing::pack(body)?;
        methods |= (method as u8) << (2 * index);
        *body = packed;
    }
    let mut coding = (planes - 1) | CODING_WALK;
    let mut texture = [Vec::new(), Vec::new()];
    if let Some(ClusterTexture { frame, .. }) = &mesh.texture {
        let [columns, rows] = [0, 1].map(|k: usize| places.iter().map(move |place| place[k]));
        let (method, packed) = packing::pack(&columns.chain(rows).collect::<Vec<u8>>())?;
        coding |= CODING_TEXTURED | (method as u8) << PLACES_METHOD_SHIFT;
        texture = [packed, frame.clone()];
    }
    let mut out = vec![methods, coding];
    let mut lengths = vec![given.len()];
    lengths.extend(bodies[..3].iter().map(Vec::len));
    if mesh.texture.is_some() {
        lengths.extend([bodies[3].len(), texture[0].len()]);
    }
    for length in lengths {
        crate::bytes::push_leb128(&mut out, u32::try_from(length).unwrap_or(u32::MAX));
    }
    let [triangles, positions, normals, colours] = bodies;
    let [places, frame] = texture;
    let parts = PartBytes {
        geometry: (out.len() + triangles.len() + positions.len()) as u64,
        normals: normals.len() as u64,
        colours: (colours.len() + places.len() + frame.len()) as u64,
    };
    for body in [triangles, positions, normals, colours, places, frame] {
        out.extend(body);
    }
    Ok((out, parts))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The first bytes of a key frame of 256 × 64 texels, which is all that a mesh looks at.
    const FRAME: [u8; 11] = [0, 0, 0, 0x9d, 0x01, 0x2a, 0, 1, 64, 0, 7];

    fn mesh(has_colours: bool, is_textured: bool) -> impl Strategy<Value = ClusterMesh> {
        let triangle = [any::<u8>(), any::<u8>(), any::<u8>()];
        (
            prop::collection::vec([0..1u32 << 11, 0..1u32 << 11, 0..1u32 << 11], 256),
            prop::collection::vec(any::<([u8; 2], [u8; 3])>(), 256),
            prop::collection::vec(triangle, 1..=256),
        )
            .prop_filter_map(
                "every triangle is flat",
                move |(positions, shades, triangles)| {
                    let triangles: Vec<_> = triangles
                        .into_iter()
                        .filter(|[a, b, c]| a != b && b != c && c != a)
                        .collect();
                    let mesh = ClusterMesh {
                        positions: positions.into_iter().map(|p| p.map(|c| c << 10)).collect(),
                        normals: shades.iter().map(|shade| shade.0).collect(),
                        colours: if has_colours {
                            shades.iter().map(|shade| shade.1).collect()
                        } else {
                            Vec::new()
                        },
                        triangles,
                        texture: is_textured.then(|| ClusterTexture {
                            places: shades.iter().map(|([a, b], _)| [*a, b % 64]).collect(),
                            frame: FRAME.to_vec(),
                        }),
                    };
                    (!mesh.triangles.is_empty())
                        .then(|| in_order(&mesh))
                        .flatten()
                },
            )
    }

    #[test]
    fn the_first_vertex_may_come_after_the_last() {
        let mut triangles: Vec<[u8; 3]> = (0..85).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        triangles.extend([[255, 0, 1], [0, 2, 1]]);
        let mesh = ClusterMesh {
            positions: (0..256u32).map(|k| [k, k * k, 7]).collect(),
            normals: vec![[128; 2]; 256],
            triangles,
            ..ClusterMesh::default()
        };
        let mesh = in_order(&mesh).unwrap();
        assert_eq!(mesh.triangles.last(), Some(&[255, 0, 1]));
        let coding = Coding {
            shift: 0,
            has_colours: false,
        };
        let (bytes, _) = encode(coding, &mesh).unwrap();
        let counts = Counts {
            vertices: 256,
            triangles: 87,
        };
        assert_eq!(decode(coding, counts, &bytes).unwrap(), mesh);
    }

    proptest! {
        #[test]
        fn meshes_survive(
            (mesh, has_colours) in any::<[bool; 2]>().prop_flat_map(|[has, is_textured]| (mesh(has, is_textured), Just(has)))
        ) {
            let coding = Coding { shift: 10, has_colours };
            let (bytes, parts) = encode(coding, &mesh).unwrap();
            prop_assert_eq!(parts.geometry + parts.normals + parts.colours, bytes.len() as u64);
            let counts = Counts { vertices: mesh.positions.len(), triangles: mesh.triangles.len() };
            prop_assert_eq!(decode(coding, counts, &bytes).unwrap(), mesh);
        }

        #[test]
        fn places_beside_the_texture_are_refused(mesh in mesh(false, true), vertex in any::<prop::sample::Index>()) {
            let mut mesh = mesh;
            if let Some(texture) = &mut mesh.texture {
                let at = vertex.index(texture.places.len());
                texture.places[at][1] = 64;
            }
            let coding = Coding { shift: 10, has_colours: false };
            let (bytes, _) = encode(coding, &mesh).unwrap();
            let counts = Counts { vertices: mesh.positions.len(), triangles: mesh.triangles.len() };
            prop_assert!(decode(coding, counts, &bytes).is_err());
        }

        #[test]
        fn any_bytes_decode_or_fail_cleanly(
            bytes in prop::collection::vec(prop_oneof![0..3u8, any::<u8>()], 0..400),
            vertices in 3..=256usize, triangles in 1..=256usize
        ) {
            let coding = Coding { shift: 3, has_colours: true };
            let _ = decode(coding, Counts { vertices, triangles }, &bytes);
        }
    }
}
