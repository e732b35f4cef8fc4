//! Runs the stability list and prints what came of each case; `cargo xtask stability` builds it and calls it.
//!
//! `stability [--list] [--record FILE] [--write FILE] [WORDS...]`: only cases that have all the words in their part or name. What is in the
//! record, a line of JSON a case, is not run again; what is run is put there at once, so that a run that is cut off can be taken up.

use anyhow::{Context, Result, bail};
use marquetry_tests::stability::{Depth, Row, Tally, catalogue, document};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> Result<ExitCode> {
    let (mut words, mut write, mut record, mut lists) = (Vec::new(), None, None, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut file = || arguments.next().map(PathBuf::from);
        match argument.as_str() {
            "--list" => lists = true,
            "--write" => write = Some(file().context("--write FILE")?),
            "--record" => record = Some(file().context("--record FILE")?),
            _ => words.push(argument),
        }
    }
    let mut cases = catalogue();
    cases.retain(|case| case.is_named(&words));
    if cases.is_empty() {
        bail!("no case is named {}", words.join(" "));
    }
    if lists {
        for case in &cases {
            println!("{}: {} ({})", case.part.name(), case.name, case.required);
        }
        return Ok(ExitCode::SUCCESS);
    }
    let known = record.as_deref().map_or(Ok(Vec::new()), recorded)?;
    let mut rows = Vec::new();
    for case in &cases {
        let same = |row: &&Row| (row.part, &row.name) == (case.part, &case.name);
        if let Some(row) = known.iter().find(same) {
            rows.push(row.clone());
            continue;
        }
        let row = case.row(Depth::Whole);
        println!("{}", row.line());
        if let Some(path) = &record {
            let mut file = std::fs::OpenOptions::new()
                .create(true)
                .append(true)
                .open(path)
                .with_context(|| path.display().to_string())?;
            writeln!(file, "{}", row.to_json())?;
        }
        rows.push(row);
    }
    let tally = Tally::of(&rows);
    println!("{tally}");
    if let Some(path) = write {
        std::fs::write(&path, document(&rows)).with_context(|| path.display().to_string())?;
        println!("written: {}", path.display());
    }
    Ok(if tally.missed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// What an earlier run has left.
fn recorded(path: &Path) -> Result<Vec<Row>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    text.lines().map(Row::from_json).collect()
}
