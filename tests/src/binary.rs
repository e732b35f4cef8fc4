//! Running the `marquetry` binary, with a time limit and with everything it says.

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::ffi::OsString;
use std::io::Read;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Names the binary under test; without it, the one beside the running test is taken.
pub const BINARY_VARIABLE: &str = "MARQUETRY_BINARY";

/// Longest that one run may take.
pub const TIME_LIMIT: Duration = Duration::from_mins(10);

/// Arguments of the binary: text and paths, mixed.
#[macro_export]
macro_rules! arguments {
    ($($argument:expr),* $(,)?) => {
        ::std::vec::Vec::<::std::ffi::OsString>::from([$(::std::ffi::OsString::from($argument)),*])
    };
}

/// What a run left behind.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Finished {
    /// Asserts success.
    ///
    /// # Errors
    /// With what the run said.
    pub fn succeeded(self) -> Result<Self> {
        ensure!(
            self.code == Some(0),
            "exit code {:?}, standard error:\n{}",
            self.code,
            self.stderr
        );
        Ok(self)
    }

    /// Standard output as JSON.
    ///
    /// # Errors
    /// When the run failed or wrote anything else.
    pub fn json(self) -> Result<Value> {
        let stdout = self.succeeded()?.stdout;
        serde_json::from_str(&stdout)
            .with_context(|| format!("standard output is no JSON:\n{stdout}"))
    }

    /// Whether something panicked, caught or not.
    pub fn panicked(&self) -> bool {
        let words = ["panicked at", "internal error"];
        self.code == Some(101) || words.iter().any(|word| self.stderr.contains(word))
    }
}

/// The binary under test.
///
/// # Errors
/// When it is not built.
pub fn path() -> Result<PathBuf> {
    if let Some(path) = std::env::var_os(BINARY_VARIABLE) {
        let path = PathBuf::from(path);
        ensure!(
            path.is_file(),
            "{BINARY_VARIABLE} names {}, which is no file",
            path.display()
        );
        return Ok(path);
    }
    let test = std::env::current_exe().context("cannot find the running test")?;
    // target/PROFILE/deps/TEST
    let profile = test
        .parent()
        .and_then(|deps| deps.parent())
        .context("the test lies in no target folder")?;
    let path = profile.join(format!("marquetry{}", std::env::consts::EXE_SUFFIX));
    let flag = if profile.ends_with("release") {
        " --release"
    } else {
        ""
    };
    ensure!(
        path.is_file(),
        "{} is not built: run `cargo build{flag}`, or name another binary in {BINARY_VARIABLE}",
        path.display()
    );
    Ok(path)
}

/// Starts the binary with its output piped.
///
/// # Errors
/// When it is not built or cannot be started.
pub fn spawn(arguments: &[OsString]) -> Result<Child> {
    let path = path()?;
    Command::new(&path)
        .args(arguments)
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {}", path.display()))
}

/// Runs the binary to its end, but no longer than [`TIME_LIMIT`].
///
/// # Errors
/// When it cannot be started or does not end in time; a failing exit code is no error here.
pub fn marquetry(arguments: &[OsString]) -> Result<Finished> {
    let mut child = spawn(arguments)?;
    let stdout = collect(child.stdout.take());
    let stderr = collect(child.stderr.take());
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().context("cannot wait for marquetry")? {
            break status;
        }
        if start.elapsed() > TIME_LIMIT {
            child.kill().context("cannot stop marquetry")?;
            child.wait().context("cannot wait for marquetry")?;
            let words: Vec<_> = arguments.iter().map(|a| a.to_string_lossy()).collect();
            bail!(
                "`marquetry {}` did not end within {TIME_LIMIT:?}",
                words.join(" ")
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    Ok(Finished {
        code: status.code(),
        stdout: joined(stdout)?,
        stderr: joined(stderr)?,
    })
}

/// Reads on a thread of its own, so that a full pipe never blocks the child.
fn collect(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<std::io::Result<Vec<u8>>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            pipe.read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    })
}

fn joined(reader: JoinHandle<std::io::Result<Vec<u8>>>) -> Result<String> {
    let Ok(bytes) = reader.join() else {
        bail!("reading the output panicked")
    };
    Ok(String::from_utf8_lossy(&bytes.context("cannot read the output")?).into_owned())
}
