//! Binary glTF 2.0: one node, one mesh, one material.
//!
//! Positions are `f32`, as the format has it; where these would move vertices, they are relative to the
//! centre of the bounds, and the node's translation puts them back. Colours become linear, 16 bits a
//! channel, as the format has it. Axes stay the input's: a model that is z up lies on its back in
//! programs that take every glTF for y up.

use crate::cli::surface::Surface;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::io::{self, Write};

const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Accessors and buffer views, one to one, as they are laid one after the other in the binary chunk.
#[derive(Debug, Default)]
struct Layout {
    accessors: Vec<Value>,
    views: Vec<Value>,
    length: usize,
}

impl Layout {
    /// Adds an accessor of `count` elements, `size` bytes each (a multiple of 4); gives its number.
    fn add(&mut self, mut accessor: Value, count: usize, size: usize, target: u32) -> usize {
        let number = self.accessors.len();
        let length = count * size;
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.length, "byteLength": length, "target": target
        }));
        accessor["bufferView"] = json!(number);
        accessor["count"] = json!(count);
        self.accessors.push(accessor);
        self.length += length;
        number
    }
}

/// Writes `surface`.
pub(in crate::cli) fn write(surface: &Surface, out: &mut dyn Write) -> io::Result<()> {
    let (min, max) = surface.bounds();
    let origin = if surface.fits_f32(DVec3::ZERO) {
        DVec3::ZERO
    } else {
        // Readers take a translation as `f32`, too: one that rounds would move everything.
        (0.5 * (min + max)).as_vec3().as_dvec3()
    };
    let local = |p: DVec3| (p - origin).as_vec3();
    let vertices = surface.positions.len();

    let mut layout = Layout::default();
    let position = json!({
        "componentType": FLOAT, "type": "VEC3",
        "min": local(min).to_array(), "max": local(max).to_array()
    });
    let mut attributes = json!({
        "POSITION": layout.add(position, vertices, 12, ARRAY_BUFFER),
        "NORMAL": layout.add(json!({ "componentType": FLOAT, "type": "VEC3" }), vertices, 12, ARRAY_BUFFER),
    });
    if !surface.colours.is_empty() {
        let colour = json!({ "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4" });
        attributes["COLOR_0"] = json!(layout.add(colour, vertices, 8, ARRAY_BUFFER));
    }
    let index = json!({ "componentType": UNSIGNED_INT, "type": "SCALAR" });
    let indices = layout.add(index, 3 * surface.triangles.len(), 4, ELEMENT_ARRAY_BUFFER);
    let mut node = json!({ "mesh": 0 });
    if origin != DVec3::ZERO {
        node["translation"] = json!(origin.to_array());
    }
    let document = json!({
        "asset": { "version": "2.0", "generator": concat!("marquetry ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [node],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.9 } }],
        "accessors": layout.accessors,
        "bufferViews": layout.views,
        "buffers": [{ "byteLength": layout.length }]
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');

    let word = |length: usize| {
        let length = u32::try_from(length).ok().map(u32::to_le_bytes);
        length.ok_or_else(|| {
            io::Error::other("too large for GLB (4 GiB); export a coarser cut, or PLY")
        })
    };
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&word(12 + 8 + text.len() + 8 + layout.length)?)?;
    out.write_all(&word(text.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&word(layout.length)?)?;
    out.write_all(b"BIN\0")?;
    for position in &surface.positions {
        write_vector(out, local(*position))?;
    }
    for normal in &surface.normals {
        write_vector(out, *normal)?;
    }
    for colour in &surface.colours {
        for channel in colour.map(linear_from_srgb).into_iter().chain([u16::MAX]) {
            out.write_all(&channel.to_le_bytes())?;
        }
    }
    for vertex in surface.triangles.iter().flatten() {
        out.write_all(&vertex.to_le_bytes())?;
    }
    Ok(())
}

fn write_vector(out: &mut dyn Write, vector: Vec3) -> io::Result<()> {
    for coordinate in vector.to_array() {
        out.write_all(&coordinate.to_le_bytes())?;
    }
    Ok(())
}

/// IEC 61966-2-1.
fn linear_from_srgb(channel: u8) -> u16 {
    let c = f64::from(channel) / 255.0;
    let linear = if c <= 0.04045 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0..=65535"
    )]
    let linear = (linear * 65535.0).round() as u16;
    linear
}
