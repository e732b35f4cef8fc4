//! Bad input ends with exit code 1 and a message that names the file and the cause; nothing is written.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_tests::{BOTH_WAYS, Finished, WITH_CHARTS, arguments, data, marquetry, meshes, ply};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Asserts how a refusal looks: the name of the input on standard error, one of `causes` there or (the list of `verify`) on
/// standard output.
fn assert_refused(finished: &Finished, name: &str, causes: &[&str]) {
    let said = &finished.stderr;
    assert!(!finished.panicked(), "{name}: panicked:\n{said}");
    assert_eq!(
        finished.code,
        Some(1),
        "{name}: wrong exit code; it said:\n{said}"
    );
    assert!(
        said.contains(name),
        "{name}: the message does not name the file:\n{said}"
    );
    let lower = format!("{said}{}", finished.stdout).to_lowercase();
    assert!(
        causes.iter().any(|cause| lower.contains(cause)),
        "{name}: none of {causes:?} in:\n{lower}"
    );
}

/// Converts a file of `bytes` and asserts that it is refused and leaves nothing behind.
fn assert_convert_refuses(name: &str, bytes: &[u8], causes: &[&str]) {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join(name);
    std::fs::write(&input, bytes).unwrap();
    assert_convert_refuses_file(&input, causes);
}

fn assert_convert_refuses_file(input: &Path, causes: &[&str]) {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.marq");
    let finished = marquetry(&arguments!["convert", input, "-o", &output]).unwrap();
    assert_refused(
        &finished,
        input.file_name().unwrap().to_str().unwrap(),
        causes,
    );
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert!(left.is_empty(), "{}: left behind {left:?}", input.display());
}

fn torus_ply() -> Vec<u8> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("torus.ply");
    ply::write(&path, &meshes::torus(24, 12)).unwrap();
    std::fs::read(path).unwrap()
}

/// A small valid file, made by the binary with the options `way`.
fn torus_marq(folder: &Path, way: &[&str]) -> PathBuf {
    let input = folder.join("input.ply");
    ply::write(&input, &meshes::torus(160, 80)).unwrap();
    let path = folder.join("torus.marq");
    let mut convert = arguments!["convert", &input, "-o", &path];
    convert.extend(way.iter().map(OsString::from));
    marquetry(&convert).unwrap().succeeded().unwrap();
    path
}

/// `count` places spread over `0..length`, both ends among them.
fn spread(length: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |k| k * (length - 1) / (count - 1))
}

#[test]
fn empty_files_are_refused() {
    for name in [
        "empty.ply",
        "empty.obj",
        "empty.stl",
        "empty.off",
        "empty.glb",
        "empty.ply.gz",
    ] {
        assert_convert_refuses(name, b"", &["empty"]);
    }
}

#[test]
fn files_without_triangles_are_refused() {
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                  end_header\n0 0 0\n";
    assert_convert_refuses("points.ply", points.as_bytes(), &["no triangles"]);
    assert_convert_refuses(
        "points.obj",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        &["no triangles"],
    );
    assert_convert_refuses(
        "none.off",
        b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n",
        &["no triangles"],
    );
    assert_convert_refuses(
        "none.stl",
        b"solid none\nendsolid none\n",
        &["no triangles", "empty"],
    );
}

#[test]
fn files_without_area_are_refused() {
    let point = b"v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n";
    assert_convert_refuses("point.obj", point, &["none of the", "no triangles", "area"]);
}

#[test]
fn files_cut_short_are_refused() {
    let whole = torus_ply();
    for length in spread(whole.len(), 9).skip(1) {
        assert_convert_refuses(
            "short.ply",
            &whole[..length],
            &["early", "cut short", "header", "not a mesh"],
        );
    }
    // Announces two triangles, brings one.
    let mut stl = vec![b' '; 80];
    stl.extend(2_u32.to_le_bytes());
    stl.extend([0; 50]);
    assert_convert_refuses(
        "short.stl",
        &stl,
        &["early", "cut short", "not a mesh", "no triangles"],
    );
    assert_convert_refuses(
        "short.off",
        b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n",
        &["early", "cut short"],
    );
    assert_convert_refuses(
        "short.glb",
        b"glTF\x02\0\0\0\x00\x10\0\0",
        &["early", "cut short", "glb", "gltf"],
    );
    assert_convert_refuses(
        "short.ply.gz",
        &[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 75],
        &["gzip"],
    );
}

#[test]
fn files_that_are_no_mesh_are_refused() {
    let noise: Vec<u8> = (0_u32..4096)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    for name in [
        "noise.ply",
        "noise.obj",
        "noise.stl",
        "noise.off",
        "noise.glb",
        "noise.xyz",
    ] {
        let causes = [
            "not a mesh",
            "header",
            "no triangles",
            "early",
            "damaged",
            "not supported",
            "expected",
        ];
        assert_convert_refuses(name, &noise, &causes);
    }
    assert_convert_refuses(
        "picture.ply",
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
        &["not a mesh", "header"],
    );
    assert_convert_refuses(
        "prose.txt",
        b"It is a truth universally acknowledged.",
        &["not a mesh"],
    );
}

