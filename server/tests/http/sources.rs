//! Files that come, change and go, on disk and in a real object store; sources that fail.

use crate::support::objects::{Kind, Objects, on};
use crate::support::{Running, marq};
use marquetry_server::Config;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn names(server: &Running) -> Vec<String> {
    let json: serde_json::Value =
        serde_json::from_slice(&server.get("/api/catalogue").body).unwrap();
    let name = |file: &serde_json::Value| file["name"].as_str().unwrap().to_owned();
    json["files"].as_array().unwrap().iter().map(name).collect()
}

fn replace(path: &Path, bytes: &[u8]) {
    let new = path.with_extension("new");
    std::fs::write(&new, bytes).unwrap();
    std::fs::rename(new, path).unwrap();
}

#[test]
fn files_come_change_and_go_without_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
    let server = Running::start(config);
    let path = folder.path().join("sub/a.marq");
    assert!(names(&server).is_empty());
    assert_eq!(server.get("/files/sub/a.marq").status, 404);
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(&path, marq(0)).unwrap();
    assert_eq!(names(&server), ["sub/a"]);
    assert!(server.get("/files/sub/a.marq").body == marq(0));
    replace(&path, &marq(1));
    assert!(server.get("/files/sub/a.marq").body == marq(1));
    // Written in place, slowly: an error until it is whole, never a part or a mixture.
    let new = marq(2);
    let mut file = std::fs::File::create(&path).unwrap();
    for part in new.chunks(new.len() / 8 + 1) {
        assert_eq!(server.get("/files/sub/a.marq").status, 500);
        assert!(names(&server).is_empty());
        file.write_all(part).unwrap();
    }
    drop(file);
    assert!(server.get("/files/sub/a.marq").body == new);
    assert_eq!(names(&server), ["sub/a"]);
    std::fs::remove_file(&path).unwrap();
    assert_eq!(server.get("/files/sub/a.marq").status, 404);
    assert!(names(&server).is_empty());
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_to_where_it_points_now() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("one.marq"), marq(1)).unwrap();
    std::fs::write(path("two.marq"), marq(2)).unwrap();
    symlink("one.marq", path("current.marq")).unwrap();
    let config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
    let server = Running::start(config);
    assert!(server.get("/files/current.marq").body == marq(1));
    std::fs::remove_file(path("current.marq")).unwrap();
    symlink("two.marq", path("current.marq")).unwrap();
    assert!(server.get("/files/current.marq").body == marq(2));
}

#[test]
fn the_first_source_that_has_a_name_counts() {
    let [first, second] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    std::fs::write(second.path().join("a.marq"), marq(2)).unwrap();
    let paths = [&first, &second].map(|folder| folder.path().to_owned());
    let server = Running::start(Config::new("127.0.0.1:0", paths.to_vec()));
    assert!(server.get("/files/a.marq").body == marq(2));
    assert_eq!(names(&server), ["a"]);
}

/// The entity tag that a file should have: its content id, as its header says.
fn id_of(bytes: &[u8]) -> String {
    let id = u128::from_be_bytes(bytes[24..40].try_into().unwrap());
    format!("\"{id:032x}\"")
}

