//! Everything but byte ranges: pages, catalogue, viewer, headers, names, deadlines, the end.

use crate::support::{PICTURE, Running, marq, pictured_marq, textured_marq};
use marquetry_format::source::SliceSource;
use marquetry_format::{ColourIndex, Document, Limits, PageId, TileId};
use marquetry_server::{Config, Server, ServerError};
use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

fn serve(folder: &Path) -> Running {
    Running::start(Config::new("127.0.0.1:0", vec![folder.to_owned()]))
}

/// A served folder with `a.marq`; its bytes, and its pages' places.
fn one_file() -> (tempfile::TempDir, Running, Vec<u8>, Document) {
    let folder = tempfile::tempdir().unwrap();
    let bytes = marq(0);
    std::fs::write(folder.path().join("a.marq"), &bytes).unwrap();
    let source = SliceSource(bytes.as_slice());
    let mut document = Document::open(&source, Limits::default()).unwrap();
    document.load_index(&source).unwrap();
    let server = serve(folder.path());
    (folder, server, bytes, document)
}

#[test]
fn pages_are_the_bytes_of_the_file_and_immutable() {
    let (_folder, server, bytes, document) = one_file();
    let id = document.content_id_hex();
    assert_eq!(document.page_count(), 5);
    let stored = |first: u32, last: u32| {
        let place = |page| document.page(PageId(page)).unwrap();
        let end = place(last).offset + u64::from(place(last).length);
        &bytes[usize::try_from(place(first).offset).unwrap()..usize::try_from(end).unwrap()]
    };
    for (path, first, last) in [
        (format!("/pages/a/{id}/0"), 0, 0),
        (format!("/pages/a/{id}/3"), 3, 3),
        (format!("/pages/a/{id}/1-4"), 1, 4),
        (format!("/pages/a.marq/{id}/0-4"), 0, 4),
        (format!("/pages/a/{id}/2-2"), 2, 2),
    ] {
        let answer = server.get(&path);
        assert_eq!(answer.status, 200, "{path}");
        assert!(answer.body == stored(first, last), "{path}");
        let cache = answer.header("cache-control").unwrap();
        assert_eq!(cache, "public, max-age=31536000, immutable");
        let etag = answer.header("etag").unwrap().to_owned();
        let again = server.send("GET", &path, &[("If-None-Match", &etag)]);
        assert_eq!(again.status, 304);
        let head = server.send("HEAD", &path, &[]);
        assert_eq!(
            head.header("content-length"),
            answer.header("content-length")
        );
    }
}

#[test]
fn colour_tiles_are_pages_after_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = textured_marq(0);
    std::fs::write(folder.path().join("a.marq"), &bytes).unwrap();
    let server = serve(folder.path());
    let document = Document::open(&bytes, Limits::default()).unwrap();
    let mut index = ColourIndex::of(&document, Limits::default())
        .unwrap()
        .unwrap();
    index.load(&bytes).unwrap();
    assert_eq!((document.page_count(), index.tile_count()), (5, 3));
    let id = document.content_id_hex();
    let start = |tile| index.tile_range(TileId(tile)).unwrap();
    for (pages, first, last) in [("5", 0, 0), ("7", 2, 2), ("5-7", 0, 2), ("6-7", 1, 2)] {
        let answer = server.get(&format!("/pages/a/{id}/{pages}"));
        let stored = start(first).start..start(last).end;
        let stored = usize::try_from(stored.start).unwrap()..usize::try_from(stored.end).unwrap();
        assert_eq!(answer.status, 200, "{pages}");
        assert!(answer.body == bytes[stored], "{pages}");
    }
    for pages in ["8", "5-8", "4-5", "0-7"] {
        let answer = server.get(&format!("/pages/a/{id}/{pages}"));
        assert_eq!(answer.status, 404, "{pages}");
    }
}

