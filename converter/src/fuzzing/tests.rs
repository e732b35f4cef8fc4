//! Mutated small meshes, always the same ones; `MARQUETRY_FUZZ_SECONDS` goes on with others for so long.

use super::*;
use std::fmt::Write;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Longest that one input may take, on a machine that does other things too.
const HANG: Duration = Duration::from_mins(1);

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next() % n.max(1) as u64).unwrap()
    }
}

type Model = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// A bent sheet with a hole, a fin on it, and a tetrahedron beside it.
fn model() -> Model {
    let mut positions = Vec::new();
    let n = 7_u8;
    for j in 0..n {
        for i in 0..n {
            let (x, y) = (f32::from(i), f32::from(j));
            positions.push([x, y, 0.1 * (x - 2.0) * (y - 3.0)]);
        }
    }
    let mut triangles = Vec::new();
    let at = |i: u8, j: u8| u32::from(i) + u32::from(j) * u32::from(n);
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            if (i, j) != (3, 3) {
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    let first = u32::try_from(positions.len()).unwrap();
    positions.extend([
        [1.5, 1.0, 2.0],
        [9.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [9.0, 1.0, 0.0],
        [9.0, 0.0, 1.5],
    ]);
    triangles.push([at(1, 1), at(2, 1), first]);
    for [a, b, c] in [[1, 3, 2], [1, 2, 4], [2, 3, 4], [3, 1, 4]] {
        triangles.push([first + a, first + b, first + c]);
    }
    (positions, triangles)
}

fn obj((positions, triangles): &Model) -> Vec<u8> {
    let mut text = String::from("# mesh\nmtllib none.mtl\no thing\n");
    for (i, [x, y, z]) in positions.iter().enumerate() {
        let colour = if i % 2 == 0 { " 0.5 1 0" } else { "" };
        writeln!(text, "v {x} {y} {z}{colour}\nvt 0.5 0.25").unwrap();
    }
    for (i, t) in triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| v + 1);
        match i % 3 {
            0 => writeln!(text, "f {a} {b} {c}").unwrap(),
            1 => writeln!(text, "f {a}/1 {b}/2 \\\n {c}/3").unwrap(),
            _ => writeln!(
                text,
                "f {}//1 {b}//1 {c}//1",
                i64::from(a) - 1 - i64::try_from(positions.len()).unwrap()
            )
            .unwrap(),
        }
    }
    text.into_bytes()
}

