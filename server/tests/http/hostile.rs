//! Bad input on a real socket: paths, headers, slow clients, smuggled requests, files that are wrong.
//!
//! Each gets the right status or the end of the connection, tells nothing of the server's insides, and disturbs
//! nobody else.

use crate::support::{Running, marq};
use marquetry_server::Config;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

fn config(folder: &Path) -> Config {
    Config::new("127.0.0.1:0", vec![folder.to_owned()])
}

/// A served folder with `a.marq`.
fn served() -> (tempfile::TempDir, Running) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.marq"), marq(0)).unwrap();
    let server = Running::start(config(folder.path()));
    (folder, server)
}

/// Everything that comes back until the server ends the connection, and how long that took.
fn talk(server: &Running, bytes: &[u8]) -> (String, Duration) {
    let mut stream = server.connect();
    let start = Instant::now();
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let text = String::from_utf8_lossy(&answer).into_owned();
    (text, start.elapsed())
}

fn statuses(text: &str) -> Vec<u16> {
    text.split("HTTP/1.1 ")
        .skip(1)
        .map(|rest| rest[..3].parse().unwrap())
        .collect()
}

#[test]
fn paths_lead_nowhere_but_to_what_is_served() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("served");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(outer.path().join("secret.marq"), marq(0)).unwrap();
    std::fs::write(folder.join("a.marq"), marq(1)).unwrap();
    std::fs::write(folder.join("note.json"), "{}").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outer.path().join("secret.marq"), folder.join("link.marq")).unwrap();
    let server = Running::start(config(&folder));
    let long = "a".repeat(5000);
    let deep = "a/".repeat(2000);
    for tail in [
        "../secret.marq",
        "%2e%2e/secret.marq",
        "%2e%2e%2fsecret.marq",
        "..%5csecret.marq",
        "..%c0%afsecret.marq",
        "%252e%252e/secret.marq",
        "a.marq/../../secret.marq",
        "link.marq",
        "link",
        ".",
        "..",
        "%00",
        "a%00.marq",
        "a.marq%00.png",
        "a.marq/",
        "//a.marq",
        "note.json",
        "a%0d%0aX-Injected:%20yes",
        "%",
        "%zz",
        "%ff%fe",
        "C:%5csecret",
        "%7esecret",
        "con",
        "a.marq::$DATA",
        "%F0%9F%97%BF",
        long.as_str(),
        deep.as_str(),
    ] {
        for route in ["/files/", "/pages/", "/api/files/", "/thumbnails/"] {
            let page = if route == "/pages/" { "/00/0" } else { "" };
            let answer = server.get(&format!("{route}{tail}{page}"));
            assert!(
                (400..500).contains(&answer.status),
                "{route}{tail}: {}",
                answer.status
            );
            let text = answer.text();
            let root = outer.path().to_str().unwrap();
            assert!(
                !text.contains(root) && !text.contains("secret"),
                "{route}{tail}: {text}"
            );
            assert_eq!(answer.header("x-injected"), None);
        }
    }
    assert_eq!(server.get("/files/a.marq").status, 200);
    assert_eq!(server.get("/files/%61.marq").status, 200);
}

#[test]
fn what_is_no_http_is_refused() {
    let (_folder, server) = served();
    let long_header = format!(
        "GET / HTTP/1.1\r\nHost: x\r\nX: {}\r\n\r\n",
        "y".repeat(100_000)
    );
    let many_fields = format!(
        "GET / HTTP/1.1\r\nHost: x\r\n{}\r\n",
        "X: y\r\n".repeat(1000)
    );
    let long_target = format!("GET /{} HTTP/1.1\r\nHost: x\r\n\r\n", "y".repeat(100_000));
    for request in [
        "nonsense\r\n\r\n",
        "GET\r\n\r\n",
        "GET / HTTP/9.9\r\nHost: x\r\n\r\n",
        "GET / HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n",
        "GET / HTTP/1.1\r\nHost : x\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: x\r\n folded: y\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: x\r\nX\0: y\r\n\r\n",
        "GET /\0 HTTP/1.1\r\nHost: x\r\n\r\n",
        "\x16\x03\x01\x02\x00\x01\x00\x01\r\n\r\n",
        long_header.as_str(),
        many_fields.as_str(),
        long_target.as_str(),
    ] {
        let (answer, time) = talk(&server, request.as_bytes());
        let shown = &request[..request.len().min(60)];
        for status in statuses(&answer) {
            assert!((400..500).contains(&status), "{shown:?}: {status}");
        }
        assert!(time < Duration::from_secs(9), "{shown:?}");
    }
    assert_eq!(server.get("/health").status, 200);
}

