//! A list of checks: announced, timed, summed up.

use anyhow::Result;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// How a check that found nothing wrong ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Everything was checked.
    Passed,
    /// This machine cannot run the check; why, and what to install.
    Skipped(String),
}

#[derive(Debug)]
enum Ending {
    Passed,
    Skipped(String),
    Failed(String),
}

#[derive(Debug)]
struct Record {
    name: &'static str,
    ending: Ending,
    time: Duration,
}

/// The checks run so far.
#[derive(Debug, Default)]
pub(crate) struct Steps {
    records: Vec<Record>,
}

impl Steps {
    /// Announces and runs one check. `expected` is its time on two cores from nothing, in words.
    ///
    /// Returns whether it passed, so that what builds on it can be left out.
    pub(crate) fn run(
        &mut self,
        name: &'static str,
        expected: &str,
        check: impl FnOnce() -> Result<Outcome>,
    ) -> bool {
        println!("\n== {name} (first time on two cores: {expected})");
        let start = Instant::now();
        let ending = match check() {
            Ok(Outcome::Passed) => Ending::Passed,
            Ok(Outcome::Skipped(why)) => Ending::Skipped(why),
            Err(error) => Ending::Failed(format!("{error:#}")),
        };
        let time = start.elapsed();
        match &ending {
            Ending::Passed => println!("-- {name}: passed in {}", seconds(time)),
            Ending::Skipped(why) => println!("-- {name}: skipped: {why}"),
            Ending::Failed(why) => println!("-- {name}: FAILED after {}: {why}", seconds(time)),
        }
        let passed = matches!(ending, Ending::Passed);
        self.records.push(Record { name, ending, time });
        passed
    }

    /// Counts `name` as failed without running it, because `needs` did not pass.
    pub(crate) fn cannot_run(&mut self, name: &'static str, needs: &str) {
        println!("\n== {name}\n-- {name}: FAILED: needs the step '{needs}'");
        let ending = Ending::Failed(format!("not run: needs the step '{needs}'"));
        self.records.push(Record {
            name,
            ending,
            time: Duration::ZERO,
        });
    }

    /// Prints the table and the closing line.
    pub(crate) fn finish(self) -> ExitCode {
        println!("\n== summary");
        let mut total = Duration::ZERO;
        let (mut passed, mut failed) = (0, 0);
        for Record { name, ending, time } in &self.records {
            total += *time;
            let (mark, note) = match ending {
                Ending::Passed => {
                    passed += 1;
                    ("passed ", "")
                }
                Ending::Skipped(why) => ("skipped", why.as_str()),
                Ending::Failed(why) => {
                    failed += 1;
                    ("FAILED ", why.as_str())
                }
            };
            println!(
                "{mark} {:>9}  {name}{}{note}",
                seconds(*time),
                if note.is_empty() { "" } else { ": " }
            );
        }
        println!("        {:>9}  in all", seconds(total));
        println!("{passed} passed, {failed} failed");
        if failed == 0 {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        }
    }
}

fn seconds(time: Duration) -> String {
    let whole = time.as_secs();
    if whole >= 60 {
        format!("{} min {:02} s", whole / 60, whole % 60)
    } else {
        format!("{:.1} s", time.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_failure_fails_the_run() {
        let mut steps = Steps::default();
        assert!(steps.run("good", "1 s", || Ok(Outcome::Passed)));
        assert!(!steps.run("absent", "1 s", || Ok(Outcome::Skipped("no tool".into()))));
        assert!(!steps.run("bad", "1 s", || anyhow::bail!("wrong")));
        assert_eq!(
            format!("{:?}", steps.finish()),
            format!("{:?}", ExitCode::FAILURE)
        );
    }

    #[test]
    fn a_skipped_check_is_no_failure() {
        let mut steps = Steps::default();
        steps.run("absent", "1 s", || Ok(Outcome::Skipped("no tool".into())));
        assert_eq!(
            format!("{:?}", steps.finish()),
            format!("{:?}", ExitCode::SUCCESS)
        );
    }

    #[test]
    fn a_check_without_its_ground_fails() {
        let mut steps = Steps::default();
        steps.cannot_run("tests", "build");
        assert_eq!(
            format!("{:?}", steps.finish()),
            format!("{:?}", ExitCode::FAILURE)
        );
    }
}
