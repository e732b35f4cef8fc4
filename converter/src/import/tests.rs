use super::*;
use crate::mesh;
use proptest::prelude::*;
use std::io::Write;

const OBJ: &str =
    "v 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nf 1 2 3 4\nf -1//1 1/2/3 2\nf 5 2 3\n";
const OFF: &str =
    "OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n4 0 1 2 3\n3 4 0 1\n3 4 1 2\n";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
                   property uchar green\nproperty uchar blue\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
                   0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0 10 11 12\n4 0 1 2 3\n3 0 1 2\n";
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":[-1,1,2]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":5}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48,"byteStride":12},{"buffer":0,"byteOffset":48,"byteLength":4}],
"buffers":[{"byteLength":52,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAACAPwAAgD8AAAAAAAECAw=="}]}"#;

fn binary_stl() -> Vec<u8> {
    let mut file = vec![b' '; 80];
    file.extend(2_u32.to_le_bytes());
    for corner in [
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    ] {
        file.extend([0; 12]);
        file.extend(corner.iter().flat_map(|x| x.to_le_bytes()));
        file.extend([0; 2]);
    }
    file
}

fn binary_ply() -> Vec<u8> {
    let head = PLY.find("0 0 0 1 2 3").unwrap();
    let mut file = PLY[..head]
        .replace("ascii", "binary_little_endian")
        .into_bytes();
    for (x, y) in [(0.0_f32, 0.0_f32), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        file.extend([x, y, 0.0].iter().flat_map(|c| c.to_le_bytes()));
        file.extend([9, 8, 7]);
    }
    for face in [&[0_i32, 1, 2, 3][..], &[0, 1, 2]] {
        file.push(u8::try_from(face.len()).unwrap());
        file.extend(face.iter().flat_map(|i| i.to_le_bytes()));
    }
    file
}

fn samples() -> Vec<(Format, Vec<u8>)> {
    vec![
        (Format::Obj, OBJ.into()),
        (Format::Off, OFF.into()),
        (Format::Stl, STL.into()),
        (Format::Stl, binary_stl()),
        (Format::Ply, PLY.into()),
        (Format::Ply, binary_ply()),
        (Format::Gltf, GLTF.into()),
    ]
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn content_decides_the_format_whatever_the_name() {
    for (format, bytes) in samples() {
        for name in ["mesh", "mesh.bin", "mesh.jpg"] {
            let (mesh, report) = import_bytes(bytes.clone(), Path::new(name)).unwrap();
            assert_eq!((report.format, report.gzipped), (format, false), "{name}");
            assert_eq!(report.triangles, mesh.triangles.len() as u64);
            let zipped = gzip(&bytes);
            let (same, report) = import_bytes(zipped.clone(), Path::new(name)).unwrap();
            assert_eq!((report.format, report.gzipped), (format, true));
            assert_eq!(report.bytes, zipped.len() as u64);
            assert_eq!(
                (same.positions, same.triangles),
                (mesh.positions, mesh.triangles)
            );
        }
    }
}

#[test]
fn extension_decides_where_content_does_not() {
    let headless = OFF.replace("OFF\n", "");
    let zipped = gzip(headless.as_bytes());
    for (bytes, name) in [
        (headless.clone().into_bytes(), "a.off"),
        (headless.into_bytes(), "a.OFF"),
        (zipped, "a.off.gz"),
    ] {
        assert_eq!(
            import_bytes(bytes, Path::new(name)).unwrap().1.format,
            Format::Off
        );
    }
}

#[test]
fn what_is_no_mesh_is_said_to_be_none() {
    let cases: [(&[u8], &str); 8] = [
        (b"", "empty"),
        (b"\x89PNG\r\n\x1a\n....", "PNG"),
        (b"PK\x03\x04....", "ZIP"),
        (b"<!DOCTYPE html><html>", "HTML"),
        (b"\0\x01\x02", "\\x00\\x01\\x02"),
        (b"\x1f\x8b\x08\0", "gzip"),
        (
            b"v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\n",
            "no triangles (3 vertices, 0 faces)",
        ),
        (
            b"v nan 0 0\nv 1 inf 0\nv 1 1 -nan(ind)\nf 1 2 3\n",
            "none of the 3 vertices",
        ),
    ];
    for (bytes, part) in cases {
        let message = import_bytes(bytes.to_vec(), Path::new("scan.dat"))
            .unwrap_err()
            .to_string();
        assert!(
            message.contains(part) && message.contains("scan.dat"),
            "{message}"
        );
    }
    let gone = import(Path::new("no such folder/no such file.ply")).unwrap_err();
    assert!(matches!(gone, ImportError::Read { .. }));
    assert!(gone.to_string().contains("no such file.ply"));
}

#[test]
fn messages_name_file_place_and_cause() {
    let text = OBJ.replace("f 5 2 3", "f 5 2 6");
    let error = import_bytes(text.into_bytes(), Path::new("scans/a.obj")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "scans/a.obj, line 8: a face refers to vertex 5, but there are 5 vertices (counted from 0); export the file again"
    );
}

#[test]
fn gzip_bombs_are_stopped() {
    let bomb = gzip(&vec![b'\n'; 100 << 20]);
    assert!(expansion_limit(bomb.len() as u64) < 100 << 20);
    let message = import_bytes(bomb, Path::new("a.obj.gz"))
        .unwrap_err()
        .to_string();
    assert!(message.contains("more than"), "{message}");
}

#[test]
fn faces_without_area_are_counted() {
    let text = format!("{OBJ}f 1 2\nf 1\nf 1 2 1 2\nf 1 1 2\n");
    let (mesh, report) = import_bytes(text.into_bytes(), Path::new("a.obj")).unwrap();
    assert_eq!(report.faces_without_area, 3);
    // A triangle with a repeated corner is left to the weld, which counts it as degenerate.
    assert_eq!(mesh.triangles.len(), 5);
}

#[derive(Debug, Clone)]
enum Edit {
    Set(usize, u8),
    Remove(usize, usize),
    Repeat(usize, usize),
    Cut(usize),
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = 0..2048_usize;
    prop_oneof![
        6 => (at.clone(), prop_oneof![any::<u8>(), (b' '..=b'~'), Just(b'-'), Just(b'9'), Just(b'\n')]).prop_map(|(i, b)| Edit::Set(i, b)),
        2 => (at.clone(), 1..20_usize).prop_map(|(i, n)| Edit::Remove(i, n)),
        2 => (at.clone(), 1..20_usize).prop_map(|(i, n)| Edit::Repeat(i, n)),
        1 => at.prop_map(Edit::Cut),
    ]
}

fn apply(bytes: &mut Vec<u8>, edit: &Edit) {
    let n = bytes.len().max(1);
    let range = |i: usize, m: usize| {
        let start = (i % n).min(bytes.len());
        start..(start + m).min(bytes.len())
    };
    match *edit {
        Edit::Set(i, b) => {
            if let Some(slot) = bytes.get_mut(i % n) {
                *slot = b;
            }
        }
        Edit::Remove(i, m) => {
            let range = range(i, m);
            bytes.drain(range);
        }
        Edit::Repeat(i, m) => {
            let range = range(i, m);
            let copy = bytes[range.clone()].to_vec();
            bytes.splice(range.start..range.start, copy);
        }
        Edit::Cut(i) => bytes.truncate(i % n),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(800))]

    #[test]
    fn damaged_files_give_an_error_or_a_valid_mesh(
        which in 0..7_usize,
        edits in proptest::collection::vec(edit(), 1..6),
        extension in prop_oneof![Just("ply"), Just("obj"), Just("stl"), Just("off"), Just("gltf"), Just("glb"), Just("x")],
        zipped in any::<bool>(),
    ) {
        let mut bytes = samples().swap_remove(which).1;
        if zipped {
            bytes = gzip(&bytes);
        }
        for edit in &edits {
            apply(&mut bytes, edit);
        }
        let path = format!("mesh.{extension}");
        if let Ok((mesh, report)) = import_bytes(bytes, Path::new(&path)) {
            prop_assert_eq!(report.triangles, mesh.triangles.len() as u64);
            if let Ok((manifold, account)) = mesh::prepare(mesh) {
                prop_assert_eq!(manifold.check(), Ok(()));
                prop_assert_eq!(account.check(), Ok(()));
            }
        }
    }
}
