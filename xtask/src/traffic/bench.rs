//! `cargo xtask bench-server`: throughput and latency beside nginx, slow clients, idle connections.
//!
//! Passes of all servers are interleaved and medians are taken, since the machine has other work too. Processor time
//! a request is taken from the kernel's account and moves less with that work than throughput does.

use super::client::{Client, request};
use super::process_of::Process;
use super::{Random, crowd, median, nginx, scans};
use crate::setup::{self, Need};
use crate::{ensure, project::Project};
use anyhow::{Context, Result, bail};
use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Connections that ask at once.
const CLIENTS: usize = 16;
const PASSES: usize = 7;
const PASS: Duration = Duration::from_millis(1500);

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Load {
    /// Pages by their own address; ranges of the same lengths where there are no pages.
    Pages,
    /// Ranges of this many bytes.
    Ranges(usize),
}

/// Who is asked, and how it calls the file.
struct Server {
    name: &'static str,
    process: Process,
    path: &'static str,
    has_pages: bool,
}

/// What one pass showed.
#[derive(Debug, Clone, Copy)]
struct Pass {
    requests_a_second: f64,
    p50_us: f64,
    p99_us: f64,
    cpu_us: f64,
}

/// The file that is served.
struct Served {
    bytes: Vec<u8>,
    /// Address and length of each page that is not empty.
    pages: Vec<(String, usize)>,
}

/// Runs all measurements on `file`, or on a made-up scan.
///
/// # Errors
/// When something is missing, or an answer is wrong.
pub(crate) fn run(project: &Project, file: Option<&Path>) -> Result<()> {
    setup::ensure(&[Need::Nginx])?;
    ensure(project.binary().is_file(), || {
        "the binary is not built: cargo build --release".to_owned()
    })?;
    let folder = project.target.join("bench-server");
    let site = folder.join("site");
    std::fs::create_dir_all(&site).context("cannot make a folder")?;
    let scan = site.join("scan.marq");
    let source = match file {
        Some(file) => file.to_owned(),
        None => scans::marq(project, &folder, 1)?,
    };
    std::fs::copy(&source, &scan).context("cannot copy the file to serve")?;
    throughput(project, &folder, &site, &scan)?;
    crowd::slow(project, &scan)?;
    crowd::idle(project, &scan)
}

fn marquetry(project: &Project, site: &Path) -> Result<Process> {
    Process::marquetry(
        Command::new(project.binary())
            .arg("serve")
            .arg(site)
            .args(["--listen", "127.0.0.1:0"]),
    )
}

fn throughput(project: &Project, folder: &Path, site: &Path, scan: &Path) -> Result<()> {
    let servers = [
        Server {
            name: "nginx",
            process: nginx::start(site, &scratch(folder, "plain")?, false)?,
            path: "/scan.marq",
            has_pages: false,
        },
        Server {
            name: "nginx, open_file_cache",
            process: nginx::start(site, &scratch(folder, "cached")?, true)?,
            path: "/scan.marq",
            has_pages: false,
        },
        Server {
            name: "marquetry",
            process: marquetry(project, site)?,
            path: "/files/scan.marq",
            has_pages: true,
        },
    ];
    let [.., ours] = &servers;
    let served = Served::of(scan, ours.process.address)?;
    println!(
        "\n{} bytes, {} pages of {} bytes in the mean; {CLIENTS} connections, {PASSES} passes of {} s each, interleaved; medians",
        served.bytes.len(),
        served.pages.len(),
        served.pages.iter().map(|(_, length)| length).sum::<usize>() / served.pages.len().max(1),
        PASS.as_secs_f64()
    );
    for (title, load) in [
        ("pages (nginx: ranges of the same lengths)", Load::Pages),
        ("ranges of 4 KiB", Load::Ranges(4 << 10)),
        ("ranges of 64 KiB", Load::Ranges(64 << 10)),
    ] {
        let mut passes = vec![Vec::new(); servers.len()];
        for number in 0..PASSES {
            // Each is first as often as the others.
            for turn in 0..servers.len() {
                let place = (number + turn) % servers.len();
                if let (Some(server), Some(passes)) = (servers.get(place), passes.get_mut(place)) {
                    passes.push(pass(server, &served, load)?);
                }
            }
        }
        println!("\n{title}");
        println!("| server | requests/s | of nginx | p50 µs | p99 µs | processor µs a request |");
        println!("|---|---|---|---|---|---|");
        let mut first = None;
        for (server, passes) in servers.iter().zip(&passes) {
            let of = |value: fn(&Pass) -> f64| median(passes.iter().map(value).collect());
            let rate = of(|pass| pass.requests_a_second);
            // Pairs of neighbouring passes have seen the same machine.
            let ratio = match &first {
                None => 1.0,
                Some(base) => median(
                    passes
                        .iter()
                        .zip::<&Vec<Pass>>(base)
                        .map(|(pass, base)| pass.requests_a_second / base.requests_a_second)
                        .collect(),
                ),
            };
            first.get_or_insert_with(|| passes.clone());
            println!(
                "| {} | {rate:.0} | {ratio:.2} | {:.0} | {:.0} | {:.1} |",
                server.name,
                of(|pass| pass.p50_us),
                of(|pass| pass.p99_us),
                of(|pass| pass.cpu_us),
            );
        }
    }
    Ok(())
}

