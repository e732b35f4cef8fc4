//! Files that a mesh file refers to.

use std::path::{Component, Path, PathBuf};

/// The bytes behind a URI, and whether they came from another file.
pub(super) fn load(uri: &str, path: &Path) -> Result<(Vec<u8>, bool), String> {
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
    if uri.contains("://") {
        return Err("only files beside it are read".to_owned());
    }
    Ok((beside(path, &relative)?, true))
}

/// The bytes of a file at `relative` to the folder of the file at `path`.
pub(super) fn beside(path: &Path, relative: &Path) -> Result<Vec<u8>, String> {
    let inside = relative.components().all(|c| {
        matches!(
            c,
            Component::Normal(_) | Component::CurDir | Component::ParentDir
        )
    });
    if !inside {
        return Err("only files beside it are read".to_owned());
    }
    let file = path.parent().unwrap_or(Path::new("")).join(relative);
    std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))
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
