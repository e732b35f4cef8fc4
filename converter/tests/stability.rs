//! Meshes that methods fail on, each with the outcome that is required beside it, where charts are asked for. By default all become clusters.
//!
//! "Converts" means: the file verifies, the RMS error is at most the target, no measured distance is above the stated bound, and every
//! triangle is in a chart, in a cluster, or in the report with its reason. All meshes are made by formula, with fixed seeds.

#![expect(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "test meshes are small, and a failed unwrap fails the test"
)]

#[path = "stability/meshes.rs"]
mod meshes;

use marquetry_converter::pipeline::{Charts as Asked, Options, Progress, convert};
use marquetry_converter::report::Report;
use marquetry_format::FileSource;
use marquetry_format::verify::verify;
use meshes::Soup;
use std::fmt::Write as _;

struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str) {}
    fn fraction(&self, _: f64) {}
}

/// What must come of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Outcome {
    /// Charts only, however many samples they need.
    Charts,
    /// Clusters only.
    Clusters,
    /// Either, or both.
    Converts,
}
use Outcome::{Charts, Clusters, Converts};

/// Converts as OBJ at an error of 5e-4 and checks everything; the report, or what is wrong.
fn outcome(name: &str, mesh: &Soup, asked: Asked, expected: Outcome) -> Result<Report, String> {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.obj"), folder.path().join("out.marq"));
    std::fs::write(&input, mesh.obj()).unwrap();
    let options = Options {
        error_rel: 5e-4,
        charts: asked,
        samples_per_triangle: if expected == Charts {
            u64::MAX
        } else {
            Options::default().samples_per_triangle
        },
        ..Options::default()
    };
    let report =
        convert(&input, &output, &options, &Silent).map_err(|error| format!("refused: {error}"))?;
    let verified = verify(&FileSource::open(&output).unwrap()).map_err(|e| e.to_string())?;
    let mut faults = String::new();
    let mut check = |holds: bool, words: String| {
        if !holds {
            // Writing to a string does not fail.
            let _ = write!(faults, "{words}; ");
        }
    };
    check(verified.ok, format!("does not verify: {verified:?}"));
    let error = &report.error;
    check(
        error.rms_rel <= error.target_rel && error.hausdorff_rel <= error.max_rel,
        format!("errors out of order: {error:?}"),
    );
    let clusters = report.output.clusters;
    check(
        match expected {
            Charts => report.output.charts > 0 && clusters.nodes == 0,
            Clusters => report.output.charts == 0 && clusters.nodes > 0,
            Converts => report.output.charts > 0 || clusters.nodes > 0,
        },
        format!("{} charts, {clusters:?}", report.output.charts),
    );
    let (lost, merged) = (report.lost.triangles, report.merged.triangles);
    check(
        lost == 0 || !report.lost.reason.is_empty(),
        "lost without a reason".to_owned(),
    );
    check(
        report.input.triangles == mesh.triangles.len() as u64,
        format!("{} triangles read", report.input.triangles),
    );
    if expected == Clusters {
        let decimated = report.input.decimated;
        check(
            clusters.triangles + lost + merged + decimated == mesh.triangles.len(),
            format!(
                "{} in clusters, {lost} lost, {merged} merged, {decimated} decimated",
                clusters.triangles
            ),
        );
    }
    eprintln!(
        "{name}: {} triangles, {} charts, {} clusters, rms {:.1e}, hausdorff {:.1e} of {:.1e}, {:.2} s, {} bytes",
        mesh.triangles.len(),
        report.output.charts,
        clusters.nodes,
        error.rms_rel,
        error.hausdorff_rel,
        error.max_rel,
        report.seconds,
        report.output.bytes
    );
    if faults.is_empty() {
        Ok(report)
    } else {
        Err(faults)
    }
}