#[test]
fn page_requests_that_make_no_sense_say_so() {
    let (_folder, server, _, document) = one_file();
    let id = document.content_id_hex();
    let other = "0".repeat(32);
    for (path, status) in [
        (format!("/pages/a/{other}/0"), 410),
        (format!("/pages/a/{}/0", id.to_uppercase()), 410),
        (format!("/pages/b/{id}/0"), 404),
        (format!("/pages/a/{id}/5"), 404),
        (format!("/pages/a/{id}/0-5"), 404),
        (format!("/pages/a/{id}/4294967295"), 404),
        (format!("/pages/a/{id}/x"), 400),
        (format!("/pages/a/{id}/-1"), 400),
        (format!("/pages/a/{id}/2-1"), 400),
        (format!("/pages/a/{id}/0-256"), 400),
        (format!("/pages/a/{id}"), 404),
        ("/pages/0".to_owned(), 404),
        ("/pages/".to_owned(), 404),
    ] {
        let answer = server.get(&path);
        assert_eq!(answer.status, status, "{path}");
        assert!(answer.text().len() > 10, "{path}");
        assert_eq!(answer.header("cache-control"), Some("no-store"), "{path}");
    }
}

#[test]
fn the_catalogue_lists_what_can_be_served() {
    let (folder, server, bytes, document) = one_file();
    std::fs::create_dir(folder.path().join("sub folder")).unwrap();
    std::fs::write(folder.path().join("sub folder/b.marq"), marq(1)).unwrap();
    std::fs::write(folder.path().join("broken.marq"), &bytes[..100]).unwrap();
    let answer = server.get("/api/catalogue");
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("content-type"), Some("application/json"));
    let json: serde_json::Value = serde_json::from_slice(&answer.body).unwrap();
    let files = json["files"].as_array().unwrap();
    assert_eq!(files.len(), 2);
    let (a, b) = (&files[0], &files[1]);
    assert_eq!(a["name"], "a");
    assert_eq!(a["bytes"], bytes.len());
    assert_eq!(a["content_id"], document.content_id_hex());
    assert_eq!(a["kind"], "scan");
    assert_eq!(a["triangles"], 7);
    assert_eq!(a["bounds"]["max"], serde_json::json!([1.0, 1.0, 0.5]));
    assert_eq!(a["up"], "z");
    assert_eq!(b["name"], "sub folder/b");
    for file in files {
        assert_eq!(server.get(file["url"].as_str().unwrap()).status, 200);
        let page = format!("{}/0", file["pages_url"].as_str().unwrap());
        assert_eq!(server.get(&page).status, 200);
    }
    std::fs::remove_file(folder.path().join("a.marq")).unwrap();
    let json: serde_json::Value =
        serde_json::from_slice(&server.get("/api/catalogue").body).unwrap();
    assert_eq!(json["files"].as_array().unwrap().len(), 1);
}

#[test]
fn the_picture_in_a_file_is_served_and_shown_in_the_catalogue() {
    let (folder, server, _, plain) = one_file();
    let bytes = pictured_marq(3);
    std::fs::write(folder.path().join("b.marq"), &bytes).unwrap();
    let about = br#"{"title":"A <statue>","attribution":"Somebody","licence":"CC-BY-4.0"}"#;
    std::fs::write(folder.path().join("b.json"), about).unwrap();
    let id = Document::open(&bytes, Limits::default())
        .unwrap()
        .content_id_hex();
    let json: serde_json::Value =
        serde_json::from_slice(&server.get("/api/catalogue").body).unwrap();
    let [a, b] = [0, 1].map(|at| &json["files"][at]);
    assert!(a["thumbnail_url"].is_null(), "{a}");
    assert_eq!(b["thumbnail_url"], format!("/thumbnails/b/{id}"));
    assert_eq!(
        (&b["title"], &b["licence"]),
        (&"A <statue>".into(), &"CC-BY-4.0".into())
    );

    let path = b["thumbnail_url"].as_str().unwrap();
    let answer = server.get(path);
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("content-type"), Some("image/webp"));
    let cache = answer.header("cache-control").unwrap();
    assert_eq!(cache, "public, max-age=31536000, immutable");
    assert!(answer.body == PICTURE);
    let etag = answer.header("etag").unwrap().to_owned();
    let again = server.send("GET", path, &[("If-None-Match", &etag)]);
    assert_eq!((again.status, again.body.len()), (304, 0));
    let none = server.get(&format!("/thumbnails/a/{}", plain.content_id_hex()));
    assert_eq!(none.status, 404);

    let page = String::from_utf8(server.get("/catalogue").body).unwrap();
    assert_eq!(page.matches("<img").count(), 1, "{page}");
    for words in [
        &format!("src=\"{path}\""),
        "A &lt;statue&gt;",
        "Scan, 7 triangles",
        "Somebody",
        "Licence: CC-BY-4.0",
        "no picture",
    ] {
        assert!(page.contains(words), "{words} is not in {page}");
    }
}

