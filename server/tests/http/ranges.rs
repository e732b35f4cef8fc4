//! Byte ranges and conditions of `/files`, against RFC 9110, on a real socket, from every kind of source.

use crate::support::objects::{Kind, Objects, on};
use crate::support::{Answer, Running, marq};
use marquetry_server::Config;
use std::ops::Range;
use std::time::{Duration, SystemTime};

/// A server of the file `a`, wherever it comes from.
struct Fixture {
    server: Running,
    bytes: Vec<u8>,
    etag: String,
    date: String,
    /// What has to live as long.
    _keep: Vec<Box<dyn std::any::Any>>,
}

/// An hour ago: a date that may be relied on.
fn old() -> SystemTime {
    SystemTime::now() - Duration::from_hours(1)
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.marq");
    std::fs::write(&path, marq(0)).unwrap();
    let file = std::fs::File::options().write(true).open(path).unwrap();
    file.set_modified(old()).unwrap();
    folder
}

impl Fixture {
    fn of(server: Running, keep: Vec<Box<dyn std::any::Any>>) -> Self {
        let answer = server.get("/files/a.marq");
        assert_eq!(
            answer.status,
            200,
            "{}",
            String::from_utf8_lossy(&answer.body)
        );
        Self {
            etag: answer.header("etag").unwrap().to_owned(),
            date: answer.header("last-modified").unwrap().to_owned(),
            server,
            bytes: marq(0),
            _keep: keep,
        }
    }

    fn file() -> Self {
        let folder = folder();
        let path = folder.path().join("a.marq");
        let server = Running::start(Config::new("127.0.0.1:0", vec![path]));
        Self::of(server, vec![Box::new(folder)])
    }

    fn folder() -> Self {
        let folder = folder();
        let path = folder.path().to_owned();
        let server = Running::start(Config::new("127.0.0.1:0", vec![path]));
        Self::of(server, vec![Box::new(folder)])
    }

    /// A folder behind one server behind another.
    fn origin(path: &str) -> Self {
        let folder = folder();
        let config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
        let origin = Running::start(config);
        let url = format!("http://{}{path}", origin.address);
        let server = Running::start(Config::new("127.0.0.1:0", vec![url.into()]));
        Self::of(server, vec![Box::new(origin), Box::new(folder)])
    }

    fn object(objects: Objects) -> Self {
        objects.put("some/a.marq", &marq(0));
        // Until its date may be relied on.
        std::thread::sleep(Duration::from_secs(4));
        let server = Running::start(objects.config("some"));
        Self::of(server, vec![Box::new(objects)])
    }
}

/// What a request gives.
#[derive(Debug, Clone)]
enum Expected {
    /// 200 and everything.
    Whole,
    /// 206 and one part.
    Part(Range<usize>),
    /// 206 and several parts.
    Parts(Vec<Range<usize>>),
    /// 416.
    Unsatisfiable,
    /// 304.
    NotModified,
    /// 412.
    Failed,
}