/// Replaces the served file again and again while clients read it; no body may mix two versions.
fn no_response_mixes_versions(server: &Running, put: impl Fn(&[u8]) + Sync, replacements: u32) {
    let versions: Vec<Vec<u8>> = (0..4).map(marq).collect();
    let done = AtomicBool::new(false);
    let (whole, refused) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for client in 0..4 {
            let (versions, done, whole, refused) = (&versions, &done, &whole, &refused);
            scope.spawn(move || {
                while !done.load(Relaxed) {
                    let path = "/files/a.marq";
                    let range: &[_] = if client % 2 == 0 {
                        &[]
                    } else {
                        &[("Range", "bytes=0-99,1000-4999,2500-")]
                    };
                    // Cut before anything was sent, or after: either way the client knows.
                    let Some(answer) = server.try_send("GET", path, range) else {
                        refused.fetch_add(1, Relaxed);
                        continue;
                    };
                    if answer.status >= 400 {
                        refused.fetch_add(1, Relaxed);
                        continue;
                    }
                    let etag = answer.header("etag").unwrap();
                    let version = versions.iter().find(|bytes| id_of(bytes) == etag).unwrap();
                    let length: usize = answer.header("content-length").unwrap().parse().unwrap();
                    if answer.body.len() < length {
                        refused.fetch_add(1, Relaxed);
                        continue;
                    }
                    if answer.status == 200 {
                        assert!(answer.body == *version, "a mixture");
                    } else {
                        let tail = &version[1000..];
                        let end = answer.body.windows(tail.len()).any(|window| window == tail);
                        assert!(end, "a mixture of ranges");
                    }
                    whole.fetch_add(1, Relaxed);
                }
            });
        }
        for number in 1..=replacements {
            put(&versions[number as usize % 4]);
            std::thread::sleep(Duration::from_millis(10));
        }
        done.store(true, Relaxed);
    });
    let (whole, refused) = (whole.into_inner(), refused.into_inner());
    assert!(whole > 20, "{whole} whole, {refused} refused");
}

#[test]
fn a_file_replaced_under_load_is_never_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.marq");
    std::fs::write(&path, marq(0)).unwrap();
    let server = Running::start(Config::new("127.0.0.1:0", vec![folder.path().to_owned()]));
    no_response_mixes_versions(&server, |bytes| replace(&path, bytes), 150);
}

#[test]
fn a_file_rewritten_in_place_under_load_is_never_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.marq");
    std::fs::write(&path, marq(0)).unwrap();
    let server = Running::start(Config::new("127.0.0.1:0", vec![folder.path().to_owned()]));
    no_response_mixes_versions(&server, |bytes| std::fs::write(&path, bytes).unwrap(), 150);
}

fn check_replaced(objects: &Objects) {
    objects.put("a.marq", &marq(0));
    let server = Running::start(objects.config(""));
    no_response_mixes_versions(&server, |bytes| objects.put("a.marq", bytes), 40);
}

#[test]
fn an_object_of_s3_replaced_under_load_is_never_mixed() {
    on(Kind::Amazon, |objects| check_replaced(&objects));
}

#[test]
fn an_object_of_google_replaced_under_load_is_never_mixed() {
    on(Kind::Google, |objects| check_replaced(&objects));
}

#[test]
fn an_object_of_azure_replaced_under_load_is_never_mixed() {
    on(Kind::Azure, |objects| check_replaced(&objects));
}

