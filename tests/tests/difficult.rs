//! Everything in the folder of difficult meshes converts and verifies, with charts and without; the two without geometry are refused.

use marquetry_tests::{BOTH_WAYS, Finished, arguments, convert, data, marquetry};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Files without any geometry: `bad_input` tests that they are refused.
const EMPTY: [&str; 2] = ["tm_empty.ply", "tm_empty.stl"];

#[test]
fn difficult_meshes_convert_and_verify() {
    let Some(folder) = data::find("difficult") else {
        return;
    };
    let mut inputs: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    inputs.sort();
    let faults: Vec<String> = inputs
        .iter()
        .filter(|input| EMPTY.iter().all(|name| !input.ends_with(name)))
        .flat_map(|input| BOTH_WAYS.map(|way| (input, way)))
        .filter_map(|(input, way)| {
            let fault = fault(input, way)?;
            Some(format!("{} {way:?}: {fault}", input.display()))
        })
        .collect();
    assert!(
        faults.is_empty(),
        "{} of {} fail:\n{}",
        faults.len(),
        inputs.len(),
        faults.join("\n")
    );
}

/// What goes wrong on the way, if anything does.
fn fault(input: &Path, way: &[&str]) -> Option<String> {
    let converted = match convert(input, way) {
        Ok(converted) => converted,
        Err(error) => return Some(format!("{error:#}")),
    };
    let verified =
        marquetry(&arguments!["verify", &converted.path, "--json", "-"]).and_then(Finished::json);
    let report = match verified {
        Ok(report) => report,
        Err(error) => return Some(format!("verify: {error:#}")),
    };
    if report["ok"] != Value::Bool(true) {
        return Some(format!("does not verify: {report}"));
    }
    // Nothing is lost silently: what was left out has a reason.
    let lost = &converted.report["lost"];
    let reasons = lost["reason"].as_array().map_or(0, Vec::len);
    match lost["triangles"].as_u64() {
        Some(0) => None,
        Some(_) if reasons > 0 => None,
        _ => Some(format!("lost without a reason: {lost}")),
    }
}
