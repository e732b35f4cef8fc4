//! Bytes of a file on an HTTP server, by range requests (RFC 9110, section 14).
//!
//! Every answer must be a 206 for exactly the range asked for, of a file of unchanging length and `ETag`: a file replaced
//! half-way is an error, not a mixture. Connections that break and servers that stumble (5xx) are tried again a few times.

use marquetry_format::{ByteSource, SourceError, reader::FIRST_READ_BYTES};
use std::ops::Range;
use std::time::Duration;
use ureq::http::{Response, StatusCode, header};

/// Longest wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest silence while something is expected.
const SILENCE_TIMEOUT: Duration = Duration::from_secs(20);
/// Longest one request may take, however slowly bytes come.
const CALL_TIMEOUT: Duration = Duration::from_mins(2);
/// Pauses before second, third, … attempts.
const PAUSES: [Duration; 2] = [Duration::from_millis(200), Duration::from_millis(800)];

/// A file on an HTTP server.
#[derive(Debug)]
pub struct HttpSource {
    agent: ureq::Agent,
    url: String,
    length: u64,
    etag: Option<String>,
    /// The first bytes, which came with the answer that told the length.
    front: Vec<u8>,
}

/// An attempt that failed.
enum Failure {
    /// Worth another attempt.
    Passing(String),
    /// It would be the same again.
    Final(String),
}

/// One valid answer.
struct Part {
    bytes: Vec<u8>,
    length: u64,
    etag: Option<String>,
}

impl HttpSource {
    /// Asks for the beginning of the file at `url`.
    ///
    /// # Errors
    /// When the server cannot be reached, does not have the file, or does not serve ranges of it.
    pub fn open(url: &str) -> Result<Self, SourceError> {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_connect(Some(CONNECT_TIMEOUT))
            .timeout_per_read(Some(SILENCE_TIMEOUT))
            .timeout_recv_response(Some(SILENCE_TIMEOUT))
            .timeout_global(Some(CALL_TIMEOUT))
            .user_agent(concat!("marquetry/", env!("CARGO_PKG_VERSION")))
            .build();
        let agent = config.new_agent();
        let part = persist(url, || fetch(&agent, url, 0..FIRST_READ_BYTES, None))?;
        Ok(Self {
            agent,
            url: url.to_owned(),
            length: part.length,
            etag: part.etag,
            front: part.bytes,
        })
    }
}

impl ByteSource for HttpSource {
    fn length(&self) -> Result<u64, SourceError> {
        Ok(self.length)
    }

    fn read(&self, range: Range<u64>) -> Result<Vec<u8>, SourceError> {
        let Range { start, end } = range;
        if start > end || end > self.length {
            return Err(SourceError::OutOfRange {
                start,
                end,
                length: self.length,
            });
        }
        if start == end {
            return Ok(Vec::new());
        }
        let ends = usize::try_from(start).ok().zip(usize::try_from(end).ok());
        if let Some(front) = ends.and_then(|(start, end)| self.front.get(start..end)) {
            return Ok(front.to_vec());
        }
        let part = persist(&self.url, || {
            fetch(&self.agent, &self.url, start..end, Some(self))
        })?;
        Ok(part.bytes)
    }
}

/// Tries until it works, fails for good, or has failed too often.
fn persist(
    url: &str,
    mut attempt: impl FnMut() -> Result<Part, Failure>,
) -> Result<Part, SourceError> {
    let mut pauses = PAUSES.iter();
    loop {
        let reason = match attempt() {
            Ok(part) => return Ok(part),
            Err(Failure::Final(reason)) => reason,
            Err(Failure::Passing(reason)) => match pauses.next() {
                Some(pause) => {
                    std::thread::sleep(*pause);
                    continue;
                }
                None => reason,
            },
        };
        return Err(SourceError::Other(format!("{url}: {reason}")));
    }
}

