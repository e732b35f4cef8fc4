//! Coding of one cluster's mesh.
//!
//! Vertices come in the order in which the triangles use them first, so an index is coded by how far it is behind the
//! number that the next new vertex gets: mostly small, and 0 for a new vertex. Positions, normals and colours are stored
//! against those of the corner before, which shares a triangle with them; so are places on a texture, whose key frame comes
//! last.

use super::{ClusterMesh, ClusterTexture};
#[cfg(not(target_arch = "wasm32"))]
use super::{MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};
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
/// Second byte: planes of the positions less one, whether there is a texture, how its places are packed.
const CODING_RESERVED: u8 = 0b1110_0000;
const CODING_TEXTURED: u8 = 0b0000_0100;
const PLACES_METHOD_SHIFT: u32 = 3;
/// From behind the last of as many vertices as there may be to the first; its code is 0, as a byte has no more.
const BACK_TO_FIRST: usize = 256;

/// How many vertices and triangles a mesh has; bounded by their types in the directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
}

struct Streams<'a> {
    methods: [Method; 4],
    planes: usize,
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
    let triangles = read_triangles(
        &stream(0, triangles.saturating_mul(3))?,
        triangles,
        vertices,
    )?;
    let positions = stream(1, vertices.saturating_mul(streams.planes).saturating_mul(3))?;
    let normals = stream(2, vertices.saturating_mul(2))?;
    let colours = if coding.has_colours { vertices } else { 0 };
    let colours = stream(3, colours.saturating_mul(3))?;
    let texture = streams.texture;
    let mut texture = texture
        .map(|(method, places, frame)| TextureReader::unpack(method, places, vertices, frame))
        .transpose()?;

    let mut mesh = ClusterMesh::default();
    let limit = 1i32 << LATTICE_BITS.saturating_sub(u32::from(coding.shift));
    let mut before: Option<usize> = None;
    for &corner in triangles.as_flattened() {
        let vertex = usize::from(corner);
        if vertex == mesh.positions.len() {
            let code = |component: usize| {
                (0..streams.planes)
                    .zip([0, 8, 16])
                    .fold(0, |code, (plane, shift)| {
                        let index = plane
                            .saturating_mul(3)
                            .saturating_add(component)
                            .saturating_mul(vertices)
                            .saturating_add(vertex);
                        let byte = positions.get(index).copied().unwrap_or_default();
                        code | u32::from(byte) << shift
                    })
            };
            let byte = |stream: &[u8], component: usize| {
                let index = component.saturating_mul(vertices).saturating_add(vertex);
                i32::from(stream.get(index).copied().unwrap_or_default())
            };
            let outside = || Error::Value {
                what: "position of a cluster's vertex",
                found: vertex as u64,
            };
            let shift = u32::from(coding.shift);
            let near = before
                .and_then(|near| mesh.positions.get(near))
                .map_or(Position::default(), |point| {
                    Position(point.map(|c| (c >> shift).cast_signed()))
                });
            let residual = [code(0), code(1), code(2)].map(unzigzag);
            let Position(point) = Position::restore(near, residual).ok_or_else(outside)?;
            if point.iter().any(|&c| c >= limit) {
                return Err(outside());
            }
            mesh.positions
                .push(point.map(|c| c.cast_unsigned() << shift));
            let near = before
                .and_then(|near| mesh.normals.get(near))
                .map_or(Normal::default(), |&normal| Normal(normal));
            let residual = [byte(&normals, 0), byte(&normals, 1), 0];
            let Normal(normal) = Normal::restore(near, residual).ok_or_else(outside)?;
            mesh.normals.push(normal);
            if coding.has_colours {
                let near = before
                    .and_then(|near| mesh.colours.get(near))
                    .map_or(Colour::default(), |&colour| Colour(colour));
                let residual = [byte(&colours, 0), byte(&colours, 1), byte(&colours, 2)];
                let Colour(colour) = Colour::restore(near, residual).ok_or_else(outside)?;
                mesh.colours.push(colour);
            }
            if let Some(texture) = &mut texture {
                texture.read(vertex, before);
            }
        }
        before = Some(vertex);
    }
    mesh.triangles = triangles;
    mesh.texture = texture.map(TextureReader::finish).transpose()?;
    Ok(mesh)
}

/// Reads the places of a texture, vertex by vertex.
struct TextureReader<'a> {
    /// Columns of all vertices, then rows, each against those of the vertex before.
    codes: Vec<u8>,
    vertices: usize,
    places: Vec<[u8; 2]>,
    frame: &'a [u8],
}

impl<'a> TextureReader<'a> {
    fn unpack(
        method: Method,
        body: &[u8],
        vertices: usize,
        frame: &'a [u8],
    ) -> Result<Self, Error> {
        Ok(Self {
            codes: packing::unpack(WHAT, method, body, vertices.saturating_mul(2))?,
            vertices,
            places: Vec::with_capacity(vertices),
            frame,
        })
    }

    /// Reads the place of the next vertex, which is predicted by that of vertex `before`.
    fn read(&mut self, vertex: usize, before: Option<usize>) {
        let near = before.and_then(|near| self.places.get(near)).copied();
        let [column, row] = near.unwrap_or_default();
        let code = |component: usize| {
            let index = component
                .saturating_mul(self.vertices)
                .saturating_add(vertex);
            self.codes.get(index).copied().unwrap_or_default()
        };
        let place = [column.wrapping_add(code(0)), row.wrapping_add(code(1))];
        self.places.push(place);
    }

