//! Import, and what makes a manifold of it, each stage by itself: `cargo bench -p marquetry-converter --bench front_end`.
//!
//! The mesh is a dented torus of 200 000 triangles, unless `MARQUETRY_BENCH_MESH` names a file.

#![allow(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]
#![expect(clippy::unwrap_used, reason = "a bench that cannot go on ends here")]

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use marquetry_converter::import::{import, import_bytes};
use marquetry_converter::mesh::account::{Account, Topology};
use marquetry_converter::mesh::adjacency::EdgeTable;
use marquetry_converter::mesh::{ImportedMesh, decimate, duplicates, manifold, prepare, weld};
use marquetry_evaluation::distance::{self, Bvh};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;

fn mesh() -> ImportedMesh {
    if let Some(path) = std::env::var_os("MARQUETRY_BENCH_MESH") {
        return import(Path::new(&path)).unwrap().0;
    }
    let (around, along) = (500_u32, 200_u32);
    let at = |i: u32, j: u32| i % around + j % along * around;
    let mut mesh = ImportedMesh::default();
    for j in 0..along {
        for i in 0..around {
            let u = TAU * f64::from(i) / f64::from(around);
            let v = TAU * f64::from(j) / f64::from(along);
            let tube = 0.4 + 0.05 * (9.0 * u).sin() * (4.0 * v).cos();
            let ring = 1.0 + tube * v.cos();
            mesh.positions
                .push(DVec3::new(ring * u.cos(), ring * u.sin(), tube * v.sin()));
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn ply(mesh: &ImportedMesh, ascii: bool) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        if ascii {
            "ascii"
        } else {
            "binary_little_endian"
        },
        mesh.positions.len(),
        mesh.triangles.len()
    );
    let positions = mesh.positions.iter().map(|p| p.as_vec3());
    if ascii {
        for p in positions {
            writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap();
        }
        for [a, b, c] in &mesh.triangles {
            writeln!(text, "3 {a} {b} {c}").unwrap();
        }
        return text.into_bytes();
    }
    let mut bytes = text.into_bytes();
    for p in positions {
        bytes.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes()));
    }
    for t in &mesh.triangles {
        bytes.push(3);
        bytes.extend(t.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

fn obj(mesh: &ImportedMesh) -> Vec<u8> {
    let mut text = String::new();
    for p in mesh.positions.iter().map(|p| p.as_vec3()) {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| v + 1);
        writeln!(text, "f {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

fn imports(c: &mut Criterion) {
    let mesh = mesh();
    let mut group = c.benchmark_group("import");
    group.sample_size(20);
    for (name, bytes) in [
        ("ply-binary", ply(&mesh, false)),
        ("ply-ascii", ply(&mesh, true)),
        ("obj", obj(&mesh)),
    ] {
        group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
        group.bench_function(name, |b| {
            b.iter_batched(
                || bytes.clone(),
                |bytes| import_bytes(bytes, Path::new("bench")).unwrap(),
                BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

fn manifolds(c: &mut Criterion) {
    let mesh = mesh();
    let account = Account::new(&mesh);
    let welded = weld::exact(mesh.clone(), &mut account.clone());
    let table = EdgeTable::new(&welded.triangles, welded.positions.len());
    let mut group = c.benchmark_group("manifold");
    group.sample_size(20);
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    group.bench_function("weld", |b| {
        b.iter_batched(
            || mesh.clone(),
            |mesh| weld::exact(mesh, &mut account.clone()),
            BatchSize::LargeInput,
        );
    });
    let goal = decimate::Goal::for_charts(1e-4, mesh.triangles.len() / 8);
    group.bench_function("decimate", |b| {
        b.iter_batched(
            || welded.clone(),
            |mut welded| decimate::decimate(&mut welded, goal),
            BatchSize::LargeInput,
        );
    });
    group.bench_function("edge-table", |b| {
        b.iter(|| EdgeTable::new(black_box(&welded.triangles), welded.positions.len()));
    });
    group.bench_function("topology", |b| {
        b.iter(|| Topology::of(black_box(&welded), &table));
    });
    group.bench_function("duplicates", |b| {
        b.iter_batched(
            || welded.clone(),
            |mut welded| duplicates::remove(&mut welded, &table, &mut account.clone()),
            BatchSize::LargeInput,
        );
    });
    group.bench_function("manifold", |b| {
        b.iter_batched(
            || welded.clone(),
            |welded| manifold::manifold(welded, &table, &mut account.clone()),
            BatchSize::LargeInput,
        );
    });
    group.bench_function("all", |b| {
        b.iter_batched(
            || mesh.clone(),
            |mesh| prepare(mesh).unwrap(),
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

fn measures(c: &mut Criterion) {
    let mesh = mesh();
    let moved: Vec<DVec3> = mesh
        .positions
        .iter()
        .map(|p| *p + DVec3::splat(1e-4) * (40.0 * *p).map(f64::sin))
        .collect();
    let mut group = c.benchmark_group("measure");
    group.sample_size(10);
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    group.bench_function("tree", |b| {
        b.iter(|| Bvh::new(black_box(&mesh.positions), &mesh.triangles).unwrap());
    });
    group.bench_function("both-ways", |b| {
        let borrowed = |positions| distance::Mesh {
            positions,
            triangles: &mesh.triangles,
        };
        b.iter(|| distance::measure(borrowed(&moved), borrowed(&mesh.positions), 100_000).unwrap());
    });
    group.finish();
}

criterion_group!(benches, imports, manifolds, measures);
criterion_main!(benches);
