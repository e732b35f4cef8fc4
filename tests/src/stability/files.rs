//! The folder of difficult meshes that others made: everything converts and verifies, by default and with charts; the two without geometry
//! are refused.

use super::{Case, Depth, Found, Outcome, Part};
use crate::{BOTH_WAYS, Finished, arguments, convert, data, marquetry};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::Path;

/// Every file of the folder, and whether it has geometry.
pub const DIFFICULT: [(&str, bool); 22] = [
    ("as_sphereWithHole.stl", true),
    ("as_triangle_with_empty_solid.stl", true),
    ("cgal_b9_mesh.off", true),
    ("cgal_blobby-shuffled.off", true),
    ("cgal_cheese.off", true),
    ("cgal_diplodocus.off.gz", true),
    ("cgal_elephant-with-holes.off", true),
    ("cgal_mech-holes-shark.off", true),
    ("cgal_pig.stl.gz", true),
    ("cgal_turbine.off", true),
    ("igea_tristrips.ply.gz", true),
    ("igl_truck.obj", true),
    ("mp_chair.off", true),
    ("mp_table.off", true),
    ("tm_bunny.ply", true),
    ("tm_capsule.obj.gz", true),
    ("tm_empty.ply", false),
    ("tm_empty.stl", false),
    ("tm_multibody.stl", true),
    ("tm_negative_indices.obj", true),
    ("tm_soup.stl", true),
    ("wm_37989_sf.obj", true),
];

/// Samples of `marquetry measure`, which looks at the file once more.
const SAMPLES: &str = "200000";

pub(super) fn cases() -> Vec<Case> {
    let of = |name: &str, required: &str, run: super::Run| Case {
        part: Part::Files,
        set: Some("difficult_files"),
        name: name.to_owned(),
        required: required.to_owned(),
        run,
    };
    let mut cases = Vec::new();
    for (name, has_geometry) in DIFFICULT {
        if !has_geometry {
            let run = Box::new(move |_| with_file(name, refused));
            cases.push(of(name, "is refused: no triangles", run));
            continue;
        }
        for (way, suffix) in BOTH_WAYS.into_iter().zip(["", ", charts"]) {
            let run = Box::new(move |depth| {
                with_file(name, |input| converts(input, way, depth == Depth::Whole))
            });
            cases.push(of(&format!("{name}{suffix}"), "converts", run));
        }
    }
    cases
}

fn with_file(name: &str, run: impl FnOnce(&Path) -> Result<Found>) -> Result<Outcome> {
    match data::find(&format!("difficult/{name}")) {
        Some(input) => run(&input).map(Outcome::Met),
        None => Ok(Outcome::Ignored(
            "../shared/data is not on this machine".to_owned(),
        )),
    }
}

/// Converts with the binary, verifies, and, where asked for, measures anew.
fn converts(input: &Path, way: &[&str], measures: bool) -> Result<Found> {
    let converted = convert(input, way)?;
    let verified = marquetry(&arguments!["verify", &converted.path, "--json", "-"])
        .and_then(Finished::json)?;
    ensure!(
        verified["ok"] == Value::Bool(true),
        "does not verify: {verified}"
    );
    let report = &converted.report;
    // Nothing is lost silently: what was left out has a reason.
    let lost = &report["lost"];
    let reasons = lost["reason"].as_array().map_or(0, Vec::len);
    let lost_triangles = lost["triangles"]
        .as_u64()
        .context("no count of what is lost")?;
    ensure!(
        lost_triangles == 0 || reasons > 0,
        "lost without a reason: {lost}"
    );
    let number = |report: &Value, key: &str| {
        report[key]
            .as_f64()
            .with_context(|| format!("no {key} in {report}"))
    };
    let error = &report["error"];
    let [target, bound] = [number(error, "target_rel")?, number(error, "max_rel")?];
    let (mut rms, mut largest) = (number(error, "rms_rel")?, number(error, "hausdorff_rel")?);
    ensure!(rms <= target, "RMS {rms:e} of {target:e}");
    if measures {
        let measured = marquetry(&arguments![
            "measure",
            &converted.path,
            "--against",
            input,
            "--samples",
            SAMPLES,
            "--json",
            "-"
        ])
        .and_then(Finished::json)?;
        rms = rms.max(number(&measured, "rms_rel")?);
        largest = largest.max(number(&measured, "hausdorff_rel")?);
    }
    ensure!(largest <= bound, "{largest:e} of {bound:e} that is stated");
    let output = &report["output"];
    Ok(Found {
        words: format!(
            "{} triangles, {} charts, {} clusters{}",
            report["input"]["triangles"],
            output["charts"],
            output["clusters"]["nodes"],
            if lost_triangles > 0 {
                format!(", {lost_triangles} lost")
            } else {
                String::new()
            }
        ),
        rms_rel: Some(rms),
        largest_rel: Some([largest, bound]),
    })
}

fn refused(input: &Path) -> Result<Found> {
    let folder = tempfile::tempdir()?;
    let output = folder.path().join("out.marq");
    let finished = marquetry(&arguments!["convert", input, "-o", &output])?;
    ensure!(
        finished.code == Some(1) && !finished.panicked(),
        "exit code {:?}: {}",
        finished.code,
        finished.stderr
    );
    let name = input.file_name().context("no name")?.to_string_lossy();
    ensure!(
        finished.stderr.contains(&*name),
        "the file is not named: {}",
        finished.stderr
    );
    let said = finished.stderr.to_lowercase();
    ensure!(
        ["no triangles", "empty"].iter().any(|w| said.contains(w)),
        "{said}"
    );
    ensure!(
        folder.path().read_dir()?.next().is_none(),
        "something is left behind"
    );
    Ok(Found {
        words: "refused".to_owned(),
        ..Found::default()
    })
}
