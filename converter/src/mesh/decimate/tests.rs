use super::*;
use crate::mesh::normals::vertex_normals;
use crate::mesh::{ImportedMesh, ManifoldMesh, orient, weld};
use marquetry_evaluation::distance;
use std::borrow::Cow;

/// A torus of two triangles for each of `rings` × `columns` cells, moved by some noise.
fn torus(rings: u32, columns: u32, noise: f64) -> ImportedMesh {
    let at = |r: u32, c: u32| (r % rings) * columns + c % columns;
    let mut mesh = ImportedMesh::default();
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    for r in 0..rings {
        for c in 0..columns {
            let turn = |part: u32, of: u32| f64::from(part) / f64::from(of) * std::f64::consts::TAU;
            let (a, b) = (turn(r, rings), turn(c, columns));
            let reach = 1.0 + 0.4 * b.cos();
            let point = DVec3::new(reach * a.cos(), reach * a.sin(), 0.4 * b.sin());
            mesh.positions
                .push(point + noise * DVec3::new(random(), random(), random()));
            mesh.triangles.extend([
                [at(r, c), at(r + 1, c), at(r + 1, c + 1)],
                [at(r, c), at(r + 1, c + 1), at(r, c + 1)],
            ]);
        }
    }
    mesh
}

fn decimated(mesh: ImportedMesh, target: f64, enough: usize) -> (ManifoldMesh, Decimated) {
    let (mut welded, mut account) = weld(mesh).unwrap();
    (account.decimated, _) = decimate(&mut welded, Goal::for_charts(target, enough));
    let manifold = orient(welded, &mut account);
    assert_eq!(account.check(), Ok(()));
    assert_eq!(manifold.check(), Ok(()));
    assert_eq!(
        (account.topology.non_manifold_edges, account.vertex_copies),
        (0, 0)
    );
    (manifold, account.decimated)
}

fn measured(mesh: &ManifoldMesh, source: &ImportedMesh) -> distance::Distances {
    let of = |positions, triangles| distance::Mesh {
        positions,
        triangles,
    };
    distance::measure(
        of(&mesh.positions, &mesh.triangles),
        of(&source.positions, &source.triangles),
        200_000,
    )
    .unwrap()
}

#[test]
fn what_is_left_is_a_torus_within_the_bound() {
    for noise in [0.0, 1e-3] {
        let source = torus(700, 300, noise);
        let target = 2e-3;
        let (mesh, report) = decimated(source.clone(), target, 35_000);
        assert_eq!(report.triangles + mesh.triangles.len(), 420_000);
        assert!(
            (25_000..60_000).contains(&mesh.triangles.len()),
            "{} triangles",
            mesh.triangles.len()
        );
        // Euler characteristic 0, without border.
        assert_eq!(mesh.positions.len() * 2, mesh.triangles.len());
        assert!(mesh.twins.iter().all(|&twin| twin != NONE));
        let distances = measured(&mesh, &source);
        assert!(
            distances.hausdorff() <= report.bound,
            "{distances:?} {report:?}"
        );
        assert!(report.bound <= 4.0 * target);
        // At three vertices in four of the source, more or less.
        assert!(
            distances.rms() < 1.2 * report.rms,
            "{distances:?} {report:?}"
        );
        assert!(report.rms < 0.4 * target, "{report:?}");
    }
}

#[test]
fn detail_that_the_target_asks_for_stays() {
    let source = torus(300, 200, 5e-3);
    let (mesh, report) = decimated(source, 1e-4, 10_000);
    assert!(mesh.triangles.len() > 115_000, "{report:?}");
}

#[test]
fn borders_creases_and_holes_stay() {
    // A plane folded along a line, with a square hole: its corners, its border and its fold are there afterwards.
    let n = 300_u32;
    let mut source = ImportedMesh::default();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (f64::from(x), f64::from(y));
            source
                .positions
                .push(DVec3::new(x, y, (x - 150.0).abs()) / f64::from(n));
        }
    }
    for y in 0..n {
        for x in 0..n {
            if (60..90).contains(&x) && (60..90).contains(&y) {
                continue;
            }
            let at = |x: u32, y: u32| y * (n + 1) + x;
            source.triangles.extend([
                [at(x, y), at(x + 1, y), at(x + 1, y + 1)],
                [at(x, y), at(x + 1, y + 1), at(x, y + 1)],
            ]);
        }
    }
    let borders = 4 * n + 4 * 30;
    let before = source.triangles.len();
    let (mesh, report) = decimated(source.clone(), 1e-4, 5_000);
    assert!(mesh.triangles.len() < before / 10, "{report:?}");
    assert_eq!(mesh.boundary_loops().len(), 2);
    let open = mesh.twins.iter().filter(|&&twin| twin == NONE).count();
    assert_eq!(open, borders as usize);
    let distances = measured(&mesh, &source);
    assert!(
        distances.hausdorff() <= report.bound,
        "{distances:?} {report:?}"
    );
    assert!(
        report.bound <= 4e-4 && distances.rms() < 2e-5,
        "{distances:?} {report:?}"
    );
}

#[test]
fn threads_do_not_change_it() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| decimated(torus(700, 200, 1e-3), 2e-3, 30_000).0)
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.triangles, two.triangles);
    assert_eq!(one.positions, two.positions);
}

