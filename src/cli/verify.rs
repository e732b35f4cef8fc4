//! `marquetry verify`: everything a reader relies on.

use super::output::Output;
use super::{Verdict, open};
use marquetry_format::verify::{self, Check, Report};

/// Check everything a reader relies on; exit 1 and a list if anything fails
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
}

pub(super) fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<Verdict> {
    let source = open::source(&arguments.file)?;
    let report = match verify::verify(source.as_ref()) {
        Ok(report) => report,
        Err(error) => not_even_opened(open::explain(&arguments.file, &error).to_string()),
    };
    for check in &report.checks {
        let verdict = if check.ok { "ok" } else { "FAILED" };
        output.say(&format!("{verdict:6}  {} ({})", check.name, check.count));
        for failure in &check.failures {
            output.say(&format!("          {failure}"));
        }
    }
    output.report(&report)?;
    if report.ok {
        return Ok(Verdict::Good);
    }
    let failed: Vec<&Check> = report.checks.iter().filter(|check| !check.ok).collect();
    let first = failed
        .iter()
        .find_map(|check| Some(format!("{}: {}", check.name, check.failures.first()?)));
    super::output::complain(&format!(
        "error: {}: {} of {} checks failed ({}); convert its input again, or copy the file again",
        arguments.file,
        failed.len(),
        report.checks.len(),
        first.unwrap_or_default()
    ));
    Ok(Verdict::Bad)
}

/// A file whose front is not valid fails one check; there is nothing to run the others on.
fn not_even_opened(failure: String) -> Report {
    Report {
        ok: false,
        checks: vec![Check {
            name: "open".to_owned(),
            ok: false,
            count: 1,
            failures: vec![failure],
        }],
    }
}
