//! `cargo xtask soak [REQUESTS]`: many requests while sources fail, files are replaced and the server is killed.
//!
//! Two files are served: one from an origin that fails at random, with a cache too small for it, and one from a
//! folder. Both are replaced all the time. Every answer must be an error, be cut short so that the client can tell,
//! or hold exactly the bytes of the version that its entity tag names. Half-way the server is killed and started anew.

use super::client::Client;
use super::origin::Origin;
use super::process_of::Process;
use super::{Random, scans};
use crate::{ensure, project::Project};
use anyhow::{Context, Result, bail};
use std::fmt::Write as _;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Requests unless another number is asked for.
pub(crate) const REQUESTS: u64 = 1_000_000;
const CLIENTS: u64 = 8;
const VERSIONS: u32 = 3;
/// Between two replacements of each file.
const REPLACE: Duration = Duration::from_millis(200);
/// All versions have so many pages.
const PAGES: usize = 440;
/// All versions are longer than this and the longest range.
const RANGES_BEGIN_BELOW: usize = 300_000;
/// Of so many requests one at least must reach the origin, or its faults are not met.
const REQUESTS_AN_ORIGINS: u64 = 20;
/// By how much memory may grow after the server has warmed up.
const GROWTH_BYTES: u64 = 24 << 20;

#[derive(Debug, Default)]
struct Tally {
    sent: AtomicU64,
    whole: AtomicU64,
    errors: AtomicU64,
    short: AtomicU64,
    broken: AtomicU64,
    gone: AtomicU64,
    bytes: AtomicU64,
}

/// Runs it.
///
/// # Errors
/// When an answer is wrong, or memory grows.
pub(crate) fn run(project: &Project, requests: u64) -> Result<()> {
    ensure(project.binary().is_file(), || {
        "the binary is not built: cargo build --release".to_owned()
    })?;
    let folder = project.target.join("soak");
    let site = folder.join("site");
    std::fs::create_dir_all(&site).context("cannot make a folder")?;
    let mut versions = Vec::new();
    for seed in 0..VERSIONS {
        let file = scans::marq(project, &folder, seed)?;
        versions.push(std::fs::read(file).context("cannot read a file")?);
    }
    let local = site.join("local.marq");
    let first = versions.first().context("no version")?;
    replace(&local, first)?;
    let origin = Origin::start(versions.clone())?;
    println!("  {requests} requests by {CLIENTS} clients");
    let start = Instant::now();
    let tally = Tally::default();
    let mut growth = Vec::new();
    let mut port = 0;
    for half in 1..=2 {
        let server = serve(project, &site, &origin, port)?;
        // The second server has to be found where the first one was.
        port = server.address.port();
        let until = requests * half / 2;
        growth.push(load(&server, &origin, &local, &versions, &tally, until)?);
        if half == 1 {
            server.kill()?;
            println!("  killed and started anew");
        } else {
            origin.set_faulty(false);
            check_quiet(server.address, &versions)?;
        }
    }
    report(&tally, &origin, &growth, start.elapsed())
}

fn serve(project: &Project, site: &Path, origin: &Origin, port: u16) -> Result<Process> {
    Process::marquetry(
        Command::new(project.binary())
            .arg("serve")
            .arg(site)
            .arg(format!("http://{}/remote.marq", origin.address))
            .args(["--listen", &format!("127.0.0.1:{port}")])
            .env("MARQUETRY_SERVE_UPSTREAM__CACHE", "256KiB")
            .env("MARQUETRY_SERVE_UPSTREAM__REFRESH", "100ms")
            .env("MARQUETRY_SERVE_UPSTREAM__TIMEOUT", "2s"),
    )
}

