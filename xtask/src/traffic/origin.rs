//! An HTTP origin that fails at random, to serve from.
//!
//! It holds one file, in several versions that replace each other, and answers HEAD and single ranges with entity
//! tags and conditions as a store would, when it does not fail: refuse, break off half-way, hang for a while, hang up.

use super::Random;
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

/// Answers in a thousand that go wrong in each way.
const FAULTS_PER_MILLE: u64 = 20;

/// What the origin counts.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    pub(crate) requests: AtomicU64,
    pub(crate) refused: AtomicU64,
    pub(crate) truncated: AtomicU64,
    pub(crate) delayed: AtomicU64,
    pub(crate) hung_up: AtomicU64,
}

/// A running origin.
#[derive(Debug)]
pub(crate) struct Origin {
    pub(crate) address: SocketAddr,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    versions: Vec<Vec<u8>>,
    current: AtomicUsize,
    /// Counts replacements: the same version put again is a new object.
    generation: AtomicUsize,
    faulty: AtomicBool,
    random: Random,
    counts: Counts,
}

impl Origin {
    /// Starts with the first of `versions`.
    pub(crate) fn start(versions: Vec<Vec<u8>>) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no free port")?;
        let origin = Self {
            address: listener.local_addr().context("no free port")?,
            state: Arc::new(State {
                versions,
                current: AtomicUsize::new(0),
                generation: AtomicUsize::new(0),
                faulty: AtomicBool::new(true),
                random: Random::new(99),
                counts: Counts::default(),
            }),
        };
        let state = Arc::clone(&origin.state);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let state = Arc::clone(&state);
                std::thread::spawn(move || {
                    // A client that hangs up is no fault of ours.
                    let _ = state.converse(&stream);
                });
            }
        });
        Ok(origin)
    }

    /// Replaces the file by its next version.
    pub(crate) fn replace(&self) {
        self.state.generation.fetch_add(1, Relaxed);
        self.state.current.fetch_add(1, Relaxed);
    }

    /// Whether to fail at random.
    pub(crate) fn set_faulty(&self, faulty: bool) {
        self.state.faulty.store(faulty, Relaxed);
    }

    pub(crate) fn counts(&self) -> &Counts {
        &self.state.counts
    }
}

impl State {
    fn converse(&self, mut stream: &TcpStream) -> std::io::Result<()> {
        stream.set_nodelay(true)?;
        let mut reader = BufReader::new(stream);
        let mut head = String::new();
        loop {
            head.clear();
            while !head.ends_with("\r\n\r\n") {
                if reader.read_line(&mut head)? == 0 {
                    return Ok(());
                }
            }
            let (answer, end) = self.answer(&head);
            stream.write_all(&answer)?;
            if end {
                return Ok(());
            }
        }
    }

    /// The bytes to send, and whether to hang up then.
    fn answer(&self, head: &str) -> (Vec<u8>, bool) {
        let counts = &self.counts;
        counts.requests.fetch_add(1, Relaxed);
        let fault = if self.faulty.load(Relaxed) {
            self.random.below(1000) / FAULTS_PER_MILLE
        } else {
            u64::MAX
        };
        match fault {
            0 => {
                counts.refused.fetch_add(1, Relaxed);
                let refusal = b"HTTP/1.1 500 Oops\r\nContent-Length: 0\r\n\r\n";
                return (refusal.to_vec(), false);
            }
            1 => {
                counts.hung_up.fetch_add(1, Relaxed);
                return (Vec::new(), true);
            }
            2 => {
                counts.delayed.fetch_add(1, Relaxed);
                std::thread::sleep(Duration::from_millis(self.random.below(50)));
            }
            _ => {}
        }
        let generation = self.generation.load(Relaxed);
        let place = self.current.load(Relaxed) % self.versions.len().max(1);
        let Some(bytes) = self.versions.get(place) else {
            return (Vec::new(), true);
        };
        let tag = format!("\"{generation}\"");
        let field = |name: &str| {
            head.lines().find_map(|line| {
                let (found, value) = line.split_once(':')?;
                found.eq_ignore_ascii_case(name).then(|| value.trim())
            })
        };
        if field("if-match").is_some_and(|wanted| wanted != tag) {
            let refusal = b"HTTP/1.1 412 Changed\r\nContent-Length: 0\r\n\r\n";
            return (refusal.to_vec(), false);
        }
        if head.starts_with("HEAD") {
            let text = format!(
                "HTTP/1.1 200 OK\r\nContent-Length: {}\r\nETag: {tag}\r\n\r\n",
                bytes.len()
            );
            return (text.into_bytes(), false);
        }
        let range = field("range").and_then(|range| {
            let (first, last) = range.strip_prefix("bytes=")?.split_once('-')?;
            let last = last.parse::<usize>().ok()?.min(bytes.len() - 1);
            Some((first.parse::<usize>().ok()?, last))
        });
        let Some((first, last)) = range.filter(|(first, last)| first <= last) else {
            return (Vec::new(), true);
        };
        let part = bytes.get(first..=last).unwrap_or_default();
        let mut answer = format!(
            "HTTP/1.1 206 Partial Content\r\nContent-Length: {}\r\nETag: {tag}\r\n\
             Content-Range: bytes {first}-{last}/{}\r\n\r\n",
            part.len(),
            bytes.len()
        )
        .into_bytes();
        if fault == 3 {
            counts.truncated.fetch_add(1, Relaxed);
            let half = part.get(..part.len() / 2).unwrap_or_default();
            answer.extend_from_slice(half);
            return (answer, true);
        }
        answer.extend_from_slice(part);
        (answer, false)
    }
}
