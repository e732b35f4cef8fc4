//! What numbers can do to a mesh. Beside each case stands what must come of it: the mesh converts within its error and
//! verifies, or it is refused with a message that says why.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

mod support;

use glam::DVec3;
use marquetry_converter::pipeline::{Charts, Options};
use marquetry_converter::report::Report;
use support::{Model, convert_model, sheet, torus};

fn options(charts: Charts) -> Options {
    Options {
        error_rel: 1e-3,
        charts,
        ..Options::default()
    }
}

/// By default and with charts.
const BOTH_WAYS: [Charts; 2] = [Charts::Auto, Charts::Always];

fn converts(model: &Model) -> [Report; 2] {
    BOTH_WAYS.map(|way| convert_model(model, &options(way)).unwrap_or_else(|e| panic!("{e}")))
}

/// What is said, both ways.
fn refused(model: &Model) -> [String; 2] {
    BOTH_WAYS.map(|way| convert_model(model, &options(way)).unwrap_err().to_string())
}

fn assert_nothing_is_lost(model: &Model, boundary_loops: usize) {
    for report in converts(model) {
        let found = (report.lost.triangles, report.input.boundary_loops);
        assert_eq!(found, (0, boundary_loops), "{report:?}");
    }
}

/// Refused, naming the vertex; with `--allow-worse` the triangles at it are left out, with the reason.
#[test]
fn a_vertex_that_is_not_finite() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.2e182] {
        for axis in 0..3 {
            let mut model = torus(32, 16);
            model.positions[77][axis] = bad;
            for message in refused(&model) {
                assert!(
                    message.contains("vertex 77") && message.contains("not finite"),
                    "{message}"
                );
            }
            for way in BOTH_WAYS {
                let allowed = Options {
                    allow_worse: true,
                    ..options(way)
                };
                let report = convert_model(&model, &allowed).unwrap();
                assert_eq!(report.lost.triangles, 6);
                assert_eq!(report.lost.reason, ["6: a corner is not finite"]);
                assert_eq!(report.input.boundary_loops, 1);
            }
        }
    }
}

/// Decimated before charts are made where there are far more triangles than the error asks for: what is reported holds for the input as it was.
#[test]
fn far_more_triangles_than_the_error_asks_for() {
    let mut state = 7_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let mut model = torus(400, 250);
    for position in &mut model.positions {
        *position += 2e-4 * DVec3::new(random(), random(), random());
    }
    let given = Options {
        decimate_above: 60_000,
        ..options(Charts::Always)
    };
    let report = convert_model(&model, &given).unwrap();
    assert_eq!(report.input.triangles, 200_000);
    let left = 200_000 - report.input.decimated;
    assert!((20_000..60_000).contains(&left), "{left} triangles left");
    assert_eq!(
        (report.input.boundary_loops, report.input.components),
        (0, 1)
    );
    // What is left of all of them is nearer to the target than to nothing.
    assert!(report.error.rms_rel > 5e-4, "{report:?}");
    let whole = convert_model(&model, &options(Charts::Always)).unwrap();
    assert_eq!(whole.input.decimated, 0);
    let bytes = |report: &Report| report.output.bytes as f64;
    assert!(
        bytes(&report) < 1.3 * bytes(&whole),
        "{} {}",
        bytes(&report),
        bytes(&whole)
    );
}

/// Refused: there is no surface.
#[test]
fn nothing_finite() {
    let model = torus(8, 8).map(|_| DVec3::NAN);
    for message in refused(&model) {
        assert!(message.contains("finite"), "{message}");
    }
}

/// Converts, all triangles kept: a sliver is a part of the surface like any other.
#[test]
fn slivers_of_a_million_to_one() {
    let mut model = torus(40, 20);
    for t in (0..model.triangles.len()).step_by(5) {
        let [a, b, c] = model.triangles[t];
        let [p, q, r] = [a, b, c].map(|v| model.positions[v as usize]);
        let middle = p.midpoint(q);
        let m = u32::try_from(model.positions.len()).unwrap();
        model.positions.push(middle + (r - middle) * 1e-6);
        model.triangles[t] = [a, b, m];
        model.triangles.extend([[b, c, m], [c, a, m]]);
    }
    assert_nothing_is_lost(&model, 0);
    // The whole of it drawn out.
    let sheet = sheet(24, |x, y| (3.0 * x).sin() * y);
    assert_nothing_is_lost(&sheet.map(|p| p * DVec3::new(1e6, 1.0, 1.0)), 1);
}

