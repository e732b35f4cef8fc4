//! Chunks of a `.glb` and the bytes of buffers.

use crate::error::{Fault, ParseError, Place};
use ::gltf::json::Root;
use std::path::{Component, Path, PathBuf};

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

/// The bytes behind a URI, and whether they came from another file.
fn load(uri: &str, path: &Path) -> Result<(Vec<u8>, bool), String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data
            .split_once(";base64,")
            .ok_or("a data URI without base64")?;
        return Ok((
            base64(text.as_bytes()).ok_or("the base64 is damaged")?,
            false,
        ));
    }
    let relative = PathBuf::from(percent_decode(uri).ok_or("the percent encoding is damaged")?);
    let inside = relative.components().all(|c| {
        matches!(
            c,
            Component::Normal(_) | Component::CurDir | Component::ParentDir
        )
    });
    if !inside || uri.contains("://") {
        return Err("only files beside it are read".to_owned());
    }
    let file = path.parent().unwrap_or(Path::new("")).join(relative);
    let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    Ok((bytes, true))
}

fn percent_decode(uri: &str) -> Option<String> {
    let mut out = Vec::new();
    let mut bytes = uri.bytes();
    while let Some(b) = bytes.next() {
        if b == b'%' {
            let hex = [bytes.next()?, bytes.next()?];
            out.push(u8::from_str_radix(std::str::from_utf8(&hex).ok()?, 16).ok()?);
        } else {
            out.push(b);
        }
    }
    String::from_utf8(out).ok()
}

/// RFC 4648 section 4 and 5 alphabets, padding optional.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    for &b in text.trim_ascii_end() {
        let six = match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => break,
            _ => return None,
        };
        bits = (bits << 6 | u32::from(six)) & 0xff_ffff;
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held & 0xff).to_le_bytes()[0]);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_has_the_vectors_of_the_standard() {
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes.as_bytes()));
        }
        assert_eq!(base64(b"Zm 9v"), None);
    }

    #[test]
    fn files_elsewhere_are_not_read() {
        for uri in [
            "/etc/hostname",
            "http://localhost/a.bin",
            "file:///etc/hostname",
            "%2Fetc/hostname",
            "%zz",
        ] {
            assert!(load(uri, Path::new("a.gltf")).is_err(), "{uri}");
        }
    }
}
