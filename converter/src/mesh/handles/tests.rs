//! Facts about cut handles.

use super::*;
use crate::mesh::{ImportedMesh, prepare};
use glam::DVec3;

/// A torus around z: its tube has radius `thin`, its middle circle radius 1.
fn torus(around: u32, along: u32, thin: f64) -> ManifoldMesh {
    let mut mesh = ImportedMesh::default();
    let angle = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    for j in 0..along {
        for i in 0..around {
            let (u, v) = (angle(i, around), angle(j, along));
            let r = 1.0 + thin * v.cos();
            mesh.positions
                .push(DVec3::new(r * u.cos(), r * u.sin(), thin * v.sin()));
            let (k, l) = ((i + 1) % around, (j + 1) % along);
            let [a, b, c, d] = [[i, j], [k, j], [k, l], [i, l]].map(|[i, j]| j * around + i);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    prepare(mesh).unwrap().0
}

fn euler(mesh: &ManifoldMesh) -> i64 {
    let open = mesh.twins.iter().filter(|&&twin| twin == NONE).count();
    let count = |n: usize| i64::try_from(n).unwrap();
    count(mesh.positions.len()) - count(mesh.twins.len().midpoint(open))
        + count(mesh.triangles.len())
}

#[test]
fn a_thin_handle_is_cut_and_capped() {
    let mut mesh = torus(60, 12, 0.1);
    let before = mesh.clone();
    assert_eq!((euler(&mesh), leftover_edges(&mesh).len()), (0, 2));
    let cut = cut(&mut mesh, 0.12);
    assert_eq!((cut.loops, euler(&mesh)), (1, 2));
    assert!(leftover_edges(&mesh).is_empty());
    assert_eq!(mesh.check(), Ok(()));
    // Around the tube lie 12 edges; both sides get a fan.
    assert_eq!(cut.triangles, 24);
    assert_eq!(mesh.triangles.len(), before.triangles.len() + cut.triangles);
    assert!((0.05..0.12).contains(&cut.distance), "{}", cut.distance);
    let corners =
        |mesh: &ManifoldMesh, t: usize| mesh.triangles[t].map(|v| mesh.origin[v as usize]);
    for t in 0..before.triangles.len() {
        assert_eq!(corners(&mesh, t), corners(&before, t));
    }
    assert_eq!(mesh.cap_apexes.len(), 2);
}

#[test]
fn a_wide_handle_stays() {
    let mut mesh = torus(60, 12, 0.1);
    let before = mesh.triangles.clone();
    assert_eq!(cut(&mut mesh, 0.05), Caps::default());
    assert_eq!(mesh.triangles, before);
}

#[test]
fn open_and_simple_surfaces_have_nothing_to_cut() {
    let mut open = ImportedMesh::default();
    for j in 0..6_u32 {
        for i in 0..20_u32 {
            let u = f64::from(i) / 20.0 * std::f64::consts::TAU;
            open.positions
                .push(DVec3::new(u.cos(), u.sin(), f64::from(j)));
            if j > 0 {
                let k = (i + 1) % 20;
                let [a, b, c, d] =
                    [[i, j - 1], [k, j - 1], [k, j], [i, j]].map(|[i, j]| j * 20 + i);
                open.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    // A tube's loop separates its two ends, which are open.
    let mut tube = prepare(open).unwrap().0;
    assert!(leftover_edges(&tube).is_empty());
    assert_eq!(cut(&mut tube, 10.0), Caps::default());
}