/// A request's headers and what they give.
type Row = (Vec<(&'static str, String)>, Expected);

/// What `Range` alone gives, for a file of `n` bytes.
fn range_rows(n: usize) -> Vec<Row> {
    use Expected::{Part, Parts, Unsatisfiable, Whole};
    let table = [
        ("bytes=0-0".to_owned(), Part(0..1)),
        ("bytes=0-99".to_owned(), Part(0..100)),
        ("bytes=100-199".to_owned(), Part(100..200)),
        ("bytes=0000100-0000199".to_owned(), Part(100..200)),
        (format!("bytes={}-{}", n - 1, n - 1), Part(n - 1..n)),
        (format!("bytes=0-{}", n - 1), Part(0..n)),
        (format!("bytes=0-{n}"), Part(0..n)),
        (format!("bytes=10-{}", n + 5), Part(10..n)),
        ("bytes=10-18446744073709551615".to_owned(), Part(10..n)),
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
        ("bytes=-99999999999999999999999".to_owned(), Part(0..n)),
        ("BYTES=0-0".to_owned(), Part(0..1)),
        ("bytes=0-10,5-20".to_owned(), Part(0..21)),
        ("bytes=0-10,11-20".to_owned(), Part(0..21)),
        ("bytes=5-20,0-10".to_owned(), Part(0..21)),
        ("bytes=0-,-1".to_owned(), Part(0..n)),
        (format!("bytes={n}-,0-4"), Part(0..5)),
        ("bytes=0-1,10-11".to_owned(), Parts(vec![0..2, 10..12])),
        ("bytes=10-11, 0-1".to_owned(), Parts(vec![10..12, 0..2])),
        ("bytes=0-0,-1".to_owned(), Parts(vec![0..1, n - 1..n])),
        ("bytes=,0-1 ,, 10-11,".to_owned(), Parts(vec![0..2, 10..12])),
        (format!("bytes=0-1,{n}-,10-11"), Parts(vec![0..2, 10..12])),
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
        (format!("bytes={n}-,-0"), Unsatisfiable),
        (format!("bytes={}", ["0-0"; 33].join(",")), Unsatisfiable),
        ("bytes=5-4".to_owned(), Whole),
        ("bytes=".to_owned(), Whole),
        ("bytes=-".to_owned(), Whole),
        ("bytes=--1".to_owned(), Whole),
        ("bytes=a-b".to_owned(), Whole),
        ("bytes=0-1,x".to_owned(), Whole),
        ("bytes=1-2-3".to_owned(), Whole),
        ("bytes=+1-2".to_owned(), Whole),
        ("bytes 0-1".to_owned(), Whole),
        ("items=0-1".to_owned(), Whole),
        ("seconds=1-2".to_owned(), Whole),
        (String::new(), Whole),
    ];
    table
        .into_iter()
        .map(|(range, expected)| (vec![("Range", range)], expected))
        .collect()
}

/// What conditions give, alone and with `Range`.
fn condition_rows(etag: &str, date: &str) -> Vec<Row> {
    use Expected::{Failed, NotModified, Part, Unsatisfiable, Whole};
    let (weak, list) = (format!("W/{etag}"), format!("\"other\", {etag}"));
    let (weak, list) = (weak.as_str(), list.as_str());
    let (past, future) = (
        "Sun, 06 Nov 1994 08:49:37 GMT",
        "Sun, 06 Nov 2050 08:49:37 GMT",
    );
    let other = "\"other\"";
    let two = ("Range", "bytes=0-1");
    let part = || Part(0..2);
    let table: Vec<(Vec<(&'static str, &str)>, Expected)> = vec![
        (vec![], Whole),
        (vec![("If-None-Match", etag)], NotModified),
        (vec![("If-None-Match", weak)], NotModified),
        (vec![("If-None-Match", "*")], NotModified),
        (vec![("If-None-Match", list)], NotModified),
        (vec![("If-None-Match", other)], Whole),
        (vec![("If-None-Match", "other")], Whole),
        (
            vec![("If-None-Match", other), ("If-None-Match", etag)],
            NotModified,
        ),
        (vec![("If-None-Match", etag), two], NotModified),
        (vec![("If-None-Match", other), two], part()),
        (vec![("If-Match", etag)], Whole),
        (vec![("If-Match", "*")], Whole),
        (vec![("If-Match", list)], Whole),
        (vec![("If-Match", weak)], Failed),
        (vec![("If-Match", other)], Failed),
        (vec![("If-Match", other), two], Failed),
        (vec![("If-Match", etag), two], part()),
        (vec![("If-Match", other), ("If-None-Match", etag)], Failed),
        (
            vec![("If-Match", etag), ("If-None-Match", etag)],
            NotModified,
        ),
        (vec![("If-Modified-Since", date)], NotModified),
        (vec![("If-Modified-Since", future)], NotModified),
        (vec![("If-Modified-Since", past)], Whole),
        (vec![("If-Modified-Since", "yesterday")], Whole),
        (vec![("If-Modified-Since", date), two], NotModified),
        (vec![("If-Modified-Since", past), two], part()),
        (
            vec![("If-Modified-Since", date), ("If-None-Match", other)],
            Whole,
        ),
        (
            vec![("If-Modified-Since", past), ("If-None-Match", etag)],
            NotModified,
        ),
        (vec![("If-Unmodified-Since", date)], Whole),
        (vec![("If-Unmodified-Since", future)], Whole),
        (vec![("If-Unmodified-Since", past)], Failed),
        (vec![("If-Unmodified-Since", "yesterday")], Whole),
        (
            vec![("If-Unmodified-Since", past), ("If-Match", etag)],
            Whole,
        ),
        (vec![("If-Unmodified-Since", past), two], Failed),
        (vec![("If-Range", etag), two], part()),
        (vec![("If-Range", weak), two], Whole),
        (vec![("If-Range", other), two], Whole),
        (vec![("If-Range", list), two], Whole),
        (vec![("If-Range", date), two], part()),
        (vec![("If-Range", past), two], Whole),
        (vec![("If-Range", future), two], Whole),
        (vec![("If-Range", "nonsense"), two], Whole),
        (vec![("If-Range", etag)], Whole),
        (
            vec![("If-Range", other), ("Range", "bytes=99999999-")],
            Whole,
        ),
        (
            vec![("If-Range", etag), ("Range", "bytes=99999999-")],
            Unsatisfiable,
        ),
        (
            vec![("If-Range", etag), ("If-None-Match", etag), two],
            NotModified,
        ),
        (vec![("If-Range", etag), ("If-Range", etag), two], Whole),
        (vec![two, ("Range", "bytes=2-3")], Whole),
    ];
    table
        .into_iter()
        .map(|(headers, expected)| {
            let headers = headers
                .into_iter()
                .map(|(name, value)| (name, value.to_owned()));
            (headers.collect(), expected)
        })
        .collect()
}

fn check_all(fixture: &Fixture) {
    let n = fixture.bytes.len();
    assert!(n > 2000, "{n}");
    let mut rows = range_rows(n);
    rows.extend(condition_rows(&fixture.etag, &fixture.date));
    assert!(rows.len() >= 80, "{}", rows.len());
    for (headers, expected) in rows {
        let headers: Vec<_> = headers
            .iter()
            .map(|(name, value)| (*name, value.as_str()))
            .collect();
        let answer = fixture.server.send("GET", "/files/a.marq", &headers);
        check(fixture, &headers, &answer, &expected);
        // A HEAD has no ranges, and else the header of a GET.
        let plain: Vec<_> = headers
            .into_iter()
            .filter(|(name, _)| *name != "Range")
            .collect();
        let answer = fixture.server.send("HEAD", "/files/a.marq", &plain);
        let status = match expected {
            Expected::NotModified => 304,
            Expected::Failed => 412,
            _ => 200,
        };
        assert_eq!(answer.status, status, "HEAD {plain:?}");
        assert!(answer.body.is_empty(), "HEAD {plain:?}");
        if status == 200 {
            let length = n.to_string();
            assert_eq!(
                answer.header("content-length"),
                Some(length.as_str()),
                "HEAD {plain:?}"
            );
            assert_eq!(
                answer.header("accept-ranges"),
                Some("bytes"),
                "HEAD {plain:?}"
            );
            assert_eq!(
                answer.header("etag"),
                Some(fixture.etag.as_str()),
                "HEAD {plain:?}"
            );
        }
    }
}

fn check(fixture: &Fixture, headers: &[(&str, &str)], answer: &Answer, expected: &Expected) {
    let bytes = &fixture.bytes;
    let n = bytes.len();
    let content_range = |part: &Range<usize>| format!("bytes {}-{}/{n}", part.start, part.end - 1);
    let found_range = answer.header("content-range");
    let status = match expected {
        Expected::Whole => {
            assert!(answer.body == *bytes, "{headers:?}");
            assert_eq!(found_range, None, "{headers:?}");
            200
        }
        Expected::Part(part) => {
            assert_eq!(
                found_range,
                Some(content_range(part).as_str()),
                "{headers:?}"
            );
            assert!(answer.body == bytes[part.clone()], "{headers:?}");
            206
        }
        Expected::Parts(parts) => {
            assert_eq!(found_range, None, "{headers:?}");
            let found = multipart(answer);
            assert_eq!(found.len(), parts.len(), "{headers:?}");
            for ((found_range, body), part) in found.iter().zip(parts) {
                assert_eq!(*found_range, content_range(part), "{headers:?}");
                assert!(*body == bytes[part.clone()], "{headers:?}");
            }
            206
        }
        Expected::Unsatisfiable => {
            let expected = format!("bytes */{n}");
            assert_eq!(found_range, Some(expected.as_str()), "{headers:?}");
            416
        }
        Expected::NotModified => {
            assert!(answer.body.is_empty(), "{headers:?}");
            assert_eq!(answer.header("content-length"), None, "{headers:?}");
            assert_eq!(answer.header("content-type"), None, "{headers:?}");
            304
        }
        Expected::Failed => 412,
    };
    assert_eq!(answer.status, status, "{headers:?}");
    if status != 304 {
        let length = answer.body.len().to_string();
        assert_eq!(
            answer.header("content-length"),
            Some(length.as_str()),
            "{headers:?}"
        );
    }
    if status < 400 {
        assert_eq!(
            answer.header("etag"),
            Some(fixture.etag.as_str()),
            "{headers:?}"
        );
        assert_eq!(
            answer.header("last-modified"),
            Some(fixture.date.as_str()),
            "{headers:?}"
        );
        assert_eq!(answer.header("accept-ranges"), Some("bytes"), "{headers:?}");
    }
}

#[test]
fn a_file_is_answered_as_rfc_9110_says() {
    check_all(&Fixture::file());
}

#[test]
fn a_folder_is_answered_as_rfc_9110_says() {
    check_all(&Fixture::folder());
}

#[test]
fn a_file_of_an_http_origin_is_answered_as_rfc_9110_says() {
    check_all(&Fixture::origin("/files/a.marq"));
}

#[test]
fn a_folder_of_an_http_origin_is_answered_as_rfc_9110_says() {
    check_all(&Fixture::origin("/files/"));
}

fn check_object(kind: Kind) {
    on(kind, |objects| check_all(&Fixture::object(objects)));
}

#[test]
fn an_object_of_s3_is_answered_as_rfc_9110_says() {
    check_object(Kind::Amazon);
}

#[test]
fn an_object_of_google_is_answered_as_rfc_9110_says() {
    check_object(Kind::Google);
}

#[test]
fn an_object_of_azure_is_answered_as_rfc_9110_says() {
    check_object(Kind::Azure);
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
fn a_hundred_thousand_ranges_are_refused_cheaply() {
    let fixture = Fixture::file();
    let header = format!("bytes={}", "0-0,".repeat(100_000));
    let answer = fixture
        .server
        .send("GET", "/files/a.marq", &[("Range", &header)]);
    assert_eq!(answer.status, 431);
    let header = format!("bytes={}", "0-0,".repeat(3_000));
    let answer = fixture
        .server
        .send("GET", "/files/a.marq", &[("Range", &header)]);
    assert_eq!(answer.status, 416);
    assert_eq!(fixture.server.get("/files/a.marq").status, 200);
}
