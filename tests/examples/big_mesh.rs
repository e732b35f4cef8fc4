//! Makes a large scan of a smaller one: every triangle in four, some times over, with noise as a scanner has.
//!
//! `cargo run --release -p marquetry-tests --example big_mesh -- INPUT OUTPUT.ply ROUNDS`

use anyhow::{Context, Result, bail};
use glam::Vec3;
use marquetry_converter::mesh::adjacency::{EdgeTable, end, start};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Amplitude over the length of an edge.
const NOISE: f32 = 0.1;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, rounds] = arguments.as_slice() else {
        bail!("wanted: INPUT OUTPUT.ply ROUNDS");
    };
    let rounds: u32 = rounds.parse().context("ROUNDS is a number")?;
    let (imported, _) = marquetry_converter::import::import(Path::new(input))?;
    let (mesh, _) = marquetry_converter::mesh::prepare(imported)?;
    let mut positions: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|position| position.as_vec3())
        .collect();
    let mut triangles = mesh.triangles;
    for _ in 0..rounds {
        triangles = subdivide(&mut positions, &triangles);
    }
    write(Path::new(output), &positions, &triangles)
}

/// Cuts every triangle at the middles of its edges.
fn subdivide(positions: &mut Vec<Vec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let table = EdgeTable::new(triangles, positions.len());
    let mut middle = vec![0; 3 * triangles.len()];
    for edge in table.edges() {
        let id = u32::try_from(positions.len()).unwrap_or(u32::MAX);
        let ends = [start(triangles, edge[0]), end(triangles, edge[0])];
        let [a, b] = ends.map(|v| positions[v as usize]);
        positions.push(a.midpoint(b) + noise(id) * (NOISE * a.distance(b)));
        for &h in edge {
            middle[h as usize] = id;
        }
    }
    let parts = triangles.iter().zip(middle.chunks_exact(3));
    parts
        .flat_map(|(&[a, b, c], m)| {
            let [ab, bc, ca] = [m[0], m[1], m[2]];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        })
        .collect()
}

/// A direction that depends on `id` alone, each coordinate within -1..=1.
fn noise(id: u32) -> Vec3 {
    let mut state = u64::from(id).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut unit = || {
        state = (state ^ state >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let bits = (state >> 40) as u32;
        bits as f32 / 8_388_608.0 - 1.0
    };
    Vec3::new(unit(), unit(), unit())
}

fn write(path: &Path, positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<()> {
    let mut out = BufWriter::new(std::fs::File::create(path)?);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        positions.len(),
        triangles.len()
    )?;
    for p in positions {
        for c in p.to_array() {
            out.write_all(&c.to_le_bytes())?;
        }
    }
    for t in triangles {
        out.write_all(&[3])?;
        for i in t {
            out.write_all(&i.to_le_bytes())?;
        }
    }
    out.flush()?;
    Ok(())
}