#[test]
fn small_and_coloured_meshes_stay() {
    let source = torus(30, 20, 0.0);
    let (mesh, report) = decimated(source.clone(), 1.0, 1200);
    assert_eq!((mesh.triangles.len(), report), (1200, Decimated::default()));
    let coloured = ImportedMesh {
        colours: vec![[1, 2, 3]; source.positions.len()],
        ..source
    };
    let (mesh, report) = decimated(coloured, 1.0, 100);
    assert_eq!((mesh.triangles.len(), report), (1200, Decimated::default()));
}

/// Smooth, noisy, and both: every place that is measured is within what is stated, and nearly all of what is wanted is used.
#[test]
fn aimed_decimation_comes_near_what_is_wanted_and_not_above() {
    for noise in [0.0, 1e-3, 3e-3] {
        let source = torus(300, 200, noise);
        let wanted = 1e-3;
        let (welded, mut account) = weld(source.clone()).unwrap();
        let Aimed {
            mesh,
            decimated: report,
            ..
        } = aimed(Cow::Borrowed(&welded), wanted, false);
        assert_eq!(report.triangles + mesh.triangles.len(), 120_000);
        account.decimated = report;
        let manifold = orient(mesh, &mut account);
        assert_eq!(account.check(), Ok(()));
        // Euler characteristic 0, without border.
        assert_eq!(manifold.positions.len() * 2, manifold.triangles.len());
        let distances = measured(&manifold, &source);
        assert!(report.rms <= wanted && distances.backward.rms <= 1.02 * wanted);
        assert!(report.rms >= 0.9 * wanted, "{noise}: {report:?}");
        assert!(distances.hausdorff() <= report.bound);
    }
}

#[test]
fn aimed_decimation_leaves_what_has_nothing_to_spare() {
    let source = weld(torus(60, 40, 5e-2)).unwrap().0;
    let Aimed {
        mesh,
        decimated: report,
        ..
    } = aimed(Cow::Borrowed(&source), 1e-6, true);
    assert!(mesh.triangles.len() > 4700, "{report:?}");
    assert!(report.rms <= 1e-6);
}

#[test]
fn threads_do_not_change_aimed_decimation() {
    let source = weld(torus(300, 200, 1e-3)).unwrap().0;
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| aimed(Cow::Borrowed(&source), 1e-3, false))
    };
    let (one, two) = (run(1), run(3));
    assert_eq!(
        (one.mesh.triangles, one.mesh.positions, one.normals),
        (two.mesh.triangles, two.mesh.positions, two.normals)
    );
    assert_eq!(one.decimated, two.decimated);
}

/// Interpolated over its triangles, against those of the torus itself.
#[test]
fn normals_of_what_is_left_are_nearer_to_the_sources_than_those_of_its_faces() {
    let source = weld(torus(300, 200, 0.0)).unwrap().0;
    for (is_torn, most) in [(false, 0.5), (true, 0.7)] {
        let Aimed { mesh, normals, .. } = aimed(Cow::Borrowed(&source), 1e-3, is_torn);
        assert!(mesh.triangles.len() < 12_000);
        let of_faces = deviation(&mesh, &vertex_normals(mesh.surface()));
        let left = deviation(&mesh, &normals);
        assert!(left < most * of_faces, "{is_torn}: {left} {of_faces}");
    }
}

/// Root mean square of how far normals at the middles of triangles are from those of the torus.
fn deviation(mesh: &WeldedMesh, normals: &[DVec3]) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for t in &mesh.triangles {
        let middle = t.map(|v| mesh.positions[v as usize]);
        let middle = middle.into_iter().sum::<DVec3>() / 3.0;
        let ring = middle.with_z(0.0).normalize_or_zero();
        let told = t.map(|v| normals[v as usize].normalize_or_zero());
        let told = told.into_iter().sum::<DVec3>().normalize_or_zero();
        squares += told.distance_squared((middle - ring).normalize_or_zero());
        count += 1.0;
    }
    (squares / count).sqrt()
}

/// A sheet of `cells`² cells; of every `tear`² cells one is missing.
fn sheet_with_holes(cells: u32, tear: u32) -> WeldedMesh {
    let mut mesh = ImportedMesh::default();
    let at = |x: u32, y: u32| y * (cells + 1) + x;
    for k in 0..(cells + 1).pow(2) {
        let (x, y) = (k % (cells + 1), k / (cells + 1));
        mesh.positions.push(DVec3::new(x.into(), y.into(), 0.0));
    }
    for k in 0..cells.pow(2) {
        let (x, y) = (k % cells, k / cells);
        if x % tear != tear / 2 || y % tear != tear / 2 {
            let (a, c) = (at(x, y), at(x + 1, y + 1));
            let others = [at(x + 1, y), at(x, y + 1)];
            mesh.triangles
                .extend([[a, others[0], c], [a, c, others[1]]]);
        }
    }
    weld(mesh).unwrap().0
}

#[test]
fn torn_meshes_are_told_from_meshes_with_holes() {
    // 2 x 230^2 triangles, a loop for each 2 x 20^2 and each 2 x 25^2 of them.
    assert!(is_torn(&sheet_with_holes(230, 20)));
    assert!(!is_torn(&sheet_with_holes(230, 25)));
    // Too small to be asked.
    assert!(!is_torn(&sheet_with_holes(200, 10)));
}