#[test]
fn coordinates_that_are_no_numbers_are_refused() {
    let all = b"v nan nan nan\nv nan 0 0\nv 0 nan 0\nf 1 2 3\n";
    assert_convert_refuses("all.obj", all, &["finite"]);
    let one = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 nan\nf 1 2 3\nf 2 4 3\n";
    assert_convert_refuses("one.obj", one, &["finite"]);
    let infinite = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 inf\nf 1 2 3\nf 2 4 3\n";
    assert_convert_refuses("infinite.obj", infinite, &["finite"]);
    let mut bytes = torus_ply();
    let header = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    bytes[header..header + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_convert_refuses("one.ply", &bytes, &["finite"]);
}

#[test]
fn indices_out_of_range_are_refused() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for face in [
        "f 1 2 4",
        "f 1 2 -4",
        "f 1 2 0",
        "f 1 2 99999999999999999999",
    ] {
        let text = format!("{vertices}{face}\n");
        assert_convert_refuses("index.obj", text.as_bytes(), &["refers to vertex", "index"]);
    }
    assert_convert_refuses(
        "index.off",
        b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
        &["refers to vertex"],
    );
    let mut bytes = torus_ply();
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_convert_refuses("index.ply", &bytes, &["refers to vertex"]);
}

#[test]
fn counts_beyond_the_file_are_refused_without_taking_memory() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n\
                  property float y\nproperty float z\nelement face 4000000000\n\
                  property list uchar int vertex_indices\nend_header\n";
    assert_convert_refuses(
        "huge.ply",
        header.as_bytes(),
        &["early", "cut short", "more than"],
    );
    assert_convert_refuses(
        "huge.off",
        b"OFF\n4000000000 4000000000 0\n",
        &["early", "cut short", "more than"],
    );
}

#[test]
fn files_that_are_not_there_are_named() {
    let folder = TempDir::new().unwrap();
    assert_convert_refuses_file(
        &folder.path().join("missing.ply"),
        &["cannot", "no such file"],
    );
    let missing = folder.path().join("missing.marq");
    for command in ["info", "verify"] {
        let finished = marquetry(&arguments![command, &missing]).unwrap();
        assert_refused(&finished, "missing.marq", &["cannot", "no such file"]);
    }
}

#[test]
fn shared_files_without_geometry_are_refused() {
    for name in ["tm_empty.ply", "tm_empty.stl"] {
        if let Some(input) = data::find(&format!("difficult/{name}")) {
            assert_convert_refuses_file(&input, &["no triangles", "empty"]);
        }
    }
}

#[test]
fn marq_cut_short_is_refused_by_every_command() {
    let folder = TempDir::new().unwrap();
    let short = folder.path().join("short.marq");
    let wholes = BOTH_WAYS.map(|way| std::fs::read(torus_marq(folder.path(), way)).unwrap());
    for (whole, length) in wholes
        .iter()
        .flat_map(|whole| [0, 1, 15, whole.len() / 3, whole.len() - 1].map(|n| (whole, n)))
    {
        std::fs::write(&short, &whole[..length]).unwrap();
        let out = folder.path().join("out.ply");
        for arguments in [
            arguments!["verify", &short],
            arguments!["info", &short],
            arguments!["export", &short, "-o", &out],
            arguments![
                "measure",
                &short,
                "--against",
                folder.path().join("input.ply"),
                "--samples",
                "100"
            ],
        ] {
            let finished = marquetry(&arguments).unwrap();
            assert_refused(
                &finished,
                "short.marq",
                &["short", "bytes", "ends", "empty", "marq"],
            );
        }
        assert!(!out.exists());
    }
}

#[test]
fn every_flipped_bit_is_found() {
    for way in BOTH_WAYS {
        assert_flipped_bits_are_found(way);
    }
}