/// One request. Without `known` the file may be shorter than the range.
fn fetch(
    agent: &ureq::Agent,
    url: &str,
    range: Range<u64>,
    known: Option<&HttpSource>,
) -> Result<Part, Failure> {
    let last = range.end - 1;
    let asked = format!("bytes={}-{last}", range.start);
    let call = agent
        .get(url)
        .header(header::RANGE, &asked)
        .header(header::ACCEPT_ENCODING, "identity")
        .call();
    let mut response = call.map_err(|error| failure_of(&error))?;
    check_status(response.status())?;
    let (first, got_last, length) = content_range(&response).ok_or_else(|| {
        Failure::Final("the server's Content-Range is missing or not understood".to_owned())
    })?;
    let etag = text(&response, header::ETAG);
    if let Some(known) = known
        && (length != known.length || etag != known.etag)
    {
        return Err(Failure::Final(
            "the file changed on the server while it was being read; open it again".to_owned(),
        ));
    }
    if first != range.start || got_last != last.min(length.saturating_sub(1)) {
        return Err(Failure::Final(format!(
            "asked for {asked}, the server sent bytes {first}-{got_last}"
        )));
    }
    let expected = got_last - first + 1;
    let body = response
        .body_mut()
        .with_config()
        .limit(expected.saturating_add(1))
        .read_to_vec();
    let bytes = body.map_err(|error| match failure_of(&error) {
        Failure::Passing(reason) => {
            Failure::Passing(format!("the answer to {asked} broke off: {reason}"))
        }
        last @ Failure::Final(_) => last,
    })?;
    if bytes.len() as u64 != expected {
        let count = bytes.len();
        return Err(Failure::Passing(format!(
            "the answer to {asked} stopped after {count} of {expected} bytes"
        )));
    }
    Ok(Part {
        bytes,
        length,
        etag,
    })
}

fn check_status(status: StatusCode) -> Result<(), Failure> {
    match status {
        StatusCode::PARTIAL_CONTENT => Ok(()),
        StatusCode::OK => Err(Failure::Final(
            "the server ignores range requests (status 200 where 206 was due); serve the file with one that knows them"
                .to_owned(),
        )),
        StatusCode::RANGE_NOT_SATISFIABLE => Err(Failure::Final("the file is empty (status 416)".to_owned())),
        status if status.is_server_error() || status == StatusCode::TOO_MANY_REQUESTS => {
            Err(Failure::Passing(format!("the server answers {status}")))
        }
        status => Err(Failure::Final(format!("the server answers {status}"))),
    }
}

fn failure_of(error: &ureq::Error) -> Failure {
    match error {
        ureq::Error::Io(_)
        | ureq::Error::Timeout(_)
        | ureq::Error::ConnectionFailed
        | ureq::Error::BodyStalled => Failure::Passing(error.to_string()),
        _ => Failure::Final(error.to_string()),
    }
}

/// First byte, last byte and whole length of `bytes F-L/N`.
fn content_range<T>(response: &Response<T>) -> Option<(u64, u64, u64)> {
    let value = text(response, header::CONTENT_RANGE)?;
    let (range, length) = value.strip_prefix("bytes ")?.split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let (first, last, length) = (
        first.trim().parse().ok()?,
        last.trim().parse().ok()?,
        length.trim().parse().ok()?,
    );
    (first <= last && last < length).then_some((first, last, length))
}

