//! A server under test: a child process, what it costs, its end.

use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Ticks of `/proc/PID/stat` in a second; Linux has shown user space this number on all machines for decades.
const TICKS_A_SECOND: f64 = 100.0;

/// A running server, killed when dropped.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    pub(crate) address: SocketAddr,
}

impl Process {
    /// Starts `marquetry serve` as `command` says, and waits until it listens.
    pub(crate) fn marquetry(command: &mut Command) -> Result<Self> {
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .context("cannot start marquetry")?;
        let output = child.stdout.take().context("no output")?;
        let mut line = String::new();
        BufReader::new(output)
            .read_line(&mut line)
            .context("cannot read what marquetry says")?;
        let Some(address) = line.trim().strip_prefix("listening on http://") else {
            bail!("marquetry does not listen: {line:?}");
        };
        Ok(Self {
            address: address.parse().context("no address")?,
            child,
        })
    }

    /// Takes a server that will listen on `address`, and waits until it does.
    pub(crate) fn at(mut child: Child, address: SocketAddr) -> Result<Self> {
        let start = Instant::now();
        while std::net::TcpStream::connect(address).is_err() {
            if let Some(status) = child.try_wait().context("cannot watch a server")? {
                bail!("the server ended with {status}");
            }
            if start.elapsed() > Duration::from_secs(20) {
                bail!("the server does not listen on {address}");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(Self { child, address })
    }

    /// Ends it at once, as `kill -9` does.
    pub(crate) fn kill(mut self) -> Result<()> {
        self.child.kill().context("cannot kill a server")?;
        self.child.wait().context("cannot kill a server")?;
        Ok(())
    }

    /// Processor time so far of the process and its children, in seconds.
    pub(crate) fn cpu_seconds(&self) -> f64 {
        let own = self.child.id();
        let mut ticks = 0;
        for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
            let Some(id) = entry
                .file_name()
                .to_str()
                .and_then(|name| name.parse().ok())
            else {
                continue;
            };
            if let Some((parent, spent)) = stat(id)
                && (id == own || parent == own)
            {
                ticks += spent;
            }
        }
        ticks as f64 / TICKS_A_SECOND
    }

    /// Memory in use, bytes.
    pub(crate) fn resident_bytes(&self) -> u64 {
        let path = format!("/proc/{}/status", self.child.id());
        let status = std::fs::read_to_string(path).unwrap_or_default();
        let kib = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"))
            .and_then(|kib| kib.parse::<u64>().ok());
        kib.unwrap_or(0) * 1024
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // nginx ends its workers on SIGTERM only.
        let id = self.child.id().to_string();
        let _ = Command::new("kill").args(["-TERM", &id]).status();
        for _ in 0..40 {
            if matches!(self.child.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Parent and processor ticks of a process.
fn stat(id: u32) -> Option<(u32, u64)> {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // The name stands in parentheses and may hold anything.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let number = |place: usize| fields.get(place)?.parse::<u64>().ok();
    Some((u32::try_from(number(1)?).ok()?, number(11)? + number(12)?))
}