/// Converts, all triangles kept: triangles without area hold the surface together.
#[test]
fn collinear_triangles_within_a_surface() {
    let mut model = torus(40, 20);
    for t in (0..model.triangles.len()).step_by(7) {
        let [a, b, c] = model.triangles[t];
        let m = u32::try_from(model.positions.len()).unwrap();
        let [p, q] = [a, b].map(|v| model.positions[v as usize]);
        model.positions.push(p.midpoint(q));
        model.triangles[t] = [a, m, c];
        model.triangles.extend([[m, b, c], [a, b, m]]);
    }
    assert_nothing_is_lost(&model, 0);
}

/// Converts or is refused because there is no area; in no case does it end in anything else.
#[test]
fn nothing_but_collinear_triangles() {
    let models = [
        sheet(6, |_, _| 0.0).map(|p| DVec3::X * (p.x + 7.0 * p.y)),
        sheet(6, |_, _| 0.0).map(|p| DVec3::ONE * (p.x + 0.1 * p.y)),
    ];
    for (model, way) in models
        .iter()
        .flat_map(|model| BOTH_WAYS.map(|way| (model, way)))
    {
        match convert_model(model, &options(way)) {
            Ok(report) => assert_eq!(report.lost.triangles, 0),
            Err(error) => {
                let message = error.to_string();
                assert!(message.contains("model.ply"), "{message}");
            }
        }
    }
}

/// Converts, at an error that is rounding alone; also where the plane is perpendicular to an axis.
#[test]
fn coplanar_triangles_and_a_flat_axis() {
    let flat = sheet(30, |_, _| 0.0);
    for turn in [
        |p: DVec3| p,
        |p: DVec3| DVec3::new(p.z, p.x, p.y),
        |p: DVec3| DVec3::new(p.y, p.z, p.x),
        |p: DVec3| p + DVec3::Z * (0.3 * p.x - 0.7 * p.y),
        |p: DVec3| p + DVec3::Z * 5.0,
    ] {
        for report in converts(&flat.map(turn)) {
            assert_eq!(report.lost.triangles, 0);
            assert!(report.error.rms_rel < 1e-3, "{report:?}");
        }
    }
}

/// The same result up to rounding: as many charts or clusters, the same error of the same size. Vertices are shaken, since on a smooth grid
/// edges nearly cost the same, and which of them collapses first must not be left to rounding.
#[test]
fn results_do_not_depend_on_units_or_place() {
    let shaken = |p: DVec3| {
        let waves = [
            91.0 * p.x + 57.0 * p.y,
            83.0 * p.y + 67.0 * p.z,
            79.0 * p.z + 61.0 * p.x,
        ];
        p + 0.003 * DVec3::from_array(waves.map(f64::sin))
    };
    let model = torus(64, 32).map(shaken);
    let reference = converts(&model);
    let close = |reports: &[Report; 2], what: &str, tolerance: f64, of_largest: f64| {
        for (report, reference) in reports.iter().zip(&reference) {
            let (a, b) = (&report.output, &reference.output);
            assert_eq!((a.charts, a.levels), (b.charts, b.levels), "{what}");
            for (a, b, tolerance) in [
                (report.error.rms_rel, reference.error.rms_rel, tolerance),
                (report.error.max_rel, reference.error.max_rel, of_largest),
                (a.bytes as f64, b.bytes as f64, tolerance),
                (a.samples as f64, b.samples as f64, tolerance),
                (a.clusters.nodes as f64, b.clusters.nodes as f64, tolerance),
            ] {
                assert!((a - b).abs() <= tolerance * b, "{what}: {a} instead of {b}");
            }
        }
    };
    // Powers of two change nothing at all but the lattice's frame.
    for scale in [
        2_f64.powi(-10),
        2_f64.powi(10),
        2_f64.powi(60),
        2_f64.powi(-60),
    ] {
        close(
            &converts(&model.map(|p| p * scale)),
            &format!("times {scale}"),
            1e-2,
            1e-2,
        );
    }
    for scale in [1e-3, 1e3, 1e20, 1e-20] {
        close(
            &converts(&model.map(|p| p * scale)),
            &format!("times {scale}"),
            0.05,
            0.05,
        );
    }
    let moved = |p: DVec3| p + DVec3::new(1e7, -1e7, 1e7);
    // Places have 2e-9 of precision there.
    close(&converts(&model.map(moved)), "moved by 1e7", 0.05, 0.1);
}
