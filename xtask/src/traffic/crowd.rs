//! Many connections that do little: slow ones beside a fast one, and idle ones.

use super::client::{Client, request};
use super::median;
use super::process_of::Process;
use crate::{ensure, project::Project};
use anyhow::{Context, Result};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

const SLOW: usize = 300;
const IDLE: usize = 10_000;
/// Deadlines of the server in this measurement, in seconds.
const HEADER: u64 = 3;
const STALL: u64 = 4;
const ROUNDS: usize = 3;

/// 300 slow connections of four kinds: cut in time, while a fast client goes on.
pub(crate) fn slow(project: &Project, scan: &Path) -> Result<()> {
    let server = Process::marquetry(
        Command::new(project.binary())
            .arg("serve")
            .arg(scan)
            .args(["--listen", "127.0.0.1:0"])
            .env("MARQUETRY_SERVE_CONNECTIONS__HEADER", format!("{HEADER}s"))
            .env("MARQUETRY_SERVE_CONNECTIONS__IDLE", format!("{HEADER}s"))
            .env(
                "MARQUETRY_SERVE_CONNECTIONS__WRITE_STALL",
                format!("{STALL}s"),
            ),
    )?;
    let address = server.address;
    let (mut ratios, mut longest) = (Vec::new(), 0.0_f64);
    for _ in 0..ROUNDS {
        let before = fast(address, Duration::from_secs(2))?;
        let cut = AtomicUsize::new(0);
        let stop = AtomicBool::new(false);
        let during = std::thread::scope(|scope| -> Result<f64> {
            let slow: Vec<_> = (0..SLOW)
                .map(|number| {
                    let (cut, stop) = (&cut, &stop);
                    scope.spawn(move || {
                        let lasted = be_slow(address, number, stop);
                        if lasted.is_some() {
                            cut.fetch_add(1, Relaxed);
                        }
                        lasted
                    })
                })
                .collect();
            std::thread::sleep(Duration::from_millis(500));
            let during = fast(address, Duration::from_secs(2))?;
            // The deadline, a quarter for noticing, and the machine's other work.
            std::thread::sleep(Duration::from_secs(2 * STALL + 3));
            stop.store(true, Relaxed);
            for client in slow {
                if let Ok(Some(lasted)) = client.join() {
                    longest = longest.max(lasted.as_secs_f64());
                }
            }
            Ok(during)
        })?;
        let after = fast(address, Duration::from_secs(2))?;
        let cut = cut.load(Relaxed);
        ensure(cut == SLOW, || {
            format!("{cut} of {SLOW} slow connections were cut")
        })?;
        ratios.push(during / f64::midpoint(before, after));
    }
    println!(
        "\n{SLOW} slow connections (half-sent headers, silence, readers of nothing, readers of a trickle): all cut, the last \
         after {longest:.1} s (deadlines: header and idle {HEADER} s, stall {STALL} s). A fast client beside them kept {:.0}% \
         of its throughput (median of {ROUNDS})",
        median(ratios) * 100.0
    );
    Ok(())
}

/// Requests a second of one client.
fn fast(address: SocketAddr, time: Duration) -> Result<f64> {
    let mut client = Client::connect(address)?;
    let request = request("/files/scan.marq", Some((1000, 66_535)));
    let start = Instant::now();
    let mut count = 0;
    while start.elapsed() < time {
        let response = client.ask(&request)?;
        ensure(response.status == 206 && response.is_whole(), || {
            "the fast client got a wrong answer".to_owned()
        })?;
        count += 1;
    }
    Ok(f64::from(count) / start.elapsed().as_secs_f64())
}

/// How long the server bore with a client of kind `number`; `None` when it never cut it.
fn be_slow(address: SocketAddr, number: usize, stop: &AtomicBool) -> Option<Duration> {
    let mut stream = TcpStream::connect(address).ok()?;
    let start = Instant::now();
    let pause = Duration::from_millis(200);
    stream.set_read_timeout(Some(pause)).ok()?;
    stream.set_write_timeout(Some(pause)).ok()?;
    let full = b"GET /files/scan.marq HTTP/1.1\r\nHost: x\r\n\r\n";
    // Two kinds of readers: as many requests as are answered before the socket is full.
    if number % 4 >= 2 {
        for _ in 0..200 {
            if stream.write_all(full).is_err() {
                break;
            }
        }
    }
    let mut byte = [0; 1];
    while !stop.load(Relaxed) {
        let ended = match number % 4 {
            0 => {
                let sent = stream.write_all(b"x");
                std::thread::sleep(pause);
                sent.is_err_and(|error| is_end(&error)) || has_ended(&stream)
            }
            1 => {
                std::thread::sleep(pause);
                has_ended(&stream)
            }
            2 => {
                std::thread::sleep(pause);
                was_reset(&stream) || stream.write_all(b"x").is_err_and(|error| is_end(&error))
            }
            _ => {
                std::thread::sleep(pause);
                was_reset(&stream)
                    || match stream.read(&mut byte) {
                        Ok(0) => true,
                        Ok(_) => false,
                        Err(error) => is_end(&error),
                    }
            }
        };
        if ended {
            return Some(start.elapsed());
        }
    }
    None
}

fn is_end(error: &std::io::Error) -> bool {
    !matches!(
        error.kind(),
        std::io::ErrorKind::WouldBlock
            | std::io::ErrorKind::TimedOut
            | std::io::ErrorKind::Interrupted
    )
}

/// Whether the server has reset the connection. Reading does not tell before all is read that came until then.
fn was_reset(stream: &TcpStream) -> bool {
    stream.take_error().ok().flatten().is_some()
}

fn has_ended(stream: &TcpStream) -> bool {
    match stream.peek(&mut [0; 1]) {
        Ok(count) => count == 0,
        Err(error) => is_end(&error),
    }
}

/// 10 000 connections, each of which has asked once: what they take.
pub(crate) fn idle(project: &Project, scan: &Path) -> Result<()> {
    let server = Process::marquetry(
        Command::new(project.binary())
            .arg("serve")
            .arg(scan)
            .args(["--listen", "127.0.0.1:0"])
            .env(
                "MARQUETRY_SERVE_CONNECTIONS__OPEN",
                (IDLE + 100).to_string(),
            )
            .env("MARQUETRY_SERVE_CONNECTIONS__PER_ADDRESS", "0")
            .env("MARQUETRY_SERVE_CONNECTIONS__IDLE", "10m"),
    )?;
    fast(server.address, Duration::from_secs(1))?;
    let before = server.resident_bytes();
    let mut open = Vec::with_capacity(IDLE);
    let request = request("/files/scan.marq", Some((0, 4095)));
    let mut answer = vec![0; 8192];
    for _ in 0..IDLE {
        let mut stream = TcpStream::connect(server.address)
            .context("cannot open so many connections; is there a limit on open files?")?;
        stream.write_all(&request).context("cannot ask")?;
        let mut read = 0;
        while read < 4096 {
            read += stream.read(&mut answer).context("no answer")?;
        }
        open.push(stream);
    }
    std::thread::sleep(Duration::from_secs(1));
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let after = server.resident_bytes();
    let rate = fast(server.address, Duration::from_secs(2))?;
    println!(
        "\n{} idle connections, each after one request: {:.0} MiB in all, {:.0} MiB before ({:.1} KiB each); a client \
         beside them gets {rate:.0} ranges of 64 KiB a second",
        open.len(),
        mib(after),
        mib(before),
        (after.saturating_sub(before)) as f64 / 1024.0 / IDLE as f64
    );
    ensure(after <= 300 << 20, || "more than 300 MiB".to_owned())
}
