//! Everything that is checked. CI runs this and nothing else.

use crate::setup::{self, Need};
use crate::steps::{Outcome, Steps};
use crate::wasm::Toolchain;
use crate::{browser, conformance, layering, process, project::Project, tools, web};
use anyhow::{Context, Result, bail};
use std::process::{Command, ExitCode};

/// Runs every check, whatever fails before, and sums up.
pub(crate) fn run(project: &Project) -> ExitCode {
    println!("All checks: about 40 minutes on two cores the first time, 15 minutes after that.");
    let mut steps = Steps::default();
    steps.run("compiler", "1 s", || {
        setup::ensure(&[Need::Compiler]).map(passed)
    });
    // What is downloaded and unpacked leaves a processor to what needs nothing of it.
    let set_up = std::thread::scope(|scope| {
        let under_way = scope.spawn(|| set_up(project));
        without_set_up(project, &mut steps);
        let ended = || under_way.join().unwrap_or_else(|_| bail!("it panicked"));
        steps.run("set-up", "what is left of 1 to 3 min", ended)
    });
    if set_up {
        steps.run("clippy for wasm32", "1 min", || clippy_wasm(project));
        steps.run("web build", "3 to 8 min", || {
            web::build(project).map(passed)
        });
    } else {
        steps.cannot_run("web build", "set-up");
    }
    // As the tests want them: what they ask of their dependencies would have these built a second time otherwise.
    let built = steps.run("native build", "12 to 15 min", || {
        build_native(project, &["--bins", "--examples", "--tests"]).map(passed)
    });
    if built {
        steps.run("tests", "10 to 20 min", || tests(project));
    } else {
        steps.cannot_run("tests", "native build");
    }
    steps.run("documentation", "1 min", || documentation(project));
    steps.run("dependencies", "5 s", || deny(project));
    if set_up {
        steps.run("spelling", "1 s", || typos(project));
    } else {
        steps.cannot_run("spelling", "set-up");
    }
    if built && set_up {
        steps.run("browser", "3 min", || browser::run(project).map(passed));
    } else {
        steps.cannot_run("browser", if built { "set-up" } else { "native build" });
    }
    if built && set_up {
        steps.run("HTTP conformance", "1 min", || {
            conformance::run(project).map(passed)
        });
    } else {
        steps.cannot_run(
            "HTTP conformance",
            if built { "set-up" } else { "native build" },
        );
    }
    steps.finish()
}

/// What needs cargo and a compiler alone.
fn without_set_up(project: &Project, steps: &mut Steps) {
    steps.run("formatting", "2 s", || {
        cargo(project, &["fmt", "--all", "--check"])
    });
    steps.run("layering", "5 s", || layering::check(project).map(passed));
    // The same profile everywhere: what one step compiles, the next finds.
    let clippy = "clippy --release --workspace --all-targets -- -D warnings";
    let arguments: Vec<&str> = clippy.split(' ').collect();
    steps.run("clippy", "4 min", || cargo(project, &arguments));
}

/// Builds the workspace for this machine, but for xtask: those `targets` of it.
///
/// # Errors
/// When cargo fails.
pub(crate) fn build_native(project: &Project, targets: &[&str]) -> Result<()> {
    let mut build = process::cargo(&project.root);
    process::run(
        build
            .args(["build", "--release"])
            .args(PRODUCT)
            .args(targets),
    )
}

/// All but xtask: what it alone asks of its dependencies would have these, which it is made of already, built a second time.
const PRODUCT: [&str; 3] = ["--workspace", "--exclude", "xtask"];

fn passed((): ()) -> Outcome {
    Outcome::Passed
}

fn cargo(project: &Project, arguments: &[&str]) -> Result<Outcome> {
    process::run(process::cargo(&project.root).args(arguments)).map(passed)
}

fn set_up(project: &Project) -> Result<Outcome> {
    setup::ensure(&[
        Need::Compiler,
        Need::Node,
        Need::Vulkan,
        Need::Chromium,
        Need::Wasm,
        Need::Python,
    ])?;
    setup::npm(&project.browser_test())?;
    tools::install(project)?;
    Ok(Outcome::Passed)
}

fn clippy_wasm(project: &Project) -> Result<Outcome> {
    let toolchain = Toolchain::find().context("no compiler for wasm32")?;
    if toolchain != Toolchain::Rustup {
        return Ok(Outcome::Skipped(
            "Debian's compiler has no clippy; the web build checks the types".into(),
        ));
    }
    process::run(
        toolchain
            .cargo(&project.root, "clippy")
            .args([
                "--profile",
                "web",
                "--package",
                "marquetry-web",
                "--target-dir",
            ])
            .arg(web::target(project, &toolchain))
            .args(["--", "-D", "warnings"]),
    )
    .map(passed)
}

fn tests(project: &Project) -> Result<Outcome> {
    let test = |packages: &[&str]| {
        process::run(
            process::cargo(&project.root)
                .args(["test", "--release", "--no-fail-fast"])
                .args(packages)
                .env("MARQUETRY_BINARY", project.binary()),
        )
    };
    let product = test(&PRODUCT);
    test(&["--package", "xtask"]).and(product).map(passed)
}

fn documentation(project: &Project) -> Result<Outcome> {
    process::run(
        process::cargo(&project.root)
            .args(["doc", "--release", "--workspace", "--no-deps"])
            .env("RUSTDOCFLAGS", "-D warnings"),
    )
    .map(passed)
}

fn deny(project: &Project) -> Result<Outcome> {
    if process::find("cargo-deny").is_none() {
        return Ok(Outcome::Skipped(
            "cargo-deny is not installed (cargo install --locked cargo-deny)".into(),
        ));
    }
    // The advisories come over a network that CI may not have; what the project itself decides does not.
    cargo(project, &["deny", "check", "bans", "licenses", "sources"])
}

fn typos(project: &Project) -> Result<Outcome> {
    let program = tools::python(project).join("bin/typos");
    process::run(Command::new(program).current_dir(&project.root)).map(passed)
}
