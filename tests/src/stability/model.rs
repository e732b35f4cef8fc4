//! Meshes that are converted and held to what is required of them.
//!
//! "Converts" means: the file verifies, the RMS error is at most the target, no measured distance is above the stated bound, and every
//! triangle is in a chart, in a cluster, or in the report with its reason.

use super::soup::Soup;
use super::{Case, Found, Outcome, Part};
use anyhow::{Context, Result, bail, ensure};
use marquetry_converter::pipeline::{Charts as Asked, Options, Progress, convert};
use marquetry_converter::report::Report;
use marquetry_format::FileSource;
use marquetry_format::verify::verify;

struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str) {}
    fn fraction(&self, _: f64) {}
}

/// What must come of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Expected {
    /// Charts only, however many samples they need.
    Charts,
    /// Clusters only.
    Clusters,
    /// Either, or both.
    Converts,
}

impl Expected {
    fn words(self) -> &'static str {
        match self {
            Self::Charts => "converts to charts",
            Self::Clusters => "converts to clusters",
            Self::Converts => "converts",
        }
    }
}

/// A mesh by default, which makes clusters of it, and with charts, which makes what is `expected`.
pub(super) fn both_ways(
    part: Part,
    set: Option<&'static str>,
    name: &str,
    expected: Expected,
    make: impl Fn() -> Soup + Clone + Send + Sync + 'static,
) -> [Case; 2] {
    each_way(part, set, name, [Expected::Clusters, expected], make)
}

/// A mesh by default and with charts, and what is expected of either.
pub(super) fn each_way(
    part: Part,
    set: Option<&'static str>,
    name: &str,
    [by_default, with_charts]: [Expected; 2],
    make: impl Fn() -> Soup + Clone + Send + Sync + 'static,
) -> [Case; 2] {
    let ways = [
        (Asked::Auto, "", by_default),
        (Asked::Always, ", charts", with_charts),
    ];
    ways.map(|(asked, suffix, expected)| {
        let make = make.clone();
        Case {
            part,
            set,
            name: format!("{name}{suffix}"),
            required: expected.words().to_owned(),
            run: Box::new(move |_| outcome(&make(), asked, expected).map(Outcome::Met)),
        }
    })
}

/// A mesh that is refused both ways, for a reason that holds `word`.
pub(super) fn refused(
    part: Part,
    name: &str,
    word: &'static str,
    make: impl Fn() -> Soup + Send + Sync + 'static,
) -> Case {
    Case {
        part,
        set: None,
        name: name.to_owned(),
        required: format!("is refused: {word}"),
        run: Box::new(move |_| {
            let mesh = make();
            let mut said = String::new();
            for asked in [Asked::Auto, Asked::Always] {
                let Err(error) = converted(&mesh, asked, Expected::Converts) else {
                    bail!("is not refused");
                };
                said = format!("{error:#}");
                ensure!(said.contains(word), "{said}");
            }
            Ok(Outcome::Met(Found {
                words: said,
                ..Found::default()
            }))
        }),
    }
}

/// Converts as OBJ at an error of 5e-4.
fn converted(mesh: &Soup, asked: Asked, expected: Expected) -> Result<Report> {
    let folder = tempfile::tempdir()?;
    let (input, output) = (folder.path().join("in.obj"), folder.path().join("out.marq"));
    std::fs::write(&input, mesh.obj())?;
    let options = Options {
        error_rel: 5e-4,
        charts: asked,
        samples_per_triangle: if expected == Expected::Charts {
            u64::MAX
        } else {
            Options::default().samples_per_triangle
        },
        ..Options::default()
    };
    let report = convert(&input, &output, &options, &Silent).map_err(|error| {
        // The folder's name is another in every run.
        let said = error.to_string();
        anyhow::Error::msg(said.replace(&input.display().to_string(), "in.obj"))
    })?;
    let source = FileSource::open(&output).context("what was written cannot be opened")?;
    let verified = verify(&source)?;
    ensure!(verified.ok, "does not verify: {verified:?}");
    Ok(report)
}

/// Converts and checks everything.
fn outcome(mesh: &Soup, asked: Asked, expected: Expected) -> Result<Found> {
    let report = converted(mesh, asked, expected)?;
    let mut faults: Vec<String> = Vec::new();
    let mut check = |holds: bool, words: String| {
        if !holds {
            faults.push(words);
        }
    };
    let error = &report.error;
    check(
        error.rms_rel <= error.target_rel && error.hausdorff_rel <= error.max_rel,
        format!("errors out of order: {error:?}"),
    );
    let (charts, clusters) = (report.output.charts, report.output.clusters);
    check(
        match expected {
            Expected::Charts => charts > 0 && clusters.nodes == 0,
            Expected::Clusters => charts == 0 && clusters.nodes > 0,
            Expected::Converts => charts > 0 || clusters.nodes > 0,
        },
        format!("{charts} charts, {clusters:?}"),
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
    if expected == Expected::Clusters {
        let decimated = report.input.decimated;
        // Each vertex that is put into a border edge makes one triangle more.
        let whole = mesh.triangles.len() + report.input.t_junctions;
        check(
            clusters.triangles + lost + merged + decimated == whole,
            format!(
                "{} in clusters, {lost} lost, {merged} merged, {decimated} decimated of {whole}",
                clusters.triangles
            ),
        );
    }
    if !faults.is_empty() {
        bail!(faults.join("; "));
    }
    let left = [(lost, "lost"), (merged, "merged")]
        .into_iter()
        .filter(|&(count, _)| count > 0)
        .map(|(count, word)| format!(", {count} {word}"));
    Ok(Found {
        words: format!(
            "{} triangles, {charts} charts, {} clusters{}",
            report.input.triangles,
            clusters.nodes,
            left.collect::<String>()
        ),
        rms_rel: Some(error.rms_rel),
        largest_rel: Some([error.hausdorff_rel, error.max_rel]),
    })
}
