//! Chunks of a `.glb` and the bytes of buffers.

use crate::error::{Fault, ParseError, Place};
use crate::import::references::load;
use ::gltf::json::Root;
use std::path::Path;

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// The JSON and the binary chunk.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), ParseError> {
    const JSON: u32 = 0x4e4f_534a;
    const BIN: u32 = 0x004e_4942;
    let end = Place::Byte(bytes.len() as u64);
    let header = |cause: String| {
        ParseError::at(
            Place::Byte(4),
            Fault::Header {
                format: "GLB",
                cause,
            },
        )
    };
    let version =
        word(bytes, 4).ok_or_else(|| ParseError::truncated(end, "the GLB header has 12 bytes"))?;
    if version != 2 {
        return Err(header(format!("version {version} instead of 2")));
    }
    let length =
        word(bytes, 8).ok_or_else(|| ParseError::truncated(end, "the GLB header has 12 bytes"))?;
    let file = bytes.get(..length as usize).ok_or_else(|| {
        ParseError::truncated(
            end,
            format!("{length} bytes are announced, {} are there", bytes.len()),
        )
    })?;
    let mut at = 12;
    let mut chunks: [Option<&[u8]>; 2] = [None, None];
    while at + 8 <= file.len() {
        let (Some(size), Some(kind)) = (word(file, at), word(file, at + 4)) else {
            break;
        };
        let start = at + 8;
        let chunk = file
            .get(start..)
            .and_then(|rest| rest.get(..size as usize))
            .ok_or_else(|| {
                ParseError::truncated(
                    Place::Byte(at as u64),
                    format!("a chunk of {size} bytes is announced"),
                )
            })?;
        let slot = match kind {
            JSON => &mut chunks[0],
            BIN => &mut chunks[1],
            _ => &mut None,
        };
        slot.get_or_insert(chunk);
        at = start + chunk.len().next_multiple_of(4);
    }
    let [json, binary] = chunks;
    Ok((
        json.ok_or_else(|| header("it has no JSON chunk".to_owned()))?,
        binary,
    ))
}

/// The bytes of every buffer, and how many of them came from other files.
pub(super) fn load_buffers(
    root: &Root,
    binary: Option<&[u8]>,
    path: &Path,
) -> Result<(Vec<Vec<u8>>, u64), ParseError> {
    let mut referenced = 0;
    let mut buffers = Vec::new();
    for (i, buffer) in root.buffers.iter().enumerate() {
        let bytes = match (&buffer.uri, binary) {
            (None, Some(chunk)) if i == 0 => chunk.to_vec(),
            (None, _) => {
                return Err(super::fault(format!(
                    "buffer {i} has neither a URI nor a binary chunk"
                )));
            }
            (Some(uri), _) => {
                let (bytes, from_file) = load(uri, path).map_err(|cause| {
                    let shown: String = uri.chars().take(80).collect();
                    ParseError::at(Place::File, Fault::Reference { uri: shown, cause })
                })?;
                if from_file {
                    referenced += bytes.len() as u64;
                }
                bytes
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let missing = format!(
                "buffer {i} announces {} bytes and has {}",
                buffer.byte_length.0,
                bytes.len()
            );
            return Err(ParseError::truncated(Place::File, missing));
        }
        buffers.push(bytes);
    }
    Ok((buffers, referenced))
}