#[test]
fn a_damaged_picture_is_an_error_and_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = pictured_marq(3);
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(folder.path().join("a.marq"), &bytes).unwrap();
    let server = serve(folder.path());
    let document = Document::open(&bytes, Limits::default()).unwrap();
    let path = format!("/thumbnails/a/{}", document.content_id_hex());
    assert!(server.get(&path).status >= 500);
    assert_eq!(server.get("/files/a.marq").status, 200);
}

#[test]
fn a_replaced_file_is_served_anew_under_new_urls() {
    let (folder, server, _, document) = one_file();
    let page = format!("/pages/a/{}/0", document.content_id_hex());
    assert_eq!(server.get(&page).status, 200);
    let new = marq(1);
    std::fs::write(folder.path().join("new"), &new).unwrap();
    std::fs::rename(folder.path().join("new"), folder.path().join("a.marq")).unwrap();
    assert_eq!(server.get(&page).status, 410);
    assert!(server.get("/files/a.marq").body == new);
}

#[test]
fn every_answer_may_be_read_by_any_origin() {
    let (_folder, server, _, document) = one_file();
    let page = format!("/pages/a/{}/0", document.content_id_hex());
    for (method, path) in [
        ("GET", "/"),
        ("GET", "/files/a.marq"),
        ("GET", page.as_str()),
        ("GET", "/api/catalogue"),
        ("GET", "/health"),
        ("GET", "/nothing"),
        ("POST", "/files/a.marq"),
        ("OPTIONS", "/files/a.marq"),
        ("OPTIONS", "/nothing"),
    ] {
        let answer = server.send(method, path, &[("Origin", "https://example.org")]);
        assert_eq!(
            answer.header("access-control-allow-origin"),
            Some("*"),
            "{path}"
        );
        assert_eq!(
            answer.header("x-content-type-options"),
            Some("nosniff"),
            "{path}"
        );
        let exposed = answer.header("access-control-expose-headers").unwrap();
        for name in ["Content-Range", "ETag", "Accept-Ranges", "Content-Length"] {
            assert!(exposed.contains(name), "{path}");
        }
    }
    let preflight = server.send(
        "OPTIONS",
        "/files/a.marq",
        &[
            ("Origin", "https://example.org"),
            ("Access-Control-Request-Method", "GET"),
            ("Access-Control-Request-Headers", "range, if-range"),
        ],
    );
    assert_eq!(preflight.status, 204);
    let allowed = preflight.header("access-control-allow-headers").unwrap();
    assert!(allowed.contains("Range") && allowed.contains("If-Range"));
    let methods = preflight.header("access-control-allow-methods").unwrap();
    assert!(methods.contains("GET") && methods.contains("HEAD"));
}