fn check_changes(objects: &Objects) {
    let server = Running::start(objects.config("prefix"));
    let wait = || std::thread::sleep(Duration::from_millis(300));
    assert!(names(&server).is_empty());
    assert_eq!(server.get("/files/a.marq").status, 404);
    objects.put("prefix/a.marq", &marq(0));
    objects.put("prefix/deep/er/b.marq", &marq(1));
    objects.put("prefix/note.txt", b"no file of ours");
    objects.put("prefix/a.json", br#"{"licence":"CC0-1.0"}"#);
    objects.put("prefix/broken.marq", b"broken");
    objects.put("outside.marq", &marq(2));
    wait();
    assert_eq!(names(&server), ["a", "deep/er/b"]);
    assert!(server.get("/files/a.marq").body == marq(0));
    assert!(server.get("/api/files/a").text().contains("CC0-1.0"));
    assert_eq!(server.get("/files/broken.marq").status, 500);
    assert_eq!(server.get("/files/outside.marq").status, 404);
    assert_eq!(server.get("/files/../outside.marq").status, 404);
    objects.put("prefix/a.marq", &marq(3));
    wait();
    assert!(server.get("/files/a.marq").body == marq(3));
    objects.delete("prefix/a.marq");
    wait();
    assert_eq!(server.get("/files/a.marq").status, 404);
    assert_eq!(names(&server), ["deep/er/b"]);
}

#[test]
fn objects_of_s3_come_change_and_go_without_a_restart() {
    on(Kind::Amazon, |objects| check_changes(&objects));
}

#[test]
fn objects_of_google_come_change_and_go_without_a_restart() {
    on(Kind::Google, |objects| check_changes(&objects));
}

#[test]
fn objects_of_azure_come_change_and_go_without_a_restart() {
    on(Kind::Azure, |objects| check_changes(&objects));
}

/// An HTTP origin that does what a script says, and counts.
struct Origin {
    address: SocketAddr,
    requests: Arc<AtomicUsize>,
    script: Arc<Mutex<Script>>,
}

#[derive(Clone)]
struct Script {
    bytes: Vec<u8>,
    etag: Option<&'static str>,
    /// Before each answer.
    delay: Duration,
    /// Ranges answered with 500 from now on.
    failures: usize,
    /// Ranges cut half-way from now on.
    truncations: usize,
}

impl Origin {
    fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let origin = Self {
            address: listener.local_addr().unwrap(),
            requests: Arc::default(),
            script: Arc::new(Mutex::new(Script {
                bytes: marq(0),
                etag: Some("\"zero\""),
                delay: Duration::ZERO,
                failures: 0,
                truncations: 0,
            })),
        };
        let (requests, script) = (Arc::clone(&origin.requests), Arc::clone(&origin.script));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (requests, script) = (Arc::clone(&requests), Arc::clone(&script));
                std::thread::spawn(move || answer(&stream, &requests, &script));
            }
        });
        origin
    }

    fn serve(&self) -> Running {
        let url = format!("http://{}/a.marq", self.address);
        let mut config = Config::new("127.0.0.1:0", vec![url.into()]);
        config.upstream.refresh = Duration::from_millis(100);
        config.upstream.timeout = Duration::from_secs(1);
        Running::start(config)
    }

    fn change(&self, change: impl FnOnce(&mut Script)) {
        change(&mut self.script.lock().unwrap());
    }
}

fn answer(stream: &TcpStream, requests: &AtomicUsize, script: &Mutex<Script>) {
    let mut reader = BufReader::new(stream);
    loop {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if reader.read_line(&mut head).is_ok_and(|read| read > 0) {
                continue;
            }
            return;
        }
        requests.fetch_add(1, Relaxed);
        let (now, fail, cut) = {
            let mut script = script.lock().unwrap();
            let get = head.starts_with("GET");
            let fail = get && script.failures > 0;
            let cut = get && !fail && script.truncations > 0;
            script.failures -= usize::from(fail);
            script.truncations -= usize::from(cut);
            (script.clone(), fail, cut)
        };
        std::thread::sleep(now.delay);
        let total = now.bytes.len();
        let etag = now
            .etag
            .map_or(String::new(), |etag| format!("ETag: {etag}\r\n"));
        let field = |name: &str| {
            let lower = head.to_ascii_lowercase();
            let at = lower.find(&format!("\r\n{name}: "))? + name.len() + 4;
            Some(head[at..].split("\r\n").next().unwrap().to_owned())
        };
        let mut stream = stream;
        let condition = field("if-match");
        if fail {
            let _ = stream.write_all(b"HTTP/1.1 500 Oops\r\nContent-Length: 0\r\n\r\n");
        } else if condition.is_some_and(|tag| Some(tag.as_str()) != now.etag) {
            let _ = stream.write_all(b"HTTP/1.1 412 No\r\nContent-Length: 0\r\n\r\n");
        } else if head.starts_with("HEAD") {
            let _ = write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Length: {total}\r\n{etag}\r\n"
            );
        } else if let Some(range) = field("range") {
            let (start, end) = range
                .strip_prefix("bytes=")
                .unwrap()
                .split_once('-')
                .unwrap();
            let start: usize = start.parse().unwrap();
            let end = end.parse::<usize>().unwrap().min(total - 1);
            let length = end + 1 - start;
            let _ = write!(
                stream,
                "HTTP/1.1 206 Partial\r\nContent-Length: {length}\r\n{etag}\
                 Content-Range: bytes {start}-{end}/{total}\r\n\r\n"
            );
            let sent = if cut { length / 2 } else { length };
            let _ = stream.write_all(&now.bytes[start..start + sent]);
            if cut {
                return;
            }
        } else {
            let _ = stream.write_all(b"HTTP/1.1 400 No\r\nContent-Length: 0\r\n\r\n");
        }
    }
}

