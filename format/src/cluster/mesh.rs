//! Coding of one cluster's mesh.
//!
//! Triangles are told as a walk over the mesh ([`super::walk`]), which numbers the vertices and says what each is predicted by
//! ([`super::predict`]); positions, what they become ([`super::morph`]), normals, colours and places on a texture are stored as what they differ from that, all by one range coder
//! ([`super::model`]). The texture's key frame comes last.

mod packed;

#[cfg(not(target_arch = "wasm32"))]
use super::MAX_CLUSTER_TRIANGLES;
use super::twins::Twins;
use super::{ClusterMesh, ClusterTexture, model, predict, walk};
use crate::Error;
use crate::bytes::Cursor;
use crate::codec::page::Coding;
#[cfg(not(target_arch = "wasm32"))]
use crate::codec::payload::PartBytes;
use crate::codec::range::Decoder;
#[cfg(not(target_arch = "wasm32"))]
use crate::codec::range::Encoder;
use crate::codec::sample::Position;
use crate::lattice::{LATTICE_BITS, LatticePoint};
#[cfg(not(target_arch = "wasm32"))]
use std::collections::HashMap;
#[cfg(not(target_arch = "wasm32"))]
use std::collections::hash_map::Entry;

const WHAT: &str = "cluster";
/// First byte: what no method of the triangles is in [`packed`] ones, and whether there are a texture, ranks, and vertices at the places of others.
const RANGED: u8 = 0b0011;
const TEXTURED: u8 = 0b0100;
const RANKED: u8 = 0b1000;
const TWINNED: u8 = 0b1_0000;

/// How many vertices and triangles a mesh has; bounded by their types in the directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
}

/// Decodes the mesh stored in `bytes`.
pub(crate) fn decode(coding: Coding, counts: Counts, bytes: &[u8]) -> Result<ClusterMesh, Error> {
    let Counts {
        vertices,
        triangles,
    } = counts;
    let mut cursor = Cursor::new(WHAT, bytes);
    let flags = cursor.u8()?;
    if flags & RANGED != RANGED {
        return packed::decode(coding, counts, bytes);
    }
    if flags & !(RANGED | TEXTURED | RANKED | TWINNED) != 0 {
        return Err(Error::Reserved {
            what: WHAT,
            value: u64::from(flags),
        });
    }
    let (coded, frame) = if flags & TEXTURED == 0 {
        (cursor.rest(), None)
    } else {
        let length = usize::try_from(cursor.leb128()?).unwrap_or(usize::MAX);
        (cursor.take(length)?, Some(cursor.rest()))
    };
    let mut coder = Decoder::new(coded);
    let (operations, given) = model::operations(&mut coder, triangles, (&[], &[]));
    let walk = walk::read(&operations, &given, vertices)?;
    let mut twins = Twins::new(flags & TWINNED != 0);
    let positions = model::positions(
        &mut coder,
        &walk.predictions,
        limit(coding),
        &mut twins,
        &[],
    )?;
    let ranks = if flags & RANKED == 0 {
        Vec::new()
    } else {
        model::ranks(&mut coder, vertices, &twins, &[])
    };
    let predicted = predict::normals(&positions, &walk.triangles);
    let normals = model::normals(&mut coder, &predicted, &twins, &[]);
    let colours = if coding.has_colours {
        model::colours(&mut coder, &walk.predictions, &twins, &[])
    } else {
        Vec::new()
    };
    let texture = frame
        .map(|frame| {
            let texture = ClusterTexture {
                places: model::places(&mut coder, &walk.predictions, &[]),
                frame: frame.to_vec(),
            };
            texture.check().map(|()| texture)
        })
        .transpose()?;
    coder.finish(WHAT)?;
    Ok(ClusterMesh {
        positions: on_lattice(coding, &positions),
        normals,
        colours,
        triangles: walk.triangles,
        texture,
        ranks,
    })
}

/// The lattice's side in units.
fn limit(coding: Coding) -> i32 {
    1 << LATTICE_BITS.saturating_sub(u32::from(coding.shift))
}

/// Points at `positions`, in units.
fn on_lattice(coding: Coding, positions: &[Position]) -> Vec<LatticePoint> {
    let point = |point: &Position| point.0.map(|c| c.cast_unsigned() << coding.shift);
    positions.iter().map(point).collect()
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
        ranks: if mesh.ranks.is_empty() {
            Vec::new()
        } else {
            pick(&mesh.ranks, &told.order)?
        },
    })
}

/// Whether vertices are at the places of others, all of which become the same.
#[cfg(not(target_arch = "wasm32"))]
fn has_twins(mesh: &ClusterMesh) -> bool {
    let mut ranks: HashMap<LatticePoint, Option<u8>> = HashMap::new();
    let (mut some, mut are_alike) = (false, true);
    for (vertex, &place) in mesh.positions.iter().enumerate() {
        let rank = mesh.ranks.get(vertex).copied();
        match ranks.entry(place) {
            Entry::Vacant(slot) => {
                slot.insert(rank);
            }
            Entry::Occupied(known) => {
                some = true;
                are_alike &= *known.get() == rank;
            }
        }
    }
    some && are_alike
}