fn all(list: &[(&str, Soup, Outcome)]) {
    let faults: Vec<String> = list
        .iter()
        .flat_map(|(name, mesh, with_charts)| {
            let ways = [(Asked::Auto, Clusters), (Asked::Always, *with_charts)];
            ways.map(|(asked, expected)| {
                let fault = outcome(name, mesh, asked, expected).err()?;
                Some(format!("{name}, {asked:?}: {fault}"))
            })
        })
        .flatten()
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn borders() {
    all(&[
        ("ears", meshes::ears(24), Charts),
        ("chords", meshes::strip(400), Charts),
        (
            "400 holes",
            meshes::sheet(121, |i, j| i % 6 == 3 && j % 6 == 3),
            Clusters,
        ),
        (
            "pinholes",
            meshes::sheet(100, |i, j| i % 2 == 1 && j % 2 == 1),
            Clusters,
        ),
        (
            "holes far apart",
            meshes::sheet(121, |i, j| i % 24 == 3 && j % 24 == 3),
            Charts,
        ),
    ]);
}

#[test]
fn tiny() {
    all(&[
        ("triangle", meshes::triangle(), Clusters),
        ("tetrahedron", meshes::tetrahedron(), Clusters),
        ("pillow", meshes::pillow(), Clusters),
        ("cube", meshes::cube(1), Clusters),
    ]);
}

#[test]
fn handles() {
    all(&[
        ("genus 100", meshes::perforated(10), Charts),
        (
            "genus 100 with noise",
            meshes::perforated(10).shaken(0.02, 3),
            Charts,
        ),
    ]);
}

#[test]
fn orientation() {
    all(&[
        ("Moebius", meshes::moebius(120, 10), Charts),
        ("Klein", meshes::klein(80, 40), Converts),
        (
            "half flipped",
            meshes::sphere(60, 30).half_flipped(5),
            Charts,
        ),
    ]);
}

#[test]
fn non_manifold() {
    all(&[
        ("bow-ties", meshes::bow_ties(12), Converts),
        ("book of 3", meshes::book(3, 16), Converts),
        ("book of 5", meshes::book(5, 16), Converts),
        ("book of 8", meshes::book(8, 16), Converts),
    ]);
}

#[test]
fn thin() {
    all(&[
        ("double shell", meshes::double_shell(60, 30, 1e-4), Charts),
        ("plate", meshes::plate(20, 1e-4), Charts),
    ]);
}

#[test]
fn many() {
    all(&[
        ("3000 cubes", meshes::cubes(3000), Clusters),
        ("3000 cards", meshes::cards(3000), Clusters),
        (
            "cubes on a sheet",
            meshes::sheet(40, |_, _| false).with(&meshes::cubes(200)),
            Converts,
        ),
    ]);
}

#[test]
fn protrusions() {
    all(&[
        ("spikes", meshes::sphere(80, 40).spiked(3.0, 12), Charts),
        ("fingers", meshes::fingers(5), Charts),
        ("tube of 60 radii", meshes::tube(60.0, 24, 200), Charts),
        ("pole of valence 1 000", meshes::sphere(1_000, 3), Clusters),
    ]);
}

#[test]
fn roughness() {
    all(&[
        (
            "noise of 0.05 edges",
            meshes::sphere(80, 40).shaken(0.05 * 0.08, 1),
            Charts,
        ),
        (
            "noise of 0.2 edges",
            meshes::sphere(80, 40).shaken(0.2 * 0.08, 1),
            Charts,
        ),
        (
            "noise of 0.6 edges",
            meshes::sphere(80, 40).shaken(0.6 * 0.08, 1),
            Charts,
        ),
        ("voxel stairs", meshes::voxel_ball(12), Charts),
    ]);
}

#[test]
fn creases() {
    all(&[
        ("fine cube", meshes::cube(16), Charts),
        ("bracket", meshes::bracket(24), Charts),
    ]);
}

#[test]
fn regular() {
    all(&[
        ("grid", meshes::sheet(64, |_, _| false), Charts),
        ("torus", meshes::torus(64, 32), Charts),
    ]);
}

/// `cargo test --release -p marquetry-converter --test stability -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes: large numbers of the design's list"]
fn by_hand() {
    all(&[
        ("100 000 cubes", meshes::cubes(100_000), Clusters),
        ("100 000 cards", meshes::cards(100_000), Clusters),
        ("pole of valence 10 000", meshes::sphere(10_000, 3), Charts),
        (
            "pole of valence 100 000",
            meshes::sphere(100_000, 3),
            Charts,
        ),
    ]);
}
