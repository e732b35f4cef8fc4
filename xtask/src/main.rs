//! Tasks of the project: `cargo xtask COMMAND`.
//!
//! Each command sets up what it misses, says what it does and how long that may take, and repeats nothing
//! that is up to date.

mod bench;
mod bless;
mod browser;
mod conformance;
mod decoding;
mod demo;
mod fuzz;
mod layering;
mod package;
mod process;
mod project;
mod setup;
mod stability;
mod steps;
mod test;
mod tools;
mod traffic;
mod wasm;
mod web;

use anyhow::{Context, Result, bail};
use project::Project;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  demo [PATH]   build everything, convert a scan (the Stanford dragon, or PATH) and serve it
  test          everything that is checked, as CI does
  web           build the viewer for the browser into web-viewer/web/dist, and its npm package
  browser       only the browser test, on what is built
  layering      check that the crates know only whom they may
  bless         write the golden files anew from the present code
  setup-tests   install what tests need from PyPI and npm: object stores, HTTP checkers, another measure of distances
  stability [WORDS]
                every case that methods fail on, into docs/stability.md, or those with all WORDS in their names
  bench [REVISION]
                what conversion, decoding, cuts and frames take beside REVISION, into docs/measurements.md
  bench-decode FILE...
                how fast files decode on one thread, natively and in wasm
  bench-server [FILE]
                throughput beside nginx, slow clients, 10 000 idle connections (5 minutes)
  soak [REQUESTS]
                a million requests while sources fail and the server is killed
  fuzz [SECONDS]
                every fuzz target, for so long each (60 s)
  conformance   HTTP/2 and header checks of the server by other people's tools";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match dispatch(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(arguments: &[String]) -> Result<ExitCode> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = |()| ExitCode::SUCCESS;
    match words.as_slice() {
        ["demo"] => demo::run(&Project::locate()?, None).map(done),
        ["demo", path] => demo::run(&Project::locate()?, Some(PathBuf::from(path))).map(done),
        ["test"] => Ok(test::run(&Project::locate()?)),
        ["web"] => web::build(&Project::locate()?).map(done),
        ["browser"] => browser::run(&Project::locate()?).map(done),
        ["layering"] => layering::check(&Project::locate()?).map(done),
        ["setup-tests"] => setup::ensure(&[setup::Need::Python, setup::Need::Node])
            .and_then(|()| tools::install(&Project::locate()?))
            .map(done),
        ["stability", words @ ..] => stability::run(&Project::locate()?, words).map(done),
        ["bench"] => bench::run(&Project::locate()?, None).map(done),
        ["bench", revision] => bench::run(&Project::locate()?, Some(revision)).map(done),
        ["bench-decode", files @ ..] => decoding::run(&Project::locate()?, files).map(done),
        ["bench-server"] => traffic::bench::run(&Project::locate()?, None).map(done),
        ["bench-server", file] => {
            traffic::bench::run(&Project::locate()?, Some(Path::new(file))).map(done)
        }
        ["soak"] => traffic::soak::run(&Project::locate()?, traffic::soak::REQUESTS).map(done),
        ["soak", requests] => {
            let requests = requests
                .parse()
                .context("soak takes a number of requests")?;
            traffic::soak::run(&Project::locate()?, requests).map(done)
        }
        ["fuzz"] => fuzz::run(&Project::locate()?, fuzz::SECONDS).map(done),
        ["fuzz", seconds] => {
            let seconds = seconds.parse().context("fuzz takes a number of seconds")?;
            fuzz::run(&Project::locate()?, seconds).map(done)
        }
        ["conformance"] => conformance::run(&Project::locate()?).map(done),
        ["bless"] => bless::run(&Project::locate()?).map(done),
        ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            Ok(ExitCode::SUCCESS)
        }
        [] => {
            eprintln!("{USAGE}");
            Ok(ExitCode::from(2))
        }
        _ => {
            eprintln!("unknown command: {}\n\n{USAGE}", words.join(" "));
            Ok(ExitCode::from(2))
        }
    }
}

/// Fails with `message` unless `condition` holds.
fn ensure(condition: bool, message: impl FnOnce() -> String) -> Result<()> {
    if condition { Ok(()) } else { bail!(message()) }
}
