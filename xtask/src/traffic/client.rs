//! An HTTP/1.1 client that costs as little as it can: one blocking connection, kept open.

use anyhow::{Context, Result, bail};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// A connection.
#[derive(Debug)]
pub(crate) struct Client {
    stream: TcpStream,
    buffer: Vec<u8>,
}

/// A response.
#[derive(Debug)]
pub(crate) struct Response<'b> {
    pub(crate) status: u16,
    head: &'b [u8],
    /// Shorter than [`Response::length`] when the connection broke.
    pub(crate) body: &'b [u8],
    pub(crate) length: usize,
}

impl Response<'_> {
    /// The value of a field, whose name is given in lower case.
    pub(crate) fn field(&self, name: &str) -> Option<&str> {
        let head = std::str::from_utf8(self.head).ok()?;
        head.lines().find_map(|line| {
            let (found, value) = line.split_once(':')?;
            found.eq_ignore_ascii_case(name).then(|| value.trim())
        })
    }

    pub(crate) fn is_whole(&self) -> bool {
        self.body.len() == self.length
    }
}

/// A request for `path`, of some bytes of it if `range` is given (first and last).
pub(crate) fn request(path: &str, range: Option<(usize, usize)>) -> Vec<u8> {
    let range = range.map_or(String::new(), |(first, last)| {
        format!("Range: bytes={first}-{last}\r\n")
    });
    format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n{range}\r\n").into_bytes()
}

impl Client {
    pub(crate) fn connect(address: SocketAddr) -> Result<Self> {
        let stream = TcpStream::connect_timeout(&address, Duration::from_secs(5))
            .with_context(|| format!("cannot connect to {address}"))?;
        stream.set_nodelay(true).context("cannot set up a socket")?;
        stream
            .set_read_timeout(Some(Duration::from_secs(30)))
            .context("cannot set up a socket")?;
        Ok(Self {
            stream,
            buffer: vec![0; 64 * 1024],
        })
    }

    /// Sends `request` and takes the response.
    ///
    /// # Errors
    /// When there is no whole header; a body that breaks off is the response's to tell.
    pub(crate) fn ask(&mut self, request: &[u8]) -> Result<Response<'_>> {
        self.stream.write_all(request).context("cannot send")?;
        let mut filled = 0;
        let end = loop {
            let read = self.fill(filled)?;
            if read == 0 {
                bail!("no whole header");
            }
            let from = filled.saturating_sub(3);
            filled += read;
            let new = self.buffer.get(from..filled).unwrap_or_default();
            if let Some(at) = new.windows(4).position(|window| window == b"\r\n\r\n") {
                break from + at + 4;
            }
        };
        let head = self.buffer.get(..end).unwrap_or_default();
        let status = std::str::from_utf8(head.get(9..12).unwrap_or_default())
            .ok()
            .and_then(|text| text.parse().ok())
            .context("no status")?;
        let length = if status == 304 {
            0
        } else {
            content_length(head)?
        };
        self.buffer.resize(self.buffer.len().max(end + length), 0);
        while filled < end + length {
            match self.fill(filled) {
                Ok(0) | Err(_) => break,
                Ok(read) => filled += read,
            }
        }
        let (head, rest) = self.buffer.split_at(end);
        let body = rest
            .get(..filled.min(end + length) - end)
            .unwrap_or_default();
        Ok(Response {
            status,
            head,
            body,
            length,
        })
    }

    fn fill(&mut self, filled: usize) -> Result<usize> {
        if filled == self.buffer.len() {
            self.buffer.resize(2 * filled, 0);
        }
        let space = self.buffer.get_mut(filled..).unwrap_or_default();
        self.stream.read(space).context("cannot receive")
    }
}

fn content_length(head: &[u8]) -> Result<usize> {
    const NAME: &[u8] = b"content-length: ";
    let at = head
        .windows(NAME.len())
        .position(|window| window.eq_ignore_ascii_case(NAME))
        .context("no Content-Length")?;
    let digits = head.get(at + NAME.len()..).unwrap_or_default();
    let end = digits.iter().position(|byte| !byte.is_ascii_digit());
    let digits = digits.get(..end.unwrap_or(0)).unwrap_or_default();
    std::str::from_utf8(digits)
        .ok()
        .and_then(|text| text.parse().ok())
        .context("no Content-Length")
}