fn text<T>(response: &Response<T>, name: header::HeaderName) -> Option<String> {
    response
        .headers()
        .get(name)?
        .to_str()
        .ok()
        .map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader, Write};
    use std::net::TcpListener;

    /// A server that gives each connection, in turn, the next of these answers, and then stops.
    fn server(answers: Vec<Vec<u8>>) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/x.marq", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            for answer in answers {
                let (mut stream, _) = listener.accept().unwrap();
                let mut reader = BufReader::new(stream.try_clone().unwrap());
                let mut line = String::new();
                while reader.read_line(&mut line).unwrap() > 2 {
                    line.clear();
                }
                stream.write_all(&answer).unwrap();
            }
        });
        url
    }

    fn answer(status: &str, headers: &str, body: &[u8]) -> Vec<u8> {
        let head = format!("HTTP/1.1 {status}\r\nConnection: close\r\n{headers}\r\n");
        [head.as_bytes(), body].concat()
    }

    fn front(length: usize) -> Vec<u8> {
        let sent = length.min(65536);
        let headers = format!(
            "Content-Length: {sent}\r\nContent-Range: bytes 0-{}/{length}\r\nETag: \"a\"\r\n",
            sent - 1
        );
        answer("206 Partial Content", &headers, &vec![7; sent])
    }

    fn message<T>(result: Result<T, SourceError>) -> String {
        result.err().unwrap().to_string()
    }

    #[test]
    fn a_small_file_is_read_from_the_first_answer() {
        let source = HttpSource::open(&server(vec![front(100)])).unwrap();
        assert_eq!(source.length().unwrap(), 100);
        assert_eq!(source.read(90..100).unwrap(), [7; 10]);
        assert!(matches!(
            source.read(90..101),
            Err(SourceError::OutOfRange { length: 100, .. })
        ));
        assert!(source.read(5..5).unwrap().is_empty());
    }

    #[test]
    fn servers_without_ranges_and_without_the_file_are_named() {
        let plain = server(vec![answer("200 OK", "Content-Length: 3\r\n", b"abc")]);
        assert!(message(HttpSource::open(&plain)).contains("ignores range requests"));
        let missing = server(vec![answer("404 Not Found", "Content-Length: 0\r\n", b"")]);
        assert!(message(HttpSource::open(&missing)).contains("404"));
        let empty = server(vec![answer(
            "416 Range Not Satisfiable",
            "Content-Range: bytes */0\r\n",
            b"",
        )]);
        assert!(message(HttpSource::open(&empty)).contains("empty"));
        let vague = server(vec![answer(
            "206 Partial Content",
            "Content-Length: 3\r\n",
            b"abc",
        )]);
        assert!(message(HttpSource::open(&vague)).contains("Content-Range"));
    }

    #[test]
    fn an_answer_that_stops_half_way_is_tried_again_and_then_named() {
        let cut = |etag: &str| {
            let headers = format!(
                "Content-Length: 4\r\nContent-Range: bytes 70000-70003/80000\r\nETag: {etag}\r\n"
            );
            answer("206 Partial Content", &headers, b"ab")
        };
        let headers =
            "Content-Length: 4\r\nContent-Range: bytes 70000-70003/80000\r\nETag: \"a\"\r\n";
        let whole = answer("206 Partial Content", headers, b"abcd");
        let source = HttpSource::open(&server(vec![front(80000), cut("\"a\""), whole])).unwrap();
        assert_eq!(source.read(70000..70004).unwrap(), b"abcd");
        let source = HttpSource::open(&server(vec![
            front(80000),
            cut("\"a\""),
            cut("\"a\""),
            cut("\"a\""),
        ]))
        .unwrap();
        let words = message(source.read(70000..70004));
        assert!(
            words.contains("bytes=70000-70003") && words.contains("x.marq"),
            "{words}"
        );
    }

    #[test]
    fn a_file_that_changes_is_not_mixed() {
        let headers =
            "Content-Length: 4\r\nContent-Range: bytes 70000-70003/80000\r\nETag: \"b\"\r\n";
        let other = answer("206 Partial Content", headers, b"abcd");
        let source = HttpSource::open(&server(vec![front(80000), other])).unwrap();
        assert!(message(source.read(70000..70004)).contains("changed"));
    }

    #[test]
    fn a_server_that_is_not_there_is_named() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/x.marq", listener.local_addr().unwrap());
        drop(listener);
        assert!(message(HttpSource::open(&url)).contains(&url));
    }
}