    fn finish(self) -> Result<ClusterTexture, Error> {
        let texture = ClusterTexture {
            places: self.places,
            frame: self.frame.to_vec(),
        };
        texture.check()?;
        Ok(texture)
    }
}

/// From three planes of codes: how far each corner is behind the next new vertex.
fn read_triangles(codes: &[u8], count: usize, vertices: usize) -> Result<Vec<[u8; 3]>, Error> {
    let refuse = |found: usize| Error::Value {
        what: "corner of a cluster's triangle",
        found: found as u64,
    };
    let mut triangles = vec![[0u8; 3]; count];
    let mut next = 0usize;
    for (index, triangle) in triangles.iter_mut().enumerate() {
        for (plane, corner) in triangle.iter_mut().enumerate() {
            let code = codes
                .get(plane.saturating_mul(count).saturating_add(index))
                .copied()
                .map_or(0, usize::from);
            // After the last vertex that a mesh may have no other is new, so 0 is 256 there.
            let is_first = code == 0 && next == BACK_TO_FIRST;
            let back = if is_first { BACK_TO_FIRST } else { code };
            let vertex = next.checked_sub(back).ok_or_else(|| refuse(code))?;
            if vertex >= vertices {
                return Err(refuse(vertex));
            }
            if back == 0 {
                next = next.saturating_add(1);
            }
            *corner = u8::try_from(vertex).ok().ok_or_else(|| refuse(vertex))?;
        }
        let [a, b, c] = *triangle;
        if a == b || b == c || c == a {
            return Err(refuse(usize::from(a)));
        }
    }
    if next != vertices {
        return Err(Error::Mismatch {
            what: "vertices of a cluster",
            expected: vertices as u64,
            found: next as u64,
        });
    }
    Ok(triangles)
}

/// `mesh` with its vertices in the order in which the triangles use them first; those that none uses are dropped.
///
/// `None` when a triangle names a vertex that does not exist.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn in_order(mesh: &ClusterMesh) -> Option<ClusterMesh> {
    let mut numbers: [Option<u8>; MAX_CLUSTER_VERTICES] = [None; MAX_CLUSTER_VERTICES];
    let mut ordered = ClusterMesh {
        texture: mesh.texture.as_ref().map(|texture| ClusterTexture {
            places: Vec::new(),
            frame: texture.frame.clone(),
        }),
        ..ClusterMesh::default()
    };
    for triangle in &mesh.triangles {
        let mut corners = [0u8; 3];
        for (corner, &vertex) in corners.iter_mut().zip(triangle) {
            let slot = numbers.get_mut(usize::from(vertex))?;
            *corner = if let Some(number) = *slot {
                number
            } else {
                let number = u8::try_from(ordered.positions.len()).ok()?;
                ordered
                    .positions
                    .push(*mesh.positions.get(usize::from(vertex))?);
                ordered
                    .normals
                    .push(*mesh.normals.get(usize::from(vertex))?);
                if !mesh.colours.is_empty() {
                    ordered
                        .colours
                        .push(*mesh.colours.get(usize::from(vertex))?);
                }
                if let (Some(to), Some(from)) = (&mut ordered.texture, &mesh.texture) {
                    to.places.push(*from.places.get(usize::from(vertex))?);
                }
                *slot.insert(number)
            };
        }
        ordered.triangles.push(corners);
    }
    Some(ordered)
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
    let (mut codes, mut positions, mut normals, mut colours) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut places: Vec<[u8; 2]> = Vec::new();
    let mut before: Option<usize> = None;
    for &corner in mesh.triangles.as_flattened() {
        let vertex = usize::from(corner);
        codes.push((positions.len() - vertex) as u8);
        if vertex == positions.len() {
            let units =
                |v: usize| Position(mesh.positions[v].map(|c| (c >> coding.shift).cast_signed()));
            let near = before.map_or(Position::default(), units);
            positions.push(units(vertex).residual(near).map(zigzag));
            let near = before.map_or(Normal::default(), |v| Normal(mesh.normals[v]));
            normals.push(Normal(mesh.normals[vertex]).residual(near));
            if coding.has_colours {
                let near = before.map_or(Colour::default(), |v| Colour(mesh.colours[v]));
                colours.push(Colour(mesh.colours[vertex]).residual(near));
            }
            if let Some(texture) = &mesh.texture {
                let [i, j] = texture.places[vertex];
                let [near_i, near_j] = before.map_or([0; 2], |near| texture.places[near]);
                places.push([i.wrapping_sub(near_i), j.wrapping_sub(near_j)]);
            }
        }
        before = Some(vertex);
    }
    let largest = positions.iter().flatten().copied().max().unwrap_or(0);
    let planes = match largest {
        0..0x100 => 1u8,
        0x100..0x1_0000 => 2,
        _ => 3,
    };
    let mut bodies: [Vec<u8>; 4] = Default::default();
    for corner in 0..3 {
        bodies[0].extend(codes.iter().skip(corner).step_by(3));
    }
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
    let mut coding = planes - 1;
    let mut texture = [Vec::new(), Vec::new()];
    if let Some(ClusterTexture { frame, .. }) = &mesh.texture {
        let [columns, rows] = [0, 1].map(|k: usize| places.iter().map(move |place| place[k]));
        let (method, packed) = packing::pack(&columns.chain(rows).collect::<Vec<u8>>())?;
        coding |= CODING_TEXTURED | (method as u8) << PLACES_METHOD_SHIFT;
        texture = [packed, frame.clone()];
    }
    let mut out = vec![methods, coding];
    let mut lengths: Vec<usize> = bodies[..3].iter().map(Vec::len).collect();
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
        assert_eq!(in_order(&mesh).as_ref(), Some(&mesh));
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