#[test]
fn a_request_cannot_hide_in_the_body_of_another() {
    let (_folder, server) = served();
    let hidden = "GET /health HTTP/1.1\r\nHost: x\r\n\r\n";
    for head in [
        // Both lengths; a proxy in front may believe the other one.
        format!("GET /nothing HTTP/1.1\r\nHost: x\r\nContent-Length: {}\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", hidden.len() + 5),
        format!("GET /nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\nContent-Length: {}\r\n\r\n0\r\n\r\n", hidden.len() + 5),
        format!("GET /nothing HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\nContent-Length: {}\r\n\r\n", hidden.len()),
        format!("GET /nothing HTTP/1.1\r\nHost: x\r\nContent-Length: {}\r\n\r\n", hidden.len()),
        format!("POST /nothing HTTP/1.1\r\nHost: x\r\nContent-Length: +{}\r\n\r\n", hidden.len()),
        format!("GET /nothing HTTP/1.1\r\nHost: x\r\nContent-Length: {},{0}\r\n\r\n", hidden.len()),
        "GET /nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked, identity\r\n\r\n".to_owned(),
        "GET /nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: xchunked\r\n\r\n".to_owned(),
        "GET /nothing HTTP/1.0\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n".to_owned(),
        "GET /nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffffff\r\n".to_owned(),
    ] {
        let (answer, _) = talk(&server, format!("{head}{hidden}").as_bytes());
        let found = statuses(&answer);
        assert!(found.len() <= 1, "{head:?} gave {found:?}");
        assert!(found.iter().all(|status| (400..500).contains(status)), "{head:?} gave {found:?}");
    }
}

#[test]
fn pipelined_requests_are_answered_in_order() {
    let (_folder, server) = served();
    let requests = "GET /files/a.marq HTTP/1.1\r\nHost: x\r\nRange: bytes=0-3\r\n\r\n".repeat(20)
        + "GET /nothing HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
    let (answer, _) = talk(&server, requests.as_bytes());
    let mut expected = vec![206; 20];
    expected.push(404);
    assert_eq!(statuses(&answer), expected);
}

#[test]
fn slow_clients_are_cut_while_others_are_served() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.marq"), marq(0)).unwrap();
    let mut settings = config(folder.path());
    settings.connections.header = Duration::from_millis(500);
    settings.connections.idle = Duration::from_millis(800);
    let server = Running::start(settings);
    let slow: Vec<_> = (0..40)
        .map(|number| {
            let mut stream = server.connect();
            std::thread::spawn(move || {
                let start = Instant::now();
                // A header that never ends, one byte at a time; or a request, and then nothing.
                let text: &[u8] = if number % 2 == 0 {
                    b"GET /files/a.marq HTTP/1.1\r\nHost: x\r\nX-Slow: abcdefghijklmnopqrstuvwxyz"
                } else {
                    b"GET /health HTTP/1.1\r\nHost: x\r\n\r\n"
                };
                for byte in text {
                    if stream.write_all(&[*byte]).is_err() {
                        break;
                    }
                    if number % 2 == 0 {
                        std::thread::sleep(Duration::from_millis(30));
                    }
                }
                let mut rest = Vec::new();
                let _ = stream.read_to_end(&mut rest);
                start.elapsed()
            })
        })
        .collect();
    let start = Instant::now();
    let mut served = 0;
    while start.elapsed() < Duration::from_millis(700) {
        assert_eq!(server.get("/files/a.marq").status, 200);
        served += 1;
    }
    assert!(served > 5, "{served}");
    for client in slow {
        let lasted = client.join().unwrap();
        assert!(lasted < Duration::from_secs(5), "{lasted:?}");
    }
}

