//! Byte ranges and conditions of `/files`, against RFC 9110, on a real socket.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod support;

use marquetry_server::Config;
use std::ops::Range;
use support::{Answer, Running, marq};

struct Fixture {
    server: Running,
    bytes: Vec<u8>,
    etag: String,
    _folder: tempfile::TempDir,
}

impl Fixture {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bytes = marq(0);
        std::fs::write(folder.path().join("a.marq"), &bytes).unwrap();
        let server = Running::start(Config::new("127.0.0.1:0", vec![folder.path().into()]));
        let etag = server
            .get("/files/a.marq")
            .header("etag")
            .unwrap()
            .to_owned();
        Self {
            server,
            bytes,
            etag,
            _folder: folder,
        }
    }

    fn send(&self, method: &str, headers: &[(&str, &str)]) -> Answer {
        self.server.send(method, "/files/a.marq", headers)
    }
}

/// What a request for ranges gives.
enum Expected {
    /// 200 and everything.
    Whole,
    /// 206 and one part.
    Part(Range<usize>),
    /// 206 and several parts.
    Parts(Vec<Range<usize>>),
    /// 416.
    Unsatisfiable,
}

#[test]
fn ranges_give_what_rfc_9110_says() {
    use Expected::{Part, Parts, Unsatisfiable, Whole};
    let fixture = Fixture::new();
    let n = fixture.bytes.len();
    assert!(n > 2000, "{n}");
    let table = [
        ("bytes=0-0".to_owned(), Part(0..1)),
        ("bytes=0-99".to_owned(), Part(0..100)),
        ("bytes=100-199".to_owned(), Part(100..200)),
        (format!("bytes={}-{}", n - 1, n - 1), Part(n - 1..n)),
        (format!("bytes=0-{}", n - 1), Part(0..n)),
        (format!("bytes=10-{}", n + 5), Part(10..n)),
        (
            "bytes=10-99999999999999999999999999".to_owned(),
            Part(10..n),
        ),
        ("bytes=0-".to_owned(), Part(0..n)),
        ("bytes=500-".to_owned(), Part(500..n)),
        (format!("bytes={}-", n - 1), Part(n - 1..n)),
        ("bytes=-1".to_owned(), Part(n - 1..n)),
        ("bytes=-500".to_owned(), Part(n - 500..n)),
        (format!("bytes=-{n}"), Part(0..n)),
        (format!("bytes=-{}", n + 1), Part(0..n)),
        ("BYTES=0-0".to_owned(), Part(0..1)),
        ("bytes=0-10,5-20".to_owned(), Part(0..21)),
        ("bytes=0-10,11-20".to_owned(), Part(0..21)),
        (format!("bytes={n}-,0-4"), Part(0..5)),
        ("bytes=0-1,10-11".to_owned(), Parts(vec![0..2, 10..12])),
        ("bytes=10-11, 0-1".to_owned(), Parts(vec![10..12, 0..2])),
        ("bytes=0-0,-1".to_owned(), Parts(vec![0..1, n - 1..n])),
        ("bytes=,0-1 ,, 10-11,".to_owned(), Parts(vec![0..2, 10..12])),
        (
            "bytes=1000-1999,0-9,20-29,15-16".to_owned(),
            Parts(vec![1000..2000, 0..10, 20..30, 15..17]),
        ),
        (format!("bytes={n}-"), Unsatisfiable),
        (format!("bytes={n}-{n}"), Unsatisfiable),
        (
            "bytes=99999999999999999999999999-".to_owned(),
            Unsatisfiable,
        ),
        ("bytes=-0".to_owned(), Unsatisfiable),
        (format!("bytes={}", ["0-0"; 33].join(",")), Unsatisfiable),
        ("bytes=5-4".to_owned(), Whole),
        ("bytes=".to_owned(), Whole),
        ("bytes=-".to_owned(), Whole),
        ("bytes=a-b".to_owned(), Whole),
        ("bytes=0-1,x".to_owned(), Whole),
        ("bytes=1-2-3".to_owned(), Whole),
        ("bytes 0-1".to_owned(), Whole),
        ("items=0-1".to_owned(), Whole),
        ("seconds=1-2".to_owned(), Whole),
    ];
    for (range, expected) in table {
        check(&fixture, &range, expected);
    }
}

fn check(fixture: &Fixture, range: &str, expected: Expected) {
    let answer = fixture.send("GET", &[("Range", range)]);
    let bytes = &fixture.bytes;
    let n = bytes.len();
    let content_range = |part: &Range<usize>| format!("bytes {}-{}/{n}", part.start, part.end - 1);
    let found_range = answer.header("content-range");
    match expected {
        Expected::Whole => {
            assert_eq!(answer.status, 200, "{range}");
            assert_eq!(found_range, None, "{range}");
            assert!(answer.body == *bytes, "{range}");
        }
        Expected::Part(part) => {
            assert_eq!(answer.status, 206, "{range}");
            assert_eq!(found_range, Some(content_range(&part).as_str()), "{range}");
            assert!(answer.body == bytes[part], "{range}");
        }
        Expected::Parts(parts) => {
            assert_eq!(answer.status, 206, "{range}");
            assert_eq!(found_range, None, "{range}");
            let found = multipart(&answer);
            assert_eq!(found.len(), parts.len(), "{range}");
            for ((found_range, body), part) in found.iter().zip(parts) {
                assert_eq!(*found_range, content_range(&part), "{range}");
                assert!(*body == bytes[part], "{range}");
            }
        }
        Expected::Unsatisfiable => {
            assert_eq!(answer.status, 416, "{range}");
            assert_eq!(
                found_range,
                Some(format!("bytes */{n}").as_str()),
                "{range}"
            );
        }
    }
    let length = answer.body.len().to_string();
    assert_eq!(
        answer.header("content-length"),
        Some(length.as_str()),
        "{range}"
    );
    if answer.status != 416 {
        assert_eq!(
            answer.header("etag"),
            Some(fixture.etag.as_str()),
            "{range}"
        );
        assert_eq!(answer.header("accept-ranges"), Some("bytes"), "{range}");
    }
}

