//! What users have today: discrete levels of detail by quadric simplification.
//!
//! Garland & Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997, and "Simplifying Surfaces with Color and
//! Texture using Quadric Error Metrics", 1998, by meshoptimizer, which also moves what is left to where it fits best
//! (`simplifyWithUpdate`): the most accurate of the fast simplifiers. Normals, places on textures and colours of vertices are
//! simplified along. Each level is made of the whole mesh, not of the level before, which is slower and better.
//!
//! Bytes are those of one level by itself: positions with 16 bits a coordinate, normals octahedral with 2 × 8, places on
//! textures with 2 × 16, through meshoptimizer's codecs and zstd. Images come on top, as the input has them. Limit: the error
//! is that of the level before its positions are rounded to 16 bits, 4e-6 of the diagonal or so in the level's favour.

use super::split::SplitMesh;
use anyhow::Context;
use glam::{DVec3, Vec2, Vec3};
use marquetry_format::codec::octahedral;
use meshopt::{SimplifyOptions, simplify_with_update};

/// Weight of normals against positions, both relative to the mesh's size.
const NORMAL_WEIGHT: f32 = 0.2;
/// Weight of places on textures and of colours.
const OTHER_WEIGHT: f32 = 0.2;
/// Floats of a vertex besides its position: normal, place, colour.
const ATTRIBUTES: usize = 8;
/// A level that has more triangles than wanted by this factor is made again with fewer scruples.
const FAR_OFF: f64 = 1.2;

/// A level of about `wanted` triangles; more where the simplifier finds no way on.
pub(super) fn simplified(source: &SplitMesh, wanted: usize, frame: &Frame) -> SplitMesh {
    let level = attempt(source, wanted, frame, SimplifyOptions::None);
    if (level.triangles.len() as f64) < FAR_OFF * wanted as f64 {
        return level;
    }
    // Across seams of textures, and without parts that are too small.
    let freely = SimplifyOptions::Permissive | SimplifyOptions::Prune;
    attempt(source, wanted, frame, freely)
}

/// Where a mesh lies: coordinates are taken to 0..=1 along its longest side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    origin: DVec3,
    size: f64,
}

impl Frame {
    /// Around the bounds.
    pub(super) fn new(min: DVec3, max: DVec3) -> Self {
        let size = (max - min).max_element();
        Self {
            origin: min,
            size: if size > 0.0 { size } else { 1.0 },
        }
    }
}

fn attempt(
    source: &SplitMesh,
    wanted: usize,
    frame: &Frame,
    options: SimplifyOptions,
) -> SplitMesh {
    let mut indices = source.triangles.as_flattened().to_vec();
    let mut positions: Vec<[f32; 3]> = source
        .vertices
        .iter()
        .map(|v| {
            ((v.position - frame.origin) / frame.size)
                .as_vec3()
                .to_array()
        })
        .collect();
    let mut attributes: Vec<f32> = source
        .vertices
        .iter()
        .flat_map(|v| {
            let colour = v.colour.map(|byte| f32::from(byte) / 255.0);
            let [nx, ny, nz] = v.normal.to_array();
            [nx, ny, nz, v.uv.x, v.uv.y, colour[0], colour[1], colour[2]]
        })
        .collect();
    let (n, o) = (NORMAL_WEIGHT, OTHER_WEIGHT);
    let count = simplify_with_update(
        &mut indices,
        &mut positions,
        &mut attributes,
        &[n, n, n, o, o, o, o, o],
        ATTRIBUTES * size_of::<f32>(),
        None,
        3 * wanted,
        f32::MAX,
        options,
        None,
    );
    indices.truncate(count);
    let (triangles, _) = indices.as_chunks::<3>();
    let mut level = SplitMesh::default();
    let mut new_numbers = vec![u32::MAX; positions.len()];
    for triangle in triangles {
        level.triangles.push(triangle.map(|old| {
            let old = old as usize;
            if new_numbers[old] == u32::MAX {
                new_numbers[old] = u32::try_from(level.vertices.len()).unwrap_or(u32::MAX);
                let own = &attributes[ATTRIBUTES * old..][..ATTRIBUTES];
                level.materials.push(source.materials[old]);
                let mut vertex = source.vertices[old];
                let place = Vec3::from_array(positions[old]).as_dvec3();
                vertex.position = frame.origin + frame.size * place;
                vertex.normal = Vec3::new(own[0], own[1], own[2]).normalize_or(vertex.normal);
                vertex.uv = Vec2::new(own[3], own[4]);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to a byte"
                )]
                let bytes =
                    [5, 6, 7].map(|k: usize| (255.0 * own[k]).round().clamp(0.0, 255.0) as u8);
                vertex.colour = bytes;
                level.vertices.push(vertex);
            }
            new_numbers[old]
        }));
    }
    level
}

