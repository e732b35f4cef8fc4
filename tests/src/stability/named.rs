//! Cases that are tests already: their own executables run them, one by one.

use super::{Case, Found, Outcome, Part};
use anyhow::{Context, Result, anyhow, bail, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// A test: the folder of its package, `lib` or the name of its file there, its path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Test(
    pub(super) &'static str,
    pub(super) &'static str,
    pub(super) &'static str,
);

/// A test as a case: its part, its name, what is required, the test.
pub(super) type Named = (Part, &'static str, &'static str, Test);

/// Executables by the folder of their package and what they test.
type Executables = BTreeMap<(String, String), PathBuf>;

/// What `test` is about, as a case.
pub(super) fn case(part: Part, name: &str, required: &str, test: Test) -> Case {
    Case {
        part,
        set: None,
        name: name.to_owned(),
        required: required.to_owned(),
        run: Box::new(move |_| run(test)),
    }
}

/// Those of the tests that are in no source file, by name. What is renamed is noticed at once, and not when the report is made.
///
/// # Errors
/// When a source file cannot be read.
pub fn missing_tests() -> Result<Vec<String>> {
    let mut missing = Vec::new();
    for &(_, _, _, Test(package, target, path)) in super::elsewhere::NAMED {
        let folder = if target == "lib" { "src" } else { "tests" };
        let name = path.rsplit("::").next().unwrap_or(path);
        let text = format!("fn {name}()");
        if !is_in(&root().join(package).join(folder), &text)? {
            missing.push(format!("{package}, {target}: {path}"));
        }
    }
    Ok(missing)
}

/// Whether a file of `folder` or of one within holds `text`.
fn is_in(folder: &Path, text: &str) -> Result<bool> {
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        let is_found = if path.is_dir() {
            is_in(&path, text)?
        } else {
            path.extension().is_some_and(|extension| extension == "rs")
                && std::fs::read_to_string(&path)?.contains(text)
        };
        if is_found {
            return Ok(true);
        }
    }
    Ok(false)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn run(Test(package, target, path): Test) -> Result<Outcome> {
    static EXECUTABLES: OnceLock<Result<Executables, String>> = OnceLock::new();
    let executables = EXECUTABLES
        .get_or_init(|| executables().map_err(|error| format!("{error:#}")))
        .as_ref()
        .map_err(|error| anyhow!("{error}"))?;
    let executable = executables
        .get(&(package.to_owned(), target.to_owned()))
        .with_context(|| format!("{package} has no test {target}"))?;
    let finished = Command::new(executable)
        .current_dir(root().join(package))
        .args([path, "--exact", "--include-ignored", "--show-output"])
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {}", executable.display()))?;
    let said = String::from_utf8_lossy(&finished.stdout).into_owned()
        + &String::from_utf8_lossy(&finished.stderr);
    if !finished.status.success() {
        let words = said.lines().find(|line| line.contains("panicked at"));
        bail!("{path} fails: {}", words.unwrap_or("see its output"));
    }
    ensure!(said.contains("1 passed"), "there is no test {path}");
    if let Some(why) = said.lines().find_map(|line| line.strip_prefix("ignored: ")) {
        return Ok(Outcome::Ignored(why.to_owned()));
    }
    Ok(Outcome::Met(Found {
        words: format!("`{}` passes", path.rsplit("::").next().unwrap_or(path)),
        ..Found::default()
    }))
}

/// Test executables by package and target, built if need be, from what cargo says. The features are those of `cargo xtask test`.
fn executables() -> Result<Executables> {
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(root())
        .args(["test", "--no-run", "--release", "--workspace"])
        .args(["--exclude", "xtask", "--message-format=json"])
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo")?;
    ensure!(output.status.success(), "the tests cannot be built");
    let root = root().canonicalize()?;
    let mut found = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let (Some(executable), Some(manifest), Some(name)) = (
            message["executable"].as_str(),
            message["manifest_path"].as_str(),
            message["target"]["name"].as_str(),
        ) else {
            continue;
        };
        if message["profile"]["test"] != Value::Bool(true) {
            continue;
        }
        let is_library = message["target"]["kind"]
            .as_array()
            .is_some_and(|kinds| kinds.iter().any(|kind| kind != "test" && kind != "bin"));
        let folder = Path::new(manifest)
            .parent()
            .and_then(|folder| folder.strip_prefix(&root).ok())
            .with_context(|| format!("{manifest} is not of this workspace"))?;
        let target = if is_library { "lib" } else { name };
        found.insert(
            (folder.display().to_string(), target.to_owned()),
            PathBuf::from(executable),
        );
    }
    Ok(found)
}
