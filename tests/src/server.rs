//! Running `marquetry serve`.

use crate::{arguments, binary};
use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Child;
use std::sync::mpsc;
use std::time::Duration;

/// Longest that the server may take to be ready.
const READY_LIMIT: Duration = Duration::from_secs(20);

/// A server, stopped when this is dropped.
#[derive(Debug)]
pub struct Server {
    child: Child,
    /// Host and port.
    pub authority: String,
}

impl Server {
    /// Serves `paths` on a free port and waits until it is ready.
    ///
    /// # Errors
    /// When it does not start or does not say where it listens.
    pub fn start(paths: &[&Path]) -> Result<Self> {
        let mut arguments = arguments!["serve", "--listen", "127.0.0.1:0"];
        arguments.extend(paths.iter().map(OsString::from));
        let mut child = binary::spawn(&arguments)?;
        let stdout = child.stdout.take().context("no standard output")?;
        let stderr = child.stderr.take().context("no standard error")?;
        // From here on a failure stops the child.
        let mut server = Self {
            child,
            authority: String::new(),
        };

        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            // Reads to the end: a server whose pipe is full would stand still.
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if let Some((_, authority)) = line.split_once("listening on http://") {
                    // Nobody waits any longer once the first line has come.
                    let _ = sender.send(authority.trim().trim_end_matches('/').to_owned());
                }
            }
        });
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                eprintln!("server: {line}");
            }
        });
        match receiver.recv_timeout(READY_LIMIT) {
            Ok(authority) => server.authority = authority,
            Err(mpsc::RecvTimeoutError::Timeout) => {
                bail!("the server is not ready in {} s", READY_LIMIT.as_secs())
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                bail!("the server ended before it was ready")
            }
        }
        Ok(server)
    }

    /// The URL of `path`, which begins with a slash.
    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.authority)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing to stop.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