/// Codes a mesh that is [`in_order`] and keeps the rules of the format.
#[cfg(not(target_arch = "wasm32"))]
#[allow(
    clippy::arithmetic_side_effects,
    reason = "no bytes of a file come here, and the caller has checked the mesh"
)]
pub(crate) fn encode(coding: Coding, mesh: &ClusterMesh) -> Result<(Vec<u8>, PartBytes), Error> {
    debug_assert!(mesh.triangles.len() <= MAX_CLUSTER_TRIANGLES);
    let walk::Told {
        operations,
        given,
        walk,
        ..
    } = walk::tell(&mesh.triangles)?;
    debug_assert_eq!(walk.triangles, mesh.triangles);
    let units: Vec<Position> = mesh
        .positions
        .iter()
        .map(|point| Position(point.map(|c| (c >> coding.shift).cast_signed())))
        .collect();
    let mut coder = Encoder::new();
    model::operations(&mut coder, operations.len(), (&operations, &given));
    let has_twins = has_twins(mesh);
    let mut twins = Twins::new(has_twins);
    model::positions(&mut coder, &walk.predictions, i32::MAX, &mut twins, &units)?;
    if !mesh.ranks.is_empty() {
        model::ranks(&mut coder, mesh.positions.len(), &twins, &mesh.ranks);
    }
    let geometry = coder.len();
    let predicted = predict::normals(&units, &mesh.triangles);
    model::normals(&mut coder, &predicted, &twins, &mesh.normals);
    let normals = coder.len() - geometry;
    if coding.has_colours {
        model::colours(&mut coder, &walk.predictions, &twins, &mesh.colours);
    }
    if let Some(texture) = &mesh.texture {
        model::places(&mut coder, &walk.predictions, &texture.places);
    }
    let coded = coder.finish();
    let when = |holds: bool, flag: u8| if holds { flag } else { 0 };
    let mut out = vec![
        RANGED
            | when(mesh.texture.is_some(), TEXTURED)
            | when(!mesh.ranks.is_empty(), RANKED)
            | when(has_twins, TWINNED),
    ];
    if mesh.texture.is_some() {
        let length = u32::try_from(coded.len()).unwrap_or(u32::MAX);
        crate::bytes::push_leb128(&mut out, length);
    }
    out.extend(coded);
    if let Some(texture) = &mesh.texture {
        out.extend(&texture.frame);
    }
    // What the coder still has in hand at the end of a part is the next one's, and the last one's end may be shorter than it was.
    let geometry = (geometry + 1).min(out.len());
    let normals = if coding.has_colours || mesh.texture.is_some() {
        normals.min(out.len() - geometry)
    } else {
        out.len() - geometry
    };
    let parts = PartBytes {
        geometry: geometry as u64,
        normals: normals as u64,
        colours: (out.len() - geometry - normals) as u64,
    };
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
        let rank = prop_oneof![0..4u8, any::<u8>()];
        (
            prop_oneof![Just(0), Just(256)]
                .prop_flat_map(move |count| prop::collection::vec(rank.clone(), count)),
            // Some of few places, where others are as well.
            prop_oneof![Just(1u32 << 11), Just(5)]
                .prop_flat_map(|side| prop::collection::vec([0..side, 0..side, 0..side], 256)),
            prop::collection::vec(any::<([u8; 2], [u8; 3])>(), 256),
            prop::collection::vec(triangle, 1..=256),
        )
            .prop_filter_map(
                "every triangle is flat",
                move |(ranks, positions, shades, triangles)| {
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
                        ranks,
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

    #[test]
    fn what_is_cut_apart_takes_few_bytes_more() {
        // A strip of squares, whole and cut along its middle.
        let strip = |is_cut: bool| {
            let mut mesh = ClusterMesh::default();
            for k in 0..40u32 {
                for (row, is_twin) in [(0, false), (1, false), (1, true), (2, false)] {
                    if is_twin && !is_cut {
                        continue;
                    }
                    let bend = 9 * k * k % 31;
                    mesh.positions
                        .push([100 * k + bend, 100 * row + bend, 7 * bend]);
                    let [u, v] = [40 + 3 * k, 90 + 5 * row].map(|c| u8::try_from(c).unwrap());
                    mesh.normals.push([u, v]);
                    mesh.ranks.push(v / 30);
                }
            }
            let wide = if is_cut { 4 } else { 3 };
            for k in 0..39u8 {
                let a = k * wide;
                for low in [a, a + wide - 2] {
                    let high = low + wide;
                    mesh.triangles.push([low, high, high + 1]);
                    mesh.triangles.push([low, high + 1, low + 1]);
                }
            }
            in_order(&mesh).unwrap()
        };
        let coding = Coding {
            shift: 0,
            has_colours: false,
        };
        let [whole, cut] = [false, true].map(|is_cut| {
            let mesh = strip(is_cut);
            let (bytes, _) = encode(coding, &mesh).unwrap();
            assert_eq!(bytes[0] & TWINNED != 0, is_cut);
            let counts = Counts {
                vertices: mesh.positions.len(),
                triangles: mesh.triangles.len(),
            };
            assert_eq!(decode(coding, counts, &bytes).unwrap(), mesh);
            (bytes.len(), mesh.positions.len())
        });
        assert_eq!((whole.1, cut.1), (120, 160));
        // A byte for each of 40 vertices, which are more than three in ten of the others.
        assert!(cut.0 < whole.0 + 40, "{} {}", cut.0, whole.0);
        // Where twins become different things, which no writer of ours makes, they are told one by one.
        let mut mesh = strip(true);
        let is_twin = |&v: &usize| mesh.positions[..v].contains(&mesh.positions[v]);
        let twin = (0..mesh.positions.len()).find(is_twin).unwrap();
        mesh.ranks[twin] = 77;
        let (bytes, _) = encode(coding, &mesh).unwrap();
        assert_eq!(bytes[0] & TWINNED, 0);
        let counts = Counts {
            vertices: mesh.positions.len(),
            triangles: mesh.triangles.len(),
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
            bytes in prop::collection::vec(prop_oneof![0..8u8, any::<u8>()], 0..400),
            vertices in 3..=256usize, triangles in 1..=256usize
        ) {
            let coding = Coding { shift: 3, has_colours: true };
            let _ = decode(coding, Counts { vertices, triangles }, &bytes);
        }
    }
}