/// As a vertex lies in the buffer that is compressed.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
struct Stored {
    position: [u16; 3],
    normal: [u8; 2],
}

#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
struct StoredPlace {
    uv: [u16; 2],
}

#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
struct StoredColour {
    colour: [u8; 4],
}

/// What a level takes, images aside. `textured` and `coloured`: whether places on textures and colours are stored.
///
/// # Errors
/// When a codec fails.
pub(super) fn stored_bytes(
    level: &SplitMesh,
    frame: &Frame,
    textured: bool,
    coloured: bool,
) -> anyhow::Result<u64> {
    if level.triangles.is_empty() {
        return Ok(0);
    }
    let count = level.vertices.len();
    let indices = meshopt::optimize_vertex_cache(level.triangles.as_flattened(), count);
    let remap = meshopt::optimize_vertex_fetch_remap(&indices, count);
    let indices = meshopt::remap_index_buffer(Some(&indices), count, &remap);
    let mut order = vec![0; count];
    for (old, &new) in remap.iter().enumerate() {
        if let Some(place) = order.get_mut(new as usize) {
            *place = old;
        }
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 16 bits"
    )]
    let sixteen = |value: f64| (value * 65_535.0).round().clamp(0.0, 65_535.0) as u16;
    let ordered = || order.iter().map(|&old| &level.vertices[old]);
    let vertices: Vec<Stored> = ordered()
        .map(|v| Stored {
            position: ((v.position - frame.origin) / frame.size)
                .to_array()
                .map(sixteen),
            normal: octahedral::encode(v.normal.to_array()),
        })
        .collect();
    let mut parts = vec![
        meshopt::encode_index_buffer(&indices, count)?,
        meshopt::encode_vertex_buffer(&vertices)?,
    ];
    if textured {
        let places: Vec<StoredPlace> = ordered()
            .map(|v| StoredPlace {
                uv: v.uv.to_array().map(|c| sixteen(f64::from(c))),
            })
            .collect();
        parts.push(meshopt::encode_vertex_buffer(&places)?);
    }
    if coloured {
        let colours: Vec<StoredColour> = ordered()
            .map(|v| StoredColour {
                colour: [v.colour[0], v.colour[1], v.colour[2], 255],
            })
            .collect();
        parts.push(meshopt::encode_vertex_buffer(&colours)?);
    }
    let packed = parts
        .iter()
        .map(|part| Ok(zstd::bulk::compress(part, 3).context("zstd failed")?.len() as u64));
    packed.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use marquetry_converter::texture::appearance::NO_MATERIAL;
    use marquetry_native::mesh::Vertex;

    /// A wavy square of `cells`² cells.
    fn waves(cells: u32) -> SplitMesh {
        let side = cells + 1;
        let vertices: Vec<Vertex> = (0..side * side)
            .map(|k| {
                let [x, y] = [k % side, k / side].map(|c| f64::from(c) / f64::from(cells));
                Vertex {
                    position: DVec3::new(x, y, 0.05 * (9.0 * x).sin() * (7.0 * y).cos()),
                    normal: Vec3::Z,
                    colour: [255; 3],
                    uv: DVec3::new(x, y, 0.0).as_vec3().truncate(),
                }
            })
            .collect();
        let triangles = (0..cells * cells).flat_map(|k| {
            let a = k / cells * side + k % cells;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        });
        SplitMesh {
            materials: vec![NO_MATERIAL; vertices.len()],
            triangles: triangles.collect(),
            vertices,
        }
    }

    #[test]
    fn levels_have_the_triangles_wanted_and_stay_near() {
        let source = waves(60);
        let frame = Frame::new(DVec3::ZERO, DVec3::ONE);
        let mut last = u64::MAX;
        for wanted in [7_200, 2_000, 300] {
            let level = simplified(&source, wanted, &frame);
            let count = level.triangles.len();
            assert!(
                count <= wanted && 10 * count >= 9 * wanted,
                "{count} of {wanted}"
            );
            for vertex in &level.vertices {
                let DVec3 { x, y, z } = vertex.position;
                assert!((z - 0.05 * (9.0 * x).sin() * (7.0 * y).cos()).abs() < 0.02);
                assert!((vertex.normal.length() - 1.0).abs() < 1e-3);
            }
            let bytes = stored_bytes(&level, &frame, true, true).unwrap();
            let without = stored_bytes(&level, &frame, false, false).unwrap();
            assert!(without < bytes && bytes < last);
            assert!(without < 12 * count as u64);
            last = bytes;
        }
        let empty = SplitMesh::default();
        assert_eq!(stored_bytes(&empty, &frame, true, true).unwrap(), 0);
        assert!(simplified(&empty, 10, &frame).triangles.is_empty());
    }
}
