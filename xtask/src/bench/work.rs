//! The work on one scan by one binary, and what it took.

use super::table::{Kind, Value};
use anyhow::{Context, Result, bail, ensure};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Times that short commands are repeated, since the system counts processor time in hundredths of a second.
const DECODINGS: usize = 5;
const CUTS: usize = 3;

/// Ticks of a second in `/proc`, on all of Linux.
const TICKS: f64 = 100.0;

/// A binary and a folder for its files.
#[derive(Debug)]
pub(super) struct Subject {
    folder: PathBuf,
    binary: PathBuf,
}

impl Subject {
    /// Makes the folder.
    pub(super) fn new(folder: &Path, binary: &Path) -> Result<Self> {
        ensure!(binary.is_file(), "{} is not built", binary.display());
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(Self {
            folder: folder.to_path_buf(),
            binary: binary.to_path_buf(),
        })
    }

    /// Converts `scan`, decodes the file and cuts it: what differs from run to run, and what comes along.
    pub(super) fn timed(&self, scan: &Path) -> Result<Vec<Value>> {
        let mut values = Values::of(scan)?;
        let [marq, mesh] = [self.file("marq"), self.file("ply")];
        let arguments = [
            s("convert"),
            p(scan),
            s("-o"),
            p(&marq),
            s("--json"),
            s("-"),
        ];
        let (report, seconds) = self.json(&arguments)?;
        let number = |pointer| number(&report, pointer);
        values.put("convert, time", Kind::Seconds, seconds);
        values.put("convert, memory", Kind::Memory, number("/peak_rss_bytes")?);
        values.put("bytes", Kind::Count, number("/output/bytes")?);
        values.put("RMS", Kind::Distance, number("/error/rms_rel")?);
        values.put("bound", Kind::Distance, number("/error/max_rel")?);

        let mut seconds = 0.0;
        for _ in 0..DECODINGS {
            seconds += self.run(&[s("verify"), p(&marq)])?.1;
        }
        values.put("decode, time", Kind::Seconds, seconds);

        let tenth = tenth_of(number("/input/triangles")?);
        let cut = [
            s("export"),
            p(&marq),
            s("-o"),
            p(&mesh),
            s("--triangles"),
            s(&tenth),
        ];
        let mut seconds = 0.0;
        for _ in 0..CUTS {
            seconds += self.run(&cut)?.1;
        }
        values.put("cut, time", Kind::Seconds, seconds);
        Ok(values.all)
    }

    /// What is the same in every run, of the file that [`Self::timed`] left: how far a cut is from the source, and what is drawn.
    pub(super) fn counted(&self, scan: &Path) -> Result<Vec<Value>> {
        let mut values = Values::of(scan)?;
        let [marq, picture] = [self.file("marq"), self.file("png")];
        let measure = |rest: &[&OsStr]| {
            let mut arguments = vec![s("measure"), p(&marq), s("--against"), p(scan)];
            arguments.extend([s("--samples"), s("100000"), s("--json"), s("-")]);
            arguments.extend(rest);
            self.json(&arguments)
        };
        let (info, _) = self.json(&[s("info"), p(&marq), s("--json"), s("-")])?;
        let tenth = tenth_of(number(&info, "/source/triangles")?);
        let (report, _) = measure(&[s("--triangles"), s(&tenth)])?;
        values.put("cut, RMS", Kind::Distance, number(&report, "/rms_rel")?);

        for distance in ["2.5", "0.8"] {
            let mut arguments = vec![s("render"), p(&marq), s("-o"), p(&picture)];
            arguments.extend(["--view", "14", "--size", "900x600", "--distance", distance].map(s));
            arguments.extend([s("--json"), s("-")]);
            let (report, _) = self.json(&arguments)?;
            for (what, pointer) in [
                ("triangles", "/triangles"),
                ("nodes", "/nodes"),
                ("bytes fetched", "/pages/bytes"),
            ] {
                let name = format!("render from {distance}, {what}");
                values.put(&name, Kind::Count, number(&report, pointer)?);
            }
        }
        Ok(values.all)
    }

    fn file(&self, extension: &str) -> PathBuf {
        self.folder.join("a").with_extension(extension)
    }

    fn json(&self, arguments: &[&OsStr]) -> Result<(serde_json::Value, f64)> {
        let (text, seconds) = self.run(arguments)?;
        let report = serde_json::from_str(&text).context("the report is no JSON")?;
        Ok((report, seconds))
    }

    /// Runs the binary to its end. Returns its standard output and its processor time.
    fn run(&self, arguments: &[&OsStr]) -> Result<(String, f64)> {
        let before = children_seconds()?;
        let output = Command::new(&self.binary)
            .args(arguments)
            .stdin(Stdio::null())
            .output()
            .with_context(|| format!("cannot start {}", self.binary.display()))?;
        if !output.status.success() {
            bail!(
                "{} {:?} ended with {}:\n{}",
                self.binary.display(),
                arguments,
                output.status,
                String::from_utf8_lossy(&output.stderr)
            );
        }
        let seconds = children_seconds()? - before;
        Ok((
            String::from_utf8_lossy(&output.stdout).into_owned(),
            seconds,
        ))
    }
}

/// Values of one scan.
struct Values {
    stem: String,
    all: Vec<Value>,
}

impl Values {
    fn of(scan: &Path) -> Result<Self> {
        let name = scan.file_name().context("a scan without a name")?;
        let name = name.to_string_lossy();
        Ok(Self {
            stem: name.split('.').next().unwrap_or_default().to_owned(),
            all: Vec::new(),
        })
    }

    fn put(&mut self, what: &str, kind: Kind, amount: f64) {
        self.all.push(Value {
            name: format!("{}: {what}", self.stem),
            kind,
            amount,
        });
    }
}

fn tenth_of(triangles: f64) -> String {
    (triangles / 10.0).floor().to_string()
}

fn s(text: &str) -> &OsStr {
    OsStr::new(text)
}

fn p(path: &Path) -> &OsStr {
    path.as_os_str()
}

fn number(report: &serde_json::Value, pointer: &str) -> Result<f64> {
    report
        .pointer(pointer)
        .and_then(serde_json::Value::as_f64)
        .with_context(|| format!("no {pointer} in {report}"))
}

/// Processor time, user and system, of all children that have ended. Limit: Linux.
fn children_seconds() -> Result<f64> {
    let text = std::fs::read_to_string("/proc/self/stat")
        .context("no /proc, which tells processor time")?;
    seconds_of(&text).with_context(|| format!("/proc/self/stat says {text}"))
}

/// Fields 16 and 17; the second field is a name in brackets, which may hold anything.
fn seconds_of(stat: &str) -> Option<f64> {
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace().skip(13);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / TICKS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_children_are_found_behind_any_name() {
        let stat = "12 (a) b) S 1 2 3 4 5 6 7 8 9 10 11 12 250 50 20 0";
        assert_eq!(seconds_of(stat), Some(3.0));
        assert_eq!(seconds_of("12 (a) S 1"), None);
    }

    #[test]
    fn work_of_a_child_is_counted() {
        let before = children_seconds().unwrap();
        let script = "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done";
        let ended = Command::new("sh").args(["-c", script]).status().unwrap();
        assert!(ended.success());
        assert!(children_seconds().unwrap() > before);
    }
}