fn off((positions, triangles): &Model) -> Vec<u8> {
    let mut text = format!("COFF\n{} {} 0\n", positions.len(), triangles.len());
    for [x, y, z] in positions {
        writeln!(text, "{x} {y} {z} 10 20 30 255").unwrap();
    }
    for [a, b, c] in triangles {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

fn stl_text((positions, triangles): &Model) -> Vec<u8> {
    let mut text = String::from("solid mesh\n");
    for t in triangles {
        text += "facet normal 0 0 1\n outer loop\n";
        for [x, y, z] in t.map(|v| positions[v as usize]) {
            writeln!(text, "  vertex {x:e} {y} {z}").unwrap();
        }
        text += " endloop\nendfacet\n";
    }
    text += "endsolid mesh\n";
    text.into_bytes()
}

fn stl_binary((positions, triangles): &Model) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for t in triangles {
        bytes.extend([0; 12]);
        for p in t.map(|v| positions[v as usize]) {
            bytes.extend(p.iter().flat_map(|x| x.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn ply_text((positions, triangles): &Model) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment x\nelement vertex {}\nproperty float x\nproperty float y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        positions.len(),
        triangles.len()
    );
    for [x, y, z] in positions {
        writeln!(text, "{x} {y} {z} 1 2 3").unwrap();
    }
    for [a, b, c] in triangles {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

fn ply_binary((positions, triangles): &Model, big_endian: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{}_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_index\nproperty short flags\nend_header\n",
        if big_endian { "big" } else { "little" },
        positions.len(),
        triangles.len()
    )
    .into_bytes();
    let mut put = |mut value: Vec<u8>| {
        if big_endian {
            value.reverse();
        }
        bytes.extend(value);
    };
    for x in positions.iter().flatten() {
        put(x.to_le_bytes().to_vec());
    }
    for t in triangles {
        put(vec![3]);
        for i in t {
            put(i.to_le_bytes().to_vec());
        }
        put(vec![7, 0]);
    }
    bytes
}

fn glb((positions, triangles): &Model) -> Vec<u8> {
    let mut data: Vec<u8> = positions
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let indices = data.len();
    data.extend(triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0,"scale":[1,2,1]}},
{{"mesh":0,"translation":[20,0,0],"rotation":[0,0,0,1]}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":{indices}}},{{"buffer":0,"byteOffset":{indices},"byteLength":{}}}],
"buffers":[{{"byteLength":{}}}]}}"#,
        positions.len(),
        3 * triangles.len(),
        data.len() - indices,
        data.len()
    )
    .into_bytes();
    while json.len() % 4 != 0 {
        json.push(b' ');
    }
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    let length = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    bytes.extend(length(12 + 8 + json.len() + 8 + data.len()));
    bytes.extend(length(json.len()));
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend(length(data.len()));
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}

/// Files of every format, with an extension that fits.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let model = model();
    vec![
        ("obj", obj(&model)),
        ("off", off(&model)),
        ("stl", stl_text(&model)),
        ("stl", stl_binary(&model)),
        ("ply", ply_text(&model)),
        ("ply", ply_binary(&model, false)),
        ("ply", ply_binary(&model, true)),
        ("glb", glb(&model)),
    ]
}

/// Changes a few places: bits, bytes, numbers, pieces left out, repeated or moved.
fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    const WORDS: [&[u8]; 16] = [
        b"nan",
        b"-inf",
        b"1e308",
        b"-1e-308",
        b"1e-30",
        b"0",
        b"-1",
        b"4294967295",
        b"99999999999999999999",
        b"4",
        b"\\\n",
        b"\n",
        b"#",
        b"3 0 0 1",
        b" ",
        b"\0",
    ];
    const NUMBERS: [u32; 8] = [
        0,
        1,
        0x7fc0_0000,
        0x7f80_0000,
        u32::MAX,
        0x7f7f_ffff,
        0x0000_0100,
        0x8000_0000,
    ];
    for _ in 0..=random.below(6) {
        let at = random.below(bytes.len());
        let span = 1 + random.below(40);
        let to = (at + span).min(bytes.len());
        match random.below(9) {
            0 => bytes
                .iter_mut()
                .skip(at)
                .take(1)
                .for_each(|b| *b ^= 1 << random.below(8)),
            1 => bytes
                .iter_mut()
                .skip(at)
                .take(1)
                .for_each(|b| *b = random.next().to_le_bytes()[0]),
            2 => {
                let number = NUMBERS[random.below(NUMBERS.len())].to_le_bytes();
                bytes
                    .iter_mut()
                    .skip(at)
                    .zip(number)
                    .for_each(|(b, n)| *b = n);
            }
            3 => {
                // A whole word of a text.
                let start = bytes[..at]
                    .iter()
                    .rposition(u8::is_ascii_whitespace)
                    .map_or(0, |i| i + 1);
                let end = bytes[at..]
                    .iter()
                    .position(u8::is_ascii_whitespace)
                    .map_or(bytes.len(), |i| at + i);
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(start..end.max(start), word.iter().copied());
            }
            4 => {
                bytes.drain(at..to);
            }
            5 => {
                let piece = bytes[at..to].to_vec();
                let there = random.below(bytes.len());
                bytes.splice(there..there, piece);
            }
            6 => {
                // Same length, so that binary records stay in step.
                let piece = bytes[at..to].to_vec();
                let there = random.below(bytes.len());
                bytes
                    .iter_mut()
                    .skip(there)
                    .zip(piece)
                    .for_each(|(b, p)| *b = p);
            }
            7 => bytes.truncate(if random.below(8) == 0 {
                at
            } else {
                bytes.len()
            }),
            _ => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
        }
    }
}

/// Runs `target` on `count` mutants of every seed, and on others as long as the environment asks for.
fn run(count: u64, target: fn(&[u8], &str)) {
    let seconds = std::env::var("MARQUETRY_FUZZ_SECONDS").ok();
    let seconds = seconds.and_then(|s| s.parse().ok()).unwrap_or(0);
    let end = Instant::now() + Duration::from_secs(seconds);
    let running: Mutex<Option<(Instant, &str, Vec<u8>)>> = Mutex::new(None);
    let save = |extension: &str, bytes: &[u8]| {
        let path = std::env::temp_dir().join(format!(
            "marquetry-mutant-{}.{extension}",
            std::process::id()
        ));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    std::thread::scope(|scope| {
        let (done, wait) = std::sync::mpsc::channel::<()>();
        scope.spawn(|| {
            let wait = wait;
            while wait.recv_timeout(Duration::from_secs(1))
                == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
            {
                if let Some((since, extension, bytes)) = &*running.lock().unwrap()
                    && since.elapsed() > HANG
                {
                    eprintln!("hangs: {}", save(extension, bytes).display());
                    std::process::abort();
                }
            }
        });
        let seeds = seeds();
        for round in 0.. {
            if round >= count && Instant::now() >= end {
                break;
            }
            for (s, (extension, seed)) in seeds.iter().enumerate() {
                let mut random = Random(round << 8 | s as u64);
                let mut bytes = seed.clone();
                if round > 0 {
                    mutate(&mut bytes, &mut random);
                }
                *running.lock().unwrap() = Some((Instant::now(), extension, bytes.clone()));
                let result = std::panic::catch_unwind(|| target(&bytes, extension));
                assert!(
                    result.is_ok(),
                    "panics: {}",
                    save(extension, &bytes).display()
                );
            }
        }
        drop(done);
    });
}

#[test]
fn seeds_are_meshes() {
    for (extension, bytes) in seeds() {
        let name = format!("seed.{extension}");
        let (mesh, _) = import_bytes(bytes, Path::new(&name)).unwrap();
        assert!(mesh.triangles.len() >= model().1.len(), "{extension}");
    }
}

#[test]
fn mutants_are_imported_or_refused() {
    run(400, import);
}

#[test]
fn mutants_are_converted_or_refused() {
    run(6, convert);
}