/// The `Content-Range` and the body of each part.
fn multipart(answer: &Answer) -> Vec<(String, Vec<u8>)> {
    let content_type = answer.header("content-type").unwrap();
    let boundary = content_type
        .strip_prefix("multipart/byteranges; boundary=")
        .unwrap();
    let find = |bytes: &[u8], what: &[u8]| bytes.windows(what.len()).position(|w| w == what);
    let opening = format!("--{boundary}\r\n");
    let (between, closing) = (
        format!("\r\n--{boundary}\r\n"),
        format!("\r\n--{boundary}--\r\n"),
    );
    let mut rest = answer.body.strip_prefix(opening.as_bytes()).unwrap();
    let mut parts = Vec::new();
    loop {
        let end_of_head = find(rest, b"\r\n\r\n").unwrap();
        let head = std::str::from_utf8(&rest[..end_of_head]).unwrap();
        let range = head
            .lines()
            .find_map(|line| line.strip_prefix("Content-Range: "))
            .unwrap();
        rest = &rest[end_of_head + 4..];
        let next = find(rest, between.as_bytes());
        let end = next.unwrap_or_else(|| find(rest, closing.as_bytes()).unwrap());
        parts.push((range.to_owned(), rest[..end].to_vec()));
        if next.is_none() {
            assert_eq!(&rest[end..], closing.as_bytes());
            return parts;
        }
        rest = &rest[end + between.len()..];
    }
}

#[test]
fn head_has_the_header_of_get_and_no_body() {
    let fixture = Fixture::new();
    let length = fixture.bytes.len().to_string();
    for headers in [&[][..], &[("Range", "bytes=0-1")]] {
        let answer = fixture.send("HEAD", headers);
        assert_eq!(answer.status, 200);
        assert_eq!(answer.header("content-length"), Some(length.as_str()));
        assert_eq!(answer.header("accept-ranges"), Some("bytes"));
        assert_eq!(answer.header("etag"), Some(fixture.etag.as_str()));
        assert!(answer.body.is_empty());
    }
}

#[test]
fn a_range_is_ignored_unless_if_range_holds() {
    let fixture = Fixture::new();
    let weak = format!("W/{}", fixture.etag);
    for (if_range, status) in [
        (fixture.etag.as_str(), 206),
        (weak.as_str(), 200),
        ("\"other\"", 200),
        ("Sun, 06 Nov 1994 08:49:37 GMT", 200),
        ("nonsense", 200),
    ] {
        let answer = fixture.send("GET", &[("Range", "bytes=0-1"), ("If-Range", if_range)]);
        assert_eq!(answer.status, status, "{if_range}");
    }
    // A range that cannot be satisfied is ignored as well when the condition fails.
    let answer = fixture.send(
        "GET",
        &[("Range", "bytes=99999999-"), ("If-Range", "\"other\"")],
    );
    assert_eq!(answer.status, 200);
}

#[test]
fn conditions_come_before_ranges() {
    let fixture = Fixture::new();
    let etag = fixture.etag.as_str();
    let list = format!("\"other\", {etag}");
    for method in ["GET", "HEAD"] {
        for (headers, status) in [
            (vec![("If-None-Match", etag)], 304),
            (vec![("If-None-Match", "*")], 304),
            (vec![("If-None-Match", list.as_str())], 304),
            (vec![("If-None-Match", "\"other\"")], 200),
            (vec![("If-Match", etag)], 200),
            (vec![("If-Match", "*")], 200),
            (vec![("If-Match", "\"other\"")], 412),
            (
                vec![("If-Match", "\"other\""), ("If-None-Match", etag)],
                412,
            ),
            (vec![("If-None-Match", etag), ("Range", "bytes=0-1")], 304),
            (vec![("If-Match", "\"other\""), ("Range", "bytes=0-1")], 412),
            (
                vec![("If-Modified-Since", "Sun, 06 Nov 2050 08:49:37 GMT")],
                200,
            ),
            (
                vec![("If-Unmodified-Since", "Sun, 06 Nov 1994 08:49:37 GMT")],
                200,
            ),
        ] {
            let answer = fixture.send(method, &headers);
            assert_eq!(answer.status, status, "{method} {headers:?}");
            if status == 304 {
                assert!(answer.body.is_empty());
                assert_eq!(answer.header("etag"), Some(etag));
            }
        }
    }
}

#[test]
fn two_range_headers_are_ignored() {
    let fixture = Fixture::new();
    let answer = fixture.send("GET", &[("Range", "bytes=0-1"), ("Range", "bytes=2-3")]);
    assert_eq!(answer.status, 200);
}