fn scratch(folder: &Path, name: &str) -> Result<std::path::PathBuf> {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).context("cannot make a folder")?;
    Ok(folder)
}

impl Served {
    fn of(scan: &Path, address: SocketAddr) -> Result<Self> {
        let bytes = std::fs::read(scan).context("cannot read the file to serve")?;
        let mut client = Client::connect(address)?;
        let about = client.ask(&request("/api/files/scan", None))?;
        let about: serde_json::Value =
            serde_json::from_slice(about.body).context("no description of the file")?;
        let template = about["pages"][0].as_str().context("no pages")?;
        let mut pages = Vec::new();
        for page in 0..about["page_count"].as_u64().context("no pages")? {
            let path = template.replace("{first}", &page.to_string());
            let length = client.ask(&request(&path, None))?.length;
            if length > 0 {
                pages.push((path, length));
            }
        }
        if pages.is_empty() {
            bail!("the file has no pages of its own: all is in its first read");
        }
        Ok(Self { bytes, pages })
    }

    /// Request number `number` of `load`, and what must come back, where that is known.
    fn request(
        &self,
        server: &Server,
        load: Load,
        random: &Random,
    ) -> (Vec<u8>, usize, Option<&[u8]>) {
        let length = match load {
            Load::Ranges(length) => length.min(self.bytes.len()),
            Load::Pages => {
                let page = random.below(self.pages.len().max(1) as u64);
                let page = usize::try_from(page).unwrap_or(0);
                let Some((path, length)) = self.pages.get(page) else {
                    return (Vec::new(), 0, None);
                };
                if server.has_pages {
                    return (request(path, None), *length, None);
                }
                *length
            }
        };
        let free = self.bytes.len() - length;
        let start = usize::try_from(random.below(free as u64 + 1)).unwrap_or(0);
        let expected = self.bytes.get(start..start + length);
        let wanted = Some((start, start + length - 1));
        (request(server.path, wanted), length, expected)
    }
}

fn pass(server: &Server, served: &Served, load: Load) -> Result<Pass> {
    let stop = AtomicBool::new(false);
    let cpu = server.process.cpu_seconds();
    let start = Instant::now();
    let mut times: Vec<f64> = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS)
            .map(|number| {
                let stop = &stop;
                scope.spawn(move || -> Result<Vec<f64>> {
                    let random = Random::new(number as u64 + 1);
                    let mut client = Client::connect(server.process.address)?;
                    let mut times = Vec::with_capacity(1 << 16);
                    while !stop.load(Relaxed) {
                        let (request, length, expected) = served.request(server, load, &random);
                        let begin = Instant::now();
                        let response = client.ask(&request)?;
                        times.push(begin.elapsed().as_secs_f64() * 1e6);
                        if response.body.len() != length
                            || expected.is_some_and(|expected| expected != response.body)
                        {
                            bail!(
                                "{}: a wrong answer, status {}",
                                server.name,
                                response.status
                            );
                        }
                    }
                    Ok(times)
                })
            })
            .collect();
        std::thread::sleep(PASS);
        stop.store(true, Relaxed);
        let mut all = Vec::new();
        for client in clients {
            match client.join() {
                Ok(times) => all.extend(times?),
                Err(_) => bail!("a client panicked"),
            }
        }
        Ok(all)
    })?;
    let seconds = start.elapsed().as_secs_f64();
    let cpu = server.process.cpu_seconds() - cpu;
    times.sort_by(f64::total_cmp);
    let count = times.len().max(1);
    let at = |part: usize| times.get((count * part / 100).min(count - 1)).copied();
    Ok(Pass {
        requests_a_second: count as f64 / seconds,
        p50_us: at(50).unwrap_or(f64::NAN),
        p99_us: at(99).unwrap_or(f64::NAN),
        cpu_us: cpu * 1e6 / count as f64,
    })
}