fn assert_flipped_bits_are_found(way: &[&str]) {
    let folder = TempDir::new().unwrap();
    let path = torus_marq(folder.path(), way);
    let whole = std::fs::read(&path).unwrap();
    let out = folder.path().join("out.ply");
    let export = |path: &Path| marquetry(&arguments!["export", path, "-o", &out]).unwrap();
    export(&path).succeeded().unwrap();
    let exported = std::fs::read(&out).unwrap();
    std::fs::remove_file(&out).unwrap();
    let info = marquetry(&arguments!["info", &path, "--json", "-"]).unwrap();
    let picture = info.json().unwrap()["bytes"]["thumbnail"].as_u64().unwrap();
    let before_picture = whole.len() - usize::try_from(picture).unwrap();
    let flipped = folder.path().join("flipped.marq");
    for (k, place) in spread(whole.len(), 60).enumerate() {
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << (k % 8);
        std::fs::write(&flipped, &bytes).unwrap();
        let finished = marquetry(&arguments!["verify", &flipped]).unwrap();
        assert!(!finished.panicked(), "byte {place}:\n{}", finished.stderr);
        assert_eq!(
            finished.code,
            Some(1),
            "byte {place} of {}: not noticed",
            whole.len()
        );
        if k % 6 == 5 {
            let finished = export(&flipped);
            // The finest mesh takes all pages of charts, but no clusters that others replace, and no picture.
            let is_unread = way != WITH_CHARTS || place >= before_picture;
            if finished.code == Some(0) && is_unread {
                assert!(exported == std::fs::read(&out).unwrap(), "byte {place}");
                std::fs::remove_file(&out).unwrap();
            } else {
                assert_refused(&finished, "flipped.marq", &[""]);
                assert!(!out.exists(), "byte {place}: exported all the same");
            }
        }
    }
}

#[test]
fn other_files_are_no_marq_files() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scan.marq");
    std::fs::write(&path, torus_ply()).unwrap();
    for command in ["info", "verify"] {
        let finished = marquetry(&arguments![command, &path]).unwrap();
        assert_refused(
            &finished,
            "scan.marq",
            &["not a", "magic", "no .marq", "no marq"],
        );
    }
}

#[test]
fn url_that_stops_half_way_is_an_error() {
    let folder = TempDir::new().unwrap();
    let bytes = std::fs::read(torus_marq(folder.path(), &[])).unwrap();
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let url = format!("http://{}/half.marq", listener.local_addr().unwrap());
    // Lives as long as the test's process.
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // The client hangs up when it has had enough.
            let _ = answer_half(stream, &bytes);
        }
    });
    let out = folder.path().join("out.ply");
    for arguments in [
        arguments!["verify", &url],
        arguments!["export", &url, "-o", &out],
    ] {
        let finished = marquetry(&arguments).unwrap();
        assert_refused(
            &finished,
            "half.marq",
            &[
                "ended",
                "closed",
                "short",
                "connection",
                "incomplete",
                "bytes",
            ],
        );
    }
    assert!(!out.exists());
}

/// Answers range requests, but hangs up in the middle of the bytes beyond the file's first half.
fn answer_half(mut stream: TcpStream, bytes: &[u8]) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    loop {
        let (mut range, mut head, mut ranged) = (0..bytes.len(), false, false);
        let mut first = true;
        loop {
            let mut line = String::new();
            if reader.read_line(&mut line)? == 0 {
                return Ok(());
            }
            let line = line.trim_end().to_ascii_lowercase();
            head |= first && line.starts_with("head ");
            first = false;
            if let Some((start, end)) = line
                .strip_prefix("range: bytes=")
                .and_then(|r| r.split_once('-'))
            {
                let start = start.parse().unwrap_or(0).min(bytes.len());
                let end = end
                    .parse()
                    .map_or(bytes.len(), |end: usize| (end + 1).min(bytes.len()));
                range = start..end.max(start);
                ranged = true;
            }
            if line.is_empty() {
                break;
            }
        }
        let partial = if ranged {
            "206 Partial Content"
        } else {
            "200 OK"
        };
        write!(
            stream,
            "HTTP/1.1 {partial}\r\nContent-Length: {}\r\nAccept-Ranges: bytes\r\n",
            range.len()
        )?;
        write!(
            stream,
            "ETag: \"half\"\r\nContent-Range: bytes {}-",
            range.start
        )?;
        write!(
            stream,
            "{}/{}\r\n\r\n",
            range.end.saturating_sub(1),
            bytes.len()
        )?;
        if head {
            continue;
        }
        if range.end > bytes.len() / 2 {
            let middle = range.start + range.len() / 2;
            stream.write_all(&bytes[range.start..middle])?;
            return Ok(());
        }
        stream.write_all(&bytes[range])?;
    }
}

#[test]
fn wrong_usage_is_exit_code_two() {
    for arguments in [
        arguments![],
        arguments!["nonsense"],
        arguments!["convert", "a.ply"],
        arguments!["convert", "a.ply", "-o", "a.marq", "--error-rel", "much"],
        arguments!["convert", "a.ply", "-o", "a.marq", "--charts", "some"],
        arguments!["render", "a.marq", "-o", "a.png", "--view", "26"],
        arguments!["measure", "a.marq"],
    ] {
        let finished = marquetry(&arguments).unwrap();
        assert_eq!(finished.code, Some(2), "{arguments:?}: {}", finished.stderr);
    }
}