#[test]
fn names_do_not_lead_out_of_the_folder() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("served");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(outer.path().join("secret.marq"), marq(0)).unwrap();
    std::fs::write(folder.join("a.marq"), marq(1)).unwrap();
    std::fs::write(folder.join(".hidden.marq"), marq(2)).unwrap();
    std::fs::write(folder.join("note.txt"), "secret").unwrap();
    let server = serve(&folder);
    let absolute = format!("/files/{}", outer.path().join("secret.marq").display());
    for path in [
        "/files/../secret.marq",
        "/files/%2e%2e/secret.marq",
        "/files/..%2fsecret.marq",
        "/files/a.marq/../../secret.marq",
        "/files/./a.marq",
        "/files//a.marq",
        "/files/.hidden.marq",
        "/files/note.txt",
        "/files/a.marq%00",
        "/files/%ff",
        "/files/",
        "/files",
        absolute.as_str(),
    ] {
        let status = server.get(path).status;
        assert!((400..500).contains(&status), "{path}: {status}");
    }
    assert_eq!(server.get("/files/a.marq").status, 200);
    assert_eq!(server.get("/files/a").status, 200);
}

#[test]
fn only_reading_is_allowed() {
    let (_folder, server, _, _) = one_file();
    for method in ["POST", "PUT", "DELETE", "PATCH"] {
        for path in ["/files/a.marq", "/", "/nothing"] {
            let answer = server.send(method, path, &[("Content-Length", "0")]);
            assert_eq!(answer.status, 405, "{method} {path}");
        }
    }
}

#[test]
fn the_viewer_or_how_to_build_it_is_at_the_root() {
    let (_folder, server, _, _) = one_file();
    for path in ["/", "/?file=a"] {
        let answer = server.get(path);
        assert_eq!(answer.status, 200);
        assert_eq!(
            answer.header("content-type"),
            Some("text/html; charset=utf-8")
        );
        let policy = answer.header("content-security-policy").unwrap();
        assert!(policy.contains("'wasm-unsafe-eval'"));
    }
    assert_eq!(server.get("/nothing.js").status, 404);
}

#[test]
fn health_is_good() {
    let (_folder, server, _, _) = one_file();
    let answer = server.get("/health");
    assert_eq!(answer.status, 200);
    let json: serde_json::Value = serde_json::from_slice(&answer.body).unwrap();
    assert_eq!(json["status"], "ok");
}

#[test]
fn a_half_sent_header_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
    config.connections.header = Duration::from_millis(300);
    let server = Running::start(config);
    for start in ["GET /health HTTP/1.1\r\nHost: te", ""] {
        let mut stream = server.connect();
        stream.write_all(start.as_bytes()).unwrap();
        let begin = Instant::now();
        let mut rest = Vec::new();
        // The end of the stream, or a reset: either way nobody waits.
        let _ = stream.read_to_end(&mut rest);
        assert!(begin.elapsed() < Duration::from_secs(5));
        assert!(!rest.starts_with(b"HTTP/1.1 200"));
    }
    assert_eq!(server.get("/health").status, 200);
}

#[test]
fn connections_beyond_the_limit_wait_their_turn() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
    config.connections.open = 1;
    config.connections.header = Duration::from_millis(300);
    let server = Running::start(config);
    let _idle = server.connect();
    assert_eq!(server.get("/health").status, 200);
}

#[test]
fn a_server_stops_when_asked_even_with_idle_connections() {
    let (_folder, mut server, _, _) = one_file();
    let mut stream = server.connect();
    stream
        .write_all(b"GET /health HTTP/1.1\r\nHost: test\r\n\r\n")
        .unwrap();
    let mut first = [0; 12];
    stream.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"HTTP/1.1 200");
    let begin = Instant::now();
    server.stop();
    assert!(begin.elapsed() < Duration::from_secs(5));
}

#[tokio::test]
async fn what_cannot_be_served_is_refused_at_start() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    assert!(matches!(
        Server::bind(Config::new("127.0.0.1:0", vec![missing])).await,
        Err(ServerError::Path { .. })
    ));
    let cut_short = folder.path().join("a.marq");
    std::fs::write(&cut_short, &marq(0)[..500]).unwrap();
    let error = Server::bind(Config::new("127.0.0.1:0", vec![cut_short]))
        .await
        .unwrap_err();
    assert!(error.to_string().contains("a.marq"), "{error}");
    let path = folder.path().to_owned();
    assert!(matches!(
        Server::bind(Config::new("nonsense", vec![path])).await,
        Err(ServerError::Listen { .. })
    ));
}
