//! `cargo xtask bench`: what two revisions take for the same work, as ratios.
//!
//! Both binaries run on this machine, in turns, so that what slows it slows both. Times are processor time, medians over the turns; bytes,
//! errors and what is drawn are the same in every run and are counted once. A loss of more than a tenth fails.

mod baseline;
mod section;
mod table;
mod work;

use crate::{ensure, process, project::Project, test};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use table::Quantity;
use work::Subject;

/// Turns of both binaries, and as many again where a time seems lost.
const TURNS: usize = 5;

/// Scans that are worked on, of `../shared/data`: with holes, closed, large, and with an image.
const SCANS: [&str; 4] = [
    "bun_zipper.ply",
    "armadillo_86k.obj.gz",
    "dragon_vrip.ply",
    "textured_meshroom/texturedMesh.obj",
];

/// Measures against `revision`, or against what [`baseline::default`] says, and writes the record into `docs/measurements.md`.
///
/// # Errors
/// When something cannot be built or run, and when there is a loss.
pub(crate) fn run(project: &Project, revision: Option<&str>) -> Result<()> {
    let scans = SCANS.map(|scan| project.root.join("../shared/data").join(scan));
    for scan in &scans {
        ensure(scan.is_file(), || {
            format!(
                "{} is not there: the record is of these scans alone",
                scan.display()
            )
        })?;
    }
    let revision = match revision {
        Some(revision) => revision.to_owned(),
        None => baseline::default(project)?,
    };
    let before = baseline::build(project, &revision)?;
    // With examples, for the features of all other builds: with binaries alone everything would be built a second time.
    test::build_native(project, &["--bins", "--examples"])?;
    let folder = project.target.join("bench/work");
    let subject = |name: &str, binary: &Path| Subject::new(&folder.join(name), binary);
    let subjects = [
        subject("before", &before.binary)?,
        subject("after", &project.binary())?,
    ];
    let mut quantities = Vec::new();
    for scan in &scans {
        println!("  {}", scan.display());
        quantities.extend(measured(&subjects, scan)?);
    }
    let present = baseline::present(project)?;
    let text = table::record(&before.name, &present, &quantities);
    println!("\n{text}");
    write(&project.root.join("docs/measurements.md"), &text)?;
    let lost: Vec<&str> = quantities
        .iter()
        .filter(|quantity| quantity.verdict() == table::Verdict::Lost)
        .map(|quantity| quantity.name.as_str())
        .collect();
    if !lost.is_empty() {
        bail!("a loss of more than a tenth: {}", lost.join(", "));
    }
    Ok(())
}

/// Works on one scan in turns; once more where a time is above what is allowed.
fn measured(subjects: &[Subject; 2], scan: &Path) -> Result<Vec<Quantity>> {
    let mut quantities: Vec<Quantity> = Vec::new();
    for round in 0..2 {
        for turn in 0..TURNS {
            // Neither is always the first.
            let order = if turn % 2 == 0 { [0, 1] } else { [1, 0] };
            let mut values = [Vec::new(), Vec::new()];
            for side in order {
                values[side] = subjects[side].timed(scan)?;
            }
            let [before, after] = values;
            table::add(&mut quantities, before, after)?;
        }
        if !quantities.iter().any(Quantity::seems_lost) {
            break;
        }
        if round == 0 {
            println!("    a time seems lost; {TURNS} turns more");
        }
    }
    let mut counted = Vec::new();
    let [before, after] = subjects.each_ref().map(|subject| subject.counted(scan));
    table::add(&mut counted, before?, after?)?;
    quantities.extend(counted);
    Ok(quantities)
}

fn write(path: &PathBuf, text: &str) -> Result<()> {
    let old =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    std::fs::write(path, section::replaced(&old, text)?)
        .with_context(|| format!("cannot write {}", path.display()))?;
    println!("  written: {}", path.display());
    Ok(())
}

/// What git says.
fn git(project: &Project, arguments: &[&str]) -> Result<String> {
    let mut command = std::process::Command::new("git");
    let text = process::output(command.current_dir(&project.root).args(arguments))?;
    Ok(text.trim().to_owned())
}