#[test]
fn an_origin_that_stumbles_is_asked_once_more() {
    let origin = Origin::start();
    let server = origin.serve();
    origin.change(|script| script.failures = 1);
    assert!(server.get("/files/a.marq").body == marq(0));
    // A new version, since the old one is in memory.
    origin.change(|script| {
        (script.bytes, script.etag, script.truncations) = (marq(1), Some("\"one\""), 1);
    });
    std::thread::sleep(Duration::from_millis(150));
    assert!(server.get("/files/a.marq").body == marq(1));
}

#[test]
fn an_origin_that_fails_gives_502_and_one_that_hangs_504() {
    let origin = Origin::start();
    let server = origin.serve();
    origin.change(|script| script.failures = 1000);
    let before = origin.requests.load(Relaxed);
    assert_eq!(server.get("/files/a.marq").status, 502);
    // The version, the bytes, the bytes once more.
    assert_eq!(origin.requests.load(Relaxed) - before, 3);
    origin.change(|script| (script.failures, script.delay) = (0, Duration::from_secs(30)));
    let start = Instant::now();
    let status = server.get("/files/a.marq").status;
    assert!(status == 504 || status == 502, "{status}");
    assert!(start.elapsed() < Duration::from_secs(10));
    origin.change(|script| script.delay = Duration::ZERO);
    assert!(server.get("/files/a.marq").body == marq(0));
    // What is known goes on while upstream does not answer.
    origin.change(|script| script.delay = Duration::from_secs(30));
    std::thread::sleep(Duration::from_millis(150));
    assert!(server.get("/files/a.marq").body == marq(0));
}

#[test]
fn many_that_ask_at_once_cause_one_request() {
    let origin = Origin::start();
    let server = origin.serve();
    origin.change(|script| script.delay = Duration::from_millis(200));
    let before = origin.requests.load(Relaxed);
    std::thread::scope(|scope| {
        for _ in 0..20 {
            scope.spawn(|| assert!(server.get("/files/a.marq").body == marq(0)));
        }
    });
    // The version, perhaps twice since time passes, and one block: the whole file is smaller.
    let asked = origin.requests.load(Relaxed) - before;
    assert!(asked <= 4, "{asked}");
}

#[test]
fn versions_that_cannot_be_told_apart_are_not_served() {
    let origin = Origin::start();
    let server = origin.serve();
    for etag in [None, Some("W/\"weak\"")] {
        origin.change(|script| script.etag = etag);
        assert_eq!(server.get("/files/a.marq").status, 502, "{etag:?}");
    }
}

#[test]
fn bytes_that_are_not_what_their_checksums_say_are_not_passed_on() {
    let origin = Origin::start();
    let server = origin.serve();
    let id = server
        .get("/files/a.marq")
        .header("etag")
        .unwrap()
        .to_owned();
    let mut mixed = marq(0);
    let end = mixed.len();
    mixed[end - 300..].fill(7);
    origin.change(|script| (script.bytes, script.etag) = (mixed, Some("\"mixed\"")));
    std::thread::sleep(Duration::from_millis(150));
    let page = format!("/pages/a/{}/4", id.trim_matches('"'));
    assert_eq!(server.get(&page).status, 500);
}

#[test]
fn a_body_that_breaks_off_is_never_passed_on_as_whole() {
    let origin = Origin::start();
    let server = origin.serve();
    origin.change(|script| script.truncations = 1000);
    let mut stream = server.connect();
    stream
        .write_all(b"GET /files/a.marq HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut all = Vec::new();
    let _ = stream.read_to_end(&mut all);
    assert!(
        !all.starts_with(b"HTTP/1.1 2"),
        "{}",
        String::from_utf8_lossy(&all)
    );
}
