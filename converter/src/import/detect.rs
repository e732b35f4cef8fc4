//! Which format a file is in.

use super::{off, stl};
use std::fmt;
use std::path::Path;

/// A mesh file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Polygon File Format, ASCII or binary.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// Stereolithography, ASCII or binary.
    Stl,
    /// Object File Format, ASCII.
    Off,
    /// glTF 2.0, binary container.
    Glb,
    /// glTF 2.0, JSON.
    Gltf,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Stl => "STL",
            Self::Off => "OFF",
            Self::Glb => "GLB",
            Self::Gltf => "glTF",
        })
    }
}

/// Content decides; the extension only where the content has no signature.
pub(super) fn detect(bytes: &[u8], path: &Path) -> Option<Format> {
    let text = without_bom(bytes).trim_ascii_start();
    if bytes.starts_with(b"ply") && bytes.get(3).is_some_and(u8::is_ascii_whitespace) {
        return Some(Format::Ply);
    }
    if bytes.starts_with(b"glTF") {
        return Some(Format::Glb);
    }
    if stl::has_binary_length(bytes) {
        return Some(Format::Stl);
    }
    let head = &text[..text.len().min(1 << 16)];
    if head.starts_with(b"{") && contains(head, b"\"asset\"") {
        return Some(Format::Gltf);
    }
    if head
        .get(..5)
        .is_some_and(|h| h.eq_ignore_ascii_case(b"solid"))
    {
        return Some(Format::Stl);
    }
    if off::has_keyword(bytes) {
        return Some(Format::Off);
    }
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("ply") => Some(Format::Ply),
        Some("obj") => Some(Format::Obj),
        Some("stl") => Some(Format::Stl),
        Some("off") => Some(Format::Off),
        Some("glb") => Some(Format::Glb),
        Some("gltf") => Some(Format::Gltf),
        _ => looks_like_obj(head).then_some(Format::Obj),
    }
}

pub(super) fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// What to tell the user about a file that is no mesh.
pub(super) fn describe(bytes: &[u8]) -> String {
    let known: [(&[u8], &str); 9] = [
        (b"\x89PNG", "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"PK\x03\x04", "a ZIP archive"),
        (b"%PDF", "a PDF document"),
        (b"LASF", "a LAS point cloud"),
        (b"ISO-10303", "a STEP or IFC model"),
        (b"Kaydara", "an FBX model"),
        (b"\x28\xb5\x2f\xfd", "zstd data"),
        (b"<", "XML or HTML"),
    ];
    match known.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        Some((_, name)) => format!("it looks like {name}"),
        None => format!(
            "it begins with \"{}\"",
            bytes[..bytes.len().min(16)].escape_ascii()
        ),
    }
}

fn contains(text: &[u8], needle: &[u8]) -> bool {
    text.windows(needle.len()).any(|w| w == needle)
}

/// The first line that is neither empty nor a comment starts with an OBJ statement.
fn looks_like_obj(head: &[u8]) -> bool {
    const STATEMENTS: [&[u8]; 9] = [
        b"v", b"vn", b"vt", b"f", b"o", b"g", b"s", b"mtllib", b"usemtl",
    ];
    head.split(|&b| b == b'\n')
        .map(<[u8]>::trim_ascii)
        .find(|line| !line.is_empty() && !line.starts_with(b"#"))
        .and_then(|line| line.split(u8::is_ascii_whitespace).next())
        .is_some_and(|word| STATEMENTS.contains(&word))
}