/// Asks until `until` requests were sent in all; gives the memory after a quarter of that, and at the end.
fn load(
    server: &Process,
    origin: &Origin,
    local: &Path,
    versions: &[Vec<u8>],
    tally: &Tally,
    until: u64,
) -> Result<(u64, u64)> {
    let stop = AtomicBool::new(false);
    let begun = tally.sent.load(Relaxed);
    let quarter = begun + (until - begun) / 4;
    std::thread::scope(|scope| {
        let stop = &stop;
        scope.spawn(move || {
            let mut turn = 0;
            while !stop.load(Relaxed) {
                origin.replace();
                turn += 1;
                if let Some(bytes) = versions.get(turn % versions.len()) {
                    // A disk that is full shows in the answers.
                    let _ = replace(local, bytes);
                }
                std::thread::sleep(REPLACE);
            }
        });
        let clients: Vec<_> = (0..CLIENTS)
            .map(|number| {
                scope.spawn(move || client(server.address, number, versions, tally, until))
            })
            .collect();
        let mut warm = 0;
        while tally.sent.load(Relaxed) < until {
            if clients
                .iter()
                .any(std::thread::ScopedJoinHandle::is_finished)
            {
                break;
            }
            if warm == 0 && tally.sent.load(Relaxed) >= quarter {
                warm = server.resident_bytes();
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        let end = server.resident_bytes();
        let mut result = Ok((warm, end));
        for client in clients {
            match client.join() {
                Ok(Ok(())) => {}
                Ok(Err(error)) => result = Err(error),
                Err(_) => bail!("a client panicked"),
            }
        }
        stop.store(true, Relaxed);
        result
    })
}

fn client(
    address: SocketAddr,
    number: u64,
    versions: &[Vec<u8>],
    tally: &Tally,
    until: u64,
) -> Result<()> {
    let random = Random::new(number + 1);
    let mut connection = None;
    while tally.sent.fetch_add(1, Relaxed) < until {
        let client = match &mut connection {
            Some(client) => client,
            none => none.insert(Client::connect(address)?),
        };
        let version = versions
            .get(usize::try_from(random.below(versions.len() as u64))?)
            .context("no version")?;
        let name = if random.below(4) == 0 {
            "local"
        } else {
            "remote"
        };
        let (request, range) = any_request(&random, name, version);
        match client.ask(&request) {
            Err(_) => {
                tally.broken.fetch_add(1, Relaxed);
                connection = None;
            }
            Ok(response) if !response.is_whole() => {
                tally.short.fetch_add(1, Relaxed);
                connection = None;
            }
            Ok(response) if response.status == 410 => {
                tally.gone.fetch_add(1, Relaxed);
            }
            Ok(response) if response.status >= 400 => {
                tally.errors.fetch_add(1, Relaxed);
            }
            Ok(response) => {
                let tag = response.field("etag").context("no entity tag")?;
                let id = tag.trim_matches('"').split('/').next().unwrap_or_default();
                let version = versions
                    .iter()
                    .find(|bytes| content_id(bytes) == id)
                    .with_context(|| format!("{name}: no version has the tag {tag}"))?;
                let right = match range {
                    Some((first, last)) => {
                        let last = last.min(version.len() - 1);
                        version.get(first..=last) == Some(response.body)
                    }
                    // A page: found in its version, where it stands once.
                    None => find(version, response.body),
                };
                ensure(right, || {
                    format!(
                        "{}\nanswered with {} bytes that are not those of {tag}",
                        String::from_utf8_lossy(&request),
                        response.body.len()
                    )
                })?;
                tally.whole.fetch_add(1, Relaxed);
                tally.bytes.fetch_add(response.body.len() as u64, Relaxed);
            }
        }
    }
    Ok(())
}

/// A request, and the range that it asks for (first and last byte).
fn any_request(random: &Random, name: &str, version: &[u8]) -> (Vec<u8>, Option<(usize, usize)>) {
    let below = |end: usize| usize::try_from(random.below(end as u64)).unwrap_or(0);
    match random.below(20) {
        0 => {
            let request = super::client::request(&format!("/files/{name}.marq"), None);
            (request, Some((0, usize::MAX - 1)))
        }
        1..10 => {
            let path = format!("/pages/{name}/{}/{}", content_id(version), below(PAGES));
            (super::client::request(&path, None), None)
        }
        _ => {
            let first = below(RANGES_BEGIN_BELOW);
            let last = first + below(9_000);
            let path = format!("/files/{name}.marq");
            let request = super::client::request(&path, Some((first, last)));
            (request, Some((first, last)))
        }
    }
}

fn content_id(bytes: &[u8]) -> String {
    let id = bytes.get(24..40).unwrap_or_default();
    id.iter().fold(String::new(), |mut hex, byte| {
        // Writing to a string does not fail.
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

fn find(bytes: &[u8], part: &[u8]) -> bool {
    let Some(first) = part.get(..part.len().min(16)) else {
        return false;
    };
    part.is_empty()
        || bytes
            .windows(first.len())
            .enumerate()
            .any(|(at, window)| window == first && bytes.get(at..at + part.len()) == Some(part))
}

fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let new = path.with_extension("new");
    std::fs::write(&new, bytes).context("cannot write a file")?;
    std::fs::rename(&new, path).context("cannot replace a file")
}

/// Once nothing fails any more, everything is served again.
fn check_quiet(address: SocketAddr, versions: &[Vec<u8>]) -> Result<()> {
    std::thread::sleep(Duration::from_millis(300));
    let mut client = Client::connect(address)?;
    for name in ["local", "remote"] {
        let request = super::client::request(&format!("/files/{name}.marq"), None);
        let response = client.ask(&request)?;
        let right = versions
            .iter()
            .any(|bytes| bytes.as_slice() == response.body);
        ensure(response.status == 200 && right, || {
            format!("{name} is not served after all: {}", response.status)
        })?;
    }
    Ok(())
}

fn report(tally: &Tally, origin: &Origin, growth: &[(u64, u64)], time: Duration) -> Result<()> {
    let of = |count: &AtomicU64| count.load(Relaxed);
    let counts = origin.counts();
    println!(
        "\n{:.0} s: {} answers checked ({:.1} GB), {} errors, {} pages of a version no longer there, {} cut short, {} connections \
         without an answer; no wrong byte",
        time.as_secs_f64(),
        of(&tally.whole),
        of(&tally.bytes) as f64 / 1e9,
        of(&tally.errors),
        of(&tally.gone),
        of(&tally.short),
        of(&tally.broken),
    );
    println!(
        "the origin was asked {} times: refused {}, broke off {}, hesitated {}, hung up {}",
        of(&counts.requests),
        of(&counts.refused),
        of(&counts.truncated),
        of(&counts.delayed),
        of(&counts.hung_up),
    );
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    for (number, (warm, end)) in growth.iter().enumerate() {
        println!(
            "memory of server {}: {:.1} MiB after a quarter of its requests, {:.1} MiB at the end",
            number + 1,
            mib(*warm),
            mib(*end)
        );
    }
    ensure(
        of(&counts.requests) * REQUESTS_AN_ORIGINS >= of(&tally.sent),
        || "the origin was hardly asked: its file fits into the cache".to_owned(),
    )?;
    ensure(of(&tally.whole) * 2 > of(&tally.sent), || {
        "most requests failed".to_owned()
    })?;
    ensure(
        growth.iter().all(|(warm, end)| *end < warm + GROWTH_BYTES),
        || "memory grows".to_owned(),
    )
}