#[test]
fn a_reader_that_takes_nothing_is_cut() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.marq"), marq(0)).unwrap();
    let mut settings = config(folder.path());
    settings.connections.write_stall = Duration::from_millis(500);
    settings.connections.min_rate = 1000;
    let server = Running::start(settings);
    let mut stream = server.connect();
    // More than all buffers on the way hold.
    let request = "GET /files/a.marq HTTP/1.1\r\nHost: x\r\n\r\n".repeat(5000);
    let writer = {
        let mut stream = stream.try_clone().unwrap();
        std::thread::spawn(move || stream.write_all(request.as_bytes()))
    };
    std::thread::sleep(Duration::from_secs(3));
    // What the kernel took is there; then comes the end, not the rest.
    let mut read = 0;
    let mut buffer = vec![0; 1 << 16];
    while let Ok(count) = stream.read(&mut buffer) {
        if count == 0 {
            break;
        }
        read += count;
    }
    assert!(read < 5000 * marq(0).len(), "{read}");
    let _ = writer.join();
    assert_eq!(server.get("/health").status, 200);
}

#[test]
fn one_address_has_so_many_connections() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = config(folder.path());
    settings.connections.per_address = 5;
    let server = Running::start(settings);
    let mut open: Vec<TcpStream> = (0..5).map(|_| server.connect()).collect();
    std::thread::sleep(Duration::from_millis(100));
    let (answer, _) = talk(
        &server,
        b"GET /health HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n",
    );
    assert_eq!(answer, "");
    open.clear();
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(server.get("/health").status, 200);
}

#[test]
fn wrong_files_are_errors_and_harm_no_other() {
    let (folder, server) = served();
    let good = marq(1);
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    put("empty.marq", b"");
    put("short.marq", &good[..good.len() - 1]);
    put("half.marq", &good[..good.len() / 2]);
    put("head.marq", &good[..40]);
    put("long.marq", &[good.clone(), vec![0]].concat());
    let mut magic = good.clone();
    magic[0] ^= 1;
    put("magic.marq", &magic);
    // Its full length from the start, as some programs copy: the beginning is there, the end is not.
    let mut unwritten = good.clone();
    let end = unwritten.len();
    unwritten[end - 200..].fill(0);
    put("unwritten.marq", &unwritten);
    std::fs::create_dir(folder.path().join("folder.marq")).unwrap();
    for name in [
        "empty",
        "short",
        "half",
        "head",
        "long",
        "magic",
        "unwritten",
    ] {
        for path in [
            format!("/files/{name}.marq"),
            format!("/pages/{name}/{}/0", "0".repeat(32)),
            format!("/api/files/{name}"),
        ] {
            let answer = server.get(&path);
            assert_eq!(answer.status, 500, "{path}");
            assert!(!answer.text().contains(folder.path().to_str().unwrap()));
        }
    }
    assert_eq!(server.get("/files/folder.marq").status, 404);
    let catalogue: serde_json::Value =
        serde_json::from_slice(&server.get("/api/catalogue").body).unwrap();
    assert_eq!(catalogue["files"].as_array().unwrap().len(), 1);
    // Written to its end, it is served.
    put("short.marq", &good);
    assert_eq!(server.get("/files/short.marq").status, 200);
    assert_eq!(server.get("/files/a.marq").status, 200);
}

#[test]
fn a_corrupt_page_is_an_error_and_the_others_are_served() {
    use marquetry_format::source::SliceSource;
    use marquetry_format::{Document, Limits, PageId};
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = marq(0);
    let mut document = Document::open(&SliceSource(bytes.as_slice()), Limits::default()).unwrap();
    document.load_index(&SliceSource(bytes.as_slice())).unwrap();
    let range = document.page_range(PageId(2)).unwrap();
    bytes[usize::try_from(range.start).unwrap() + 3] ^= 0x40;
    std::fs::write(folder.path().join("a.marq"), &bytes).unwrap();
    let server = Running::start(config(folder.path()));
    let id = document.content_id_hex();
    for (pages, status) in [("0", 200), ("2", 500), ("1-3", 500), ("3-4", 200)] {
        let answer = server.get(&format!("/pages/a/{id}/{pages}"));
        assert_eq!(answer.status, status, "{pages}");
    }
}
