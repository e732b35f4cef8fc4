//! What a run says, to people and to programs.

use anyhow::Context;
use marquetry_converter::output::PendingFile;
use serde::Serialize;
use std::convert::Infallible;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Where the machine-readable report goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum JsonTarget {
    Stdout,
    File(PathBuf),
}

impl FromStr for JsonTarget {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "-" => Self::Stdout,
            path => Self::File(path.into()),
        })
    }
}

/// Speaks to people on standard output, or on standard error where there is a report for programs.
#[derive(Debug)]
pub(super) struct Output {
    json: Option<JsonTarget>,
}

impl Output {
    pub(super) fn new(json: Option<JsonTarget>) -> Self {
        Self { json }
    }

    /// Says a line, or several.
    pub(super) fn say(&self, text: &str) {
        if self.json.is_some() {
            complain(text);
        } else {
            // A reader that went away (`| head`) is no error.
            let _ = writeln!(io::stdout().lock(), "{text}");
        }
    }

    /// Writes the report, if one was asked for.
    pub(super) fn report(&self, report: &impl Serialize) -> anyhow::Result<()> {
        let Some(target) = &self.json else {
            return Ok(());
        };
        let json = serde_json::to_string_pretty(report)?;
        match target {
            JsonTarget::Stdout => {
                writeln!(io::stdout().lock(), "{json}").context("cannot write the report")
            }
            JsonTarget::File(path) => write_file(path, |out| writeln!(out, "{json}")),
        }
    }
}

/// Says `text` on standard error.
pub(super) fn complain(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// An error and its causes, each once: those that a message quotes are not said again.
pub(super) fn with_causes(error: &anyhow::Error) -> String {
    let mut causes = error.chain().map(ToString::to_string);
    let mut text = causes.next().unwrap_or_default();
    for cause in causes.filter(|cause| !cause.is_empty()) {
        if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    text
}

/// Writes a file that appears under its name complete, or not at all.
pub(super) fn write_file(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> anyhow::Result<()> {
    let attempt = || {
        let mut file = PendingFile::create(path)?;
        let mut out = io::BufWriter::new(file.as_file_mut());
        write(&mut out)?;
        out.flush()?;
        drop(out);
        file.persist()
    };
    attempt().with_context(|| format!("{}: cannot be written", path.display()))
}

/// A number of bytes, for people.
pub(super) fn bytes(count: u64) -> String {
    indicatif::BinaryBytes(count).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_said_once() {
        let cause = io::Error::other("disk full");
        let quoted = format!("a.ply: cannot be read: {cause}");
        let error = anyhow::Error::new(cause).context(quoted).context("convert");
        assert_eq!(
            with_causes(&error),
            "convert: a.ply: cannot be read: disk full"
        );
    }

    #[test]
    fn a_file_that_fails_half_way_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let result = write_file(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(format!("{:#}", result.unwrap_err()).contains("disk full"));
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn an_existing_file_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, b"old").unwrap();
        write_file(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }
}
