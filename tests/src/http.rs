//! As much of an HTTP/1.1 client as the tests need: one request a connection.

use anyhow::{Context, Result, ensure};
use std::fmt::Write as _;
use std::io::{Read, Write as _};
use std::net::TcpStream;
use std::time::Duration;

/// An answer.
#[derive(Debug, Clone)]
pub struct Response {
    /// Status code.
    pub status: u16,
    /// Header fields, names in lower case.
    pub headers: Vec<(String, String)>,
    /// The body.
    pub body: Vec<u8>,
}

impl Response {
    /// Value of the header field `name`, given in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers
            .iter()
            .find(|(field, _)| field == name)
            .map(|(_, value)| value.as_str())
    }
}

/// Gets `path` from `http://AUTHORITY`, with header fields of the caller's.
///
/// # Errors
/// When there is no valid answer within ten seconds.
pub fn get(authority: &str, path: &str, fields: &[(&str, &str)]) -> Result<Response> {
    let mut stream =
        TcpStream::connect(authority).with_context(|| format!("no connection to {authority}"))?;
    stream.set_read_timeout(Some(Duration::from_secs(10)))?;
    stream.set_write_timeout(Some(Duration::from_secs(10)))?;
    let mut request = format!("GET {path} HTTP/1.1\r\nHost: {authority}\r\nConnection: close\r\n");
    for (name, value) in fields {
        write!(request, "{name}: {value}\r\n")?;
    }
    request += "\r\n";
    stream.write_all(request.as_bytes())?;
    let mut bytes = Vec::new();
    stream
        .read_to_end(&mut bytes)
        .with_context(|| format!("no answer to {path}"))?;
    parse(&bytes).with_context(|| format!("answer to {path}"))
}

fn parse(bytes: &[u8]) -> Result<Response> {
    let end = bytes
        .windows(4)
        .position(|window| window == b"\r\n\r\n")
        .context("no end of the head")?;
    let head = std::str::from_utf8(&bytes[..end])?;
    let mut lines = head.split("\r\n");
    let status = lines
        .next()
        .and_then(|line| line.split(' ').nth(1))
        .context("no status")?
        .parse()?;
    let headers: Vec<(String, String)> = lines
        .filter_map(|line| line.split_once(':'))
        .map(|(name, value)| (name.to_ascii_lowercase(), value.trim().to_owned()))
        .collect();
    let body = bytes[end + 4..].to_vec();
    let mut response = Response {
        status,
        headers,
        body,
    };
    if response
        .header("transfer-encoding")
        .is_some_and(|coding| coding.contains("chunked"))
    {
        response.body = unchunked(&response.body)?;
    }
    if let Some(length) = response.header("content-length") {
        ensure!(
            length.parse() == Ok(response.body.len()),
            "{} bytes, not {length}",
            response.body.len()
        );
    }
    Ok(response)
}

fn unchunked(mut bytes: &[u8]) -> Result<Vec<u8>> {
    let mut body = Vec::new();
    loop {
        let end = bytes
            .windows(2)
            .position(|window| window == b"\r\n")
            .context("no chunk size")?;
        let length = usize::from_str_radix(std::str::from_utf8(&bytes[..end])?.trim(), 16)?;
        if length == 0 {
            return Ok(body);
        }
        body.extend(
            bytes
                .get(end + 2..end + 2 + length)
                .context("chunk cut short")?,
        );
        bytes = bytes
            .get(end + 2 + length + 2..)
            .context("chunk cut short")?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_taken_apart() {
        let response =
            parse(b"HTTP/1.1 206 Partial\r\nETag: \"x\"\r\nContent-Length: 3\r\n\r\nabc").unwrap();
        assert_eq!(
            (response.status, response.header("etag")),
            (206, Some("\"x\""))
        );
        assert_eq!(response.body, b"abc");
        assert!(parse(b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nabc").is_err());
    }

    #[test]
    fn chunks_are_joined() {
        let response = parse(
            b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n1\r\nd\r\n0\r\n\r\n",
        )
        .unwrap();
        assert_eq!(response.body, b"abcd");
    }
}
