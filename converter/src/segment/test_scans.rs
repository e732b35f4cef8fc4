//! Readers just good enough for the scans that tests use.

use super::test_meshes::Soup;
use crate::mesh::ManifoldMesh;
use glam::DVec3;
use std::io::Read;
use std::path::PathBuf;

/// Bytes of a file in `../shared/data`, unpacked; where absent says so.
fn data(name: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    let Ok(bytes) = std::fs::read(&path) else {
        eprintln!("ignored: {} is not there", path.display());
        return None;
    };
    if !name.ends_with(".gz") {
        return Some(bytes);
    }
    let mut plain = Vec::new();
    flate2::read::GzDecoder::new(&bytes[..])
        .read_to_end(&mut plain)
        .unwrap();
    Some(plain)
}

fn triangulate(polygon: &[u32], triangles: &mut Vec<[u32; 3]>) {
    triangles.extend(
        polygon
            .windows(2)
            .skip(1)
            .map(|two| [polygon[0], two[0], two[1]]),
    );
}

/// A scan as manifold mesh, or `None` where the data is absent.
pub(super) fn scan(name: &str) -> Option<ManifoldMesh> {
    let bytes = data(name)?;
    let soup = if name.contains(".obj") {
        read_obj(&bytes)
    } else if name.contains(".off") {
        read_off(&bytes)
    } else {
        read_ply(&bytes)
    };
    Some(soup.welded().manifold())
}

fn read_obj(bytes: &[u8]) -> Soup {
    let mut soup = Soup::default();
    for line in std::str::from_utf8(bytes).unwrap().lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let x: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
                soup.positions.push(DVec3::new(x[0], x[1], x[2]));
            }
            Some("f") => {
                let polygon: Vec<u32> = words
                    .map(|word| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1)
                    .collect();
                triangulate(&polygon, &mut soup.triangles);
            }
            _ => {}
        }
    }
    soup
}

fn read_off(bytes: &[u8]) -> Soup {
    let text = std::str::from_utf8(bytes).unwrap();
    let mut numbers = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(str::split_whitespace)
        .filter_map(|word| word.parse::<f64>().ok());
    let mut number = || numbers.next().unwrap();
    let (vertices, faces, _) = (number(), number(), number());
    let mut soup = Soup::default();
    for _ in 0..vertices as usize {
        soup.positions
            .push(DVec3::new(number(), number(), number()));
    }
    for _ in 0..faces as usize {
        let polygon: Vec<u32> = (0..number() as usize).map(|_| number() as u32).collect();
        triangulate(&polygon, &mut soup.triangles);
    }
    soup
}

/// Vertices that start with three floats (all properties of 4 bytes when binary), faces as a byte count and ints.
fn read_ply(bytes: &[u8]) -> Soup {
    let end = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count = |what: &str| -> usize {
        let line = header.lines().find(|line| line.starts_with(what)).unwrap();
        line.split_whitespace().last().unwrap().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let properties = header
        .lines()
        .skip_while(|line| !line.starts_with("element vertex"))
        .skip(1)
        .take_while(|line| line.starts_with("property"))
        .count();
    let mut soup = Soup::default();
    if header.contains("format ascii") {
        let mut words = std::str::from_utf8(&bytes[end..])
            .unwrap()
            .split_whitespace();
        let mut number = || words.next().unwrap().parse::<f64>().unwrap();
        for _ in 0..vertices {
            soup.positions
                .push(DVec3::new(number(), number(), number()));
            for _ in 3..properties {
                number();
            }
        }
        for _ in 0..faces {
            let polygon: Vec<u32> = (0..number() as usize).map(|_| number() as u32).collect();
            triangulate(&polygon, &mut soup.triangles);
        }
        return soup;
    }
    let big = header.contains("big_endian");
    let word = |at: usize| -> u32 {
        let four: [u8; 4] = bytes[at..at + 4].try_into().unwrap();
        if big {
            u32::from_be_bytes(four)
        } else {
            u32::from_le_bytes(four)
        }
    };
    for v in 0..vertices {
        let at = end + v * properties * 4;
        soup.positions.push(DVec3::from_array(
            [0, 4, 8].map(|k| f64::from(f32::from_bits(word(at + k)))),
        ));
    }
    let mut at = end + vertices * properties * 4;
    for _ in 0..faces {
        let corners = usize::from(bytes[at]);
        let polygon: Vec<u32> = (0..corners).map(|k| word(at + 1 + k * 4)).collect();
        triangulate(&polygon, &mut soup.triangles);
        at += 1 + corners * 4;
    }
    soup
}
