//! glTF 2.0 (Khronos, ISO/IEC 12113:2022), as `.glb` and as `.gltf` with embedded or neighbouring buffers.
//!
//! The triangles of every node of the scene, in world coordinates: transforms (mirroring ones turn the triangles round), lists,
//! strips and fans, with or without indices, sparse accessors, `KHR_mesh_quantization`, vertex colours, base colour factors and
//! textures. Geometry that is
//! compressed or instanced by an extension is refused by name rather than left out.
//!
//! The JSON is parsed by the `gltf` crate; accessors are read here, because its readers know float positions only.
//! Limits: animations, skins and morph targets are ignored; of materials only the base colour is read.

mod accessor;
mod container;
mod material;
mod scene;

use super::Soup;
use crate::error::{Fault, ParseError, Place};
use ::gltf::json::{self, Root};
use std::path::Path;

/// The parsed JSON and the bytes of the buffers.
#[derive(Debug)]
struct Document {
    root: Root,
    buffers: Vec<Vec<u8>>,
    /// Bytes of all buffers: no accessor can have more elements.
    total_bytes: u64,
}

pub(super) fn parse_glb(bytes: &[u8], path: &Path) -> Result<Soup, ParseError> {
    let (text, binary) = container::split(bytes)?;
    let root = json::deserialize::from_slice(text).map_err(|e| bad_json(Place::Byte(20), &e))?;
    read(root, binary, path)
}

pub(super) fn parse_gltf(bytes: &[u8], path: &Path) -> Result<Soup, ParseError> {
    let root = json::deserialize::from_slice(super::detect::without_bom(bytes))
        .map_err(|e| bad_json(Place::Line(e.line() as u64), &e))?;
    read(root, None, path)
}

fn bad_json(place: Place, error: &json::Error) -> ParseError {
    if error.is_eof() {
        return ParseError::truncated(place, "the JSON text is not complete");
    }
    ParseError::syntax(place, format!("the JSON is not glTF 2.0 ({error})"))
}

fn read(root: Root, binary: Option<&[u8]>, path: &Path) -> Result<Soup, ParseError> {
    check_extensions(&root)?;
    let (buffers, referenced_bytes) = container::load_buffers(&root, binary, path)?;
    let total_bytes = buffers.iter().map(|b| b.len() as u64).sum();
    let document = Document {
        root,
        buffers,
        total_bytes,
    };
    let mut soup = scene::read(&document, path)?;
    soup.referenced_bytes += referenced_bytes;
    Ok(soup)
}

/// Extensions that change only how a surface looks may be ignored; of the others, those below are known.
fn check_extensions(root: &Root) -> Result<(), ParseError> {
    const APPEARANCE: [&str; 6] = [
        "KHR_materials_",
        "KHR_texture_",
        "EXT_texture_",
        "MSFT_texture_",
        "KHR_lights_",
        "KHR_xmp",
    ];
    let known = |name: &str| {
        name == "KHR_mesh_quantization" || APPEARANCE.iter().any(|prefix| name.starts_with(prefix))
    };
    // An instanced mesh would be drawn once instead of many times, even where the extension is optional.
    let instanced = root
        .extensions_used
        .iter()
        .find(|n| *n == "EXT_mesh_gpu_instancing");
    let Some(name) = root
        .extensions_required
        .iter()
        .find(|n| !known(n))
        .or(instanced)
    else {
        return Ok(());
    };
    let (what, advice) = match name.as_str() {
        "KHR_draco_mesh_compression" => (
            "Draco compression (KHR_draco_mesh_compression)".to_owned(),
            "decompress it first, for example `gltf-transform copy in.glb out.glb`",
        ),
        "EXT_meshopt_compression" => (
            "meshopt compression (EXT_meshopt_compression)".to_owned(),
            "decompress it first, for example `gltf-transform copy in.glb out.glb`",
        ),
        _ => (format!("the glTF extension {name}"), "export without it"),
    };
    Err(ParseError::at(
        Place::File,
        Fault::Unsupported { what, advice },
    ))
}

/// A fault in what the JSON says, with no better place than its name.
fn fault(cause: impl Into<String>) -> ParseError {
    ParseError::syntax(Place::File, cause)
}

#[cfg(test)]
mod tests;
