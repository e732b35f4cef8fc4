//! What an operator relies on: tokens, limits, TLS and HTTP/2, health, metrics, an orderly end.

use crate::support::{Answer, Running, exchange, marq};
use hyper::body::{Body, Bytes};
use hyper_util::rt::{TokioExecutor, TokioIo};
use marquetry_server::config::{Auth, Tls};
use marquetry_server::{Config, Server, ServerError, sign};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use std::future::poll_fn;
use std::io::{Read, Write};
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

fn served() -> (tempfile::TempDir, Config) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.marq"), marq(0)).unwrap();
    std::fs::write(folder.path().join("b.marq"), marq(1)).unwrap();
    let config = Config::new("127.0.0.1:0", vec![folder.path().to_owned()]);
    (folder, config)
}

fn content_id(server: &Running, name: &str, headers: &[(&str, &str)]) -> String {
    let answer = server.send("GET", &format!("/files/{name}.marq"), headers);
    answer.header("etag").unwrap().trim_matches('"').to_owned()
}

#[test]
fn with_a_token_one_reads_and_without_one_does_not() {
    let (_folder, mut config) = served();
    config.auth.tokens = vec!["correct horse".into()];
    let server = Running::start(config);
    let right = ("Authorization", "Bearer correct horse");
    let id = content_id(&server, "a", &[right]);
    let page = format!("/pages/a/{id}/0");
    let thumbnail = format!("/thumbnails/a/{id}");
    for path in [
        "/files/a.marq",
        "/files/nothing",
        page.as_str(),
        thumbnail.as_str(),
        "/api/catalogue",
        "/api/files/a",
        "/catalogue",
        "/metrics",
    ] {
        let without = server.get(path);
        assert_eq!(without.status, 401, "{path}");
        assert!(
            without
                .header("www-authenticate")
                .unwrap()
                .starts_with("Bearer")
        );
        let wrong = server.send("GET", path, &[("Authorization", "Bearer wrong horse")]);
        assert_eq!(wrong.status, 403, "{path}");
        let with = server.send("GET", path, &[right]);
        let expected = if path.contains("nothing") || path.contains("thumb") {
            404
        } else {
            200
        };
        assert_eq!(with.status, expected, "{path}");
        if let Some(cache) = with.header("cache-control") {
            assert!(!cache.contains("public"), "{path}: {cache}");
        }
    }
    // The viewer and health hold nothing of anybody's.
    assert_eq!(server.get("/health").status, 200);
    assert_eq!(server.get("/").status, 200);
}

#[test]
fn a_signed_url_opens_its_file_and_the_viewer_on_it() {
    let (_folder, mut config) = served();
    config.auth.signing_key = Some("battery staple battery".into());
    let auth: Auth = config.auth.clone();
    let server = Running::start(config);
    let hour = Duration::from_hours(1);
    let query = sign(&auth, "a.marq", hour).unwrap().unwrap();
    assert_eq!(server.get(&format!("/files/a.marq?{query}")).status, 200);
    assert_eq!(server.get(&format!("/api/files/a?{query}")).status, 200);
    assert_eq!(server.get(&format!("/files/b.marq?{query}")).status, 403);
    assert_eq!(server.get(&format!("/api/catalogue?{query}")).status, 401);
    let page = server.get(&format!("/?file=a&{query}"));
    assert_eq!(page.status, 200);
    let cookie = page
        .header("set-cookie")
        .unwrap()
        .split(';')
        .next()
        .unwrap()
        .to_owned();
    let with = |path: &str| server.send("GET", path, &[("Cookie", &cookie)]).status;
    assert_eq!(with("/files/a.marq"), 200);
    assert_eq!(with("/files/b.marq"), 403);
    let everything = sign(&auth, "*", hour).unwrap().unwrap();
    assert_eq!(
        server.get(&format!("/api/catalogue?{everything}")).status,
        200
    );
    let expired = sign(&auth, "a", Duration::ZERO).unwrap().unwrap();
    assert_eq!(server.get(&format!("/files/a.marq?{expired}")).status, 403);
}

#[test]
fn too_many_requests_are_told_when_to_come_again() {
    let (_folder, mut config) = served();
    config.requests.per_second = 1;
    config.requests.burst = 3;
    config.requests.trusted_proxies = vec!["127.0.0.0/8".into()];
    let server = Running::start(config);
    let ask = |from: &str| server.send("GET", "/health", &[("X-Forwarded-For", from)]);
    for _ in 0..3 {
        assert_eq!(ask("192.0.2.1").status, 200);
    }
    let refused = ask("192.0.2.1");
    assert_eq!(refused.status, 429);
    assert_eq!(refused.header("retry-after"), Some("1"));
    // What a client claims to the left of the proxy's own word counts nothing.
    assert_eq!(ask("198.51.100.7, 192.0.2.1").status, 429);
    assert_eq!(ask("192.0.2.2").status, 200);
}

#[test]
fn every_request_has_an_id() {
    let (_folder, config) = served();
    let server = Running::start(config);
    let (first, second) = (server.get("/health"), server.get("/files/nothing"));
    let id = |answer: &Answer| answer.header("x-request-id").unwrap().to_owned();
    assert_ne!(id(&first), id(&second));
    let given = |value| id(&server.send("GET", "/health", &[("X-Request-Id", value)]));
    assert_eq!(given("abc-123.x_y"), "abc-123.x_y");
    let long = "x".repeat(65);
    for bad in ["", "a b", "a\"b", "<x>", long.as_str()] {
        assert_ne!(given(bad), bad);
    }
}

#[test]
fn metrics_count_and_move_to_the_admin_address() {
    let (_folder, config) = served();
    let server = Running::start(config.clone());
    for _ in 0..3 {
        server.get("/files/a.marq");
    }
    server.get("/files/nothing");
    let text = server.get("/metrics").text().to_owned();
    for line in [
        "marquetry_requests_total{route=\"files\",status=\"2xx\"} 3",
        "marquetry_requests_total{route=\"files\",status=\"4xx\"} 1",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let mut config = config;
    config.admin_listen = Some("127.0.0.1:0".into());
    let server = Running::start(config);
    assert_eq!(server.get("/metrics").status, 404);
    let admin = server.admin.unwrap();
    let ask = |path: &str| {
        let request = format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
        exchange(admin, request.as_bytes()).status
    };
    assert_eq!(ask("/metrics"), 200);
    assert_eq!(ask("/health/ready"), 200);
    assert_eq!(ask("/files/a.marq"), 404);
}

#[test]
fn a_server_about_to_stop_says_so_and_finishes_what_it_began() {
    let (_folder, mut config) = served();
    config.connections.drain_delay = Duration::from_millis(600);
    let mut server = Running::start(config);
    assert_eq!(server.get("/health/ready").status, 200);
    let mut slow = server.connect();
    slow.write_all(b"GET /files/a.marq HTTP/1.1\r\nHost: x\r\n")
        .unwrap();
    let address = server.address;
    let asking = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(200));
        let request = b"GET /health/ready HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
        let ready = exchange(address, request);
        let live = b"GET /health/live HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
        let live = exchange(address, live);
        slow.write_all(b"Connection: close\r\n\r\n").unwrap();
        let mut all = Vec::new();
        slow.read_to_end(&mut all).unwrap();
        (ready.status, live.status, all)
    });
    server.stop();
    let (ready, live, all) = asking.join().unwrap();
    assert_eq!((ready, live), (503, 200));
    assert!(all.ends_with(&marq(0)));
}

#[test]
fn a_busy_connection_is_cut_when_the_drain_is_over() {
    let (_folder, mut config) = served();
    config.connections.drain = Duration::from_millis(300);
    let mut server = Running::start(config);
    let mut stream = server.connect();
    // Much more than the socket takes, and nobody reads.
    let request = "GET /files/a.marq HTTP/1.1\r\nHost: x\r\n\r\n".repeat(3000);
    let writer = std::thread::spawn(move || {
        let _ = stream.write_all(request.as_bytes());
        stream
    });
    std::thread::sleep(Duration::from_millis(500));
    let start = Instant::now();
    server.stop();
    assert!(
        start.elapsed() < Duration::from_secs(3),
        "{:?}",
        start.elapsed()
    );
    drop(writer.join());
}

fn certificate(folder: &Path, name: &str) -> Tls {
    let made = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let (certificate, key) = (
        folder.join(format!("{name}.crt")),
        folder.join(format!("{name}.key")),
    );
    std::fs::write(&certificate, made.cert.pem()).unwrap();
    std::fs::write(&key, made.signing_key.serialize_pem()).unwrap();
    Tls { certificate, key }
}

async fn greet(
    server: &Running,
    tls: &Tls,
    protocol: &[u8],
) -> tokio_rustls::client::TlsStream<TcpStream> {
    let mut roots = rustls::RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(&tls.certificate).unwrap() {
        roots.add(certificate.unwrap()).unwrap();
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut client = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    client.alpn_protocols = vec![protocol.to_vec()];
    let socket = TcpStream::connect(server.address).await.unwrap();
    tokio_rustls::TlsConnector::from(Arc::new(client))
        .connect(ServerName::try_from("localhost").unwrap(), socket)
        .await
        .unwrap()
}

/// Status and body of `count` requests at once on one HTTP/2 connection.
async fn http2(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    path: &str,
    count: usize,
) -> Vec<(u16, Vec<u8>)> {
    let (mut sender, connection) =
        hyper::client::conn::http2::handshake(TokioExecutor::new(), TokioIo::new(stream))
            .await
            .unwrap();
    let driver = tokio::spawn(connection);
    let mut answers = Vec::new();
    for _ in 0..count {
        let request = hyper::Request::get(format!("http://localhost{path}"))
            .body(NoBody)
            .unwrap();
        answers.push(sender.send_request(request));
    }
    let mut results = Vec::new();
    for answer in answers {
        let mut response = answer.await.unwrap();
        let mut bytes = Vec::new();
        while let Some(frame) =
            poll_fn(|context| Pin::new(response.body_mut()).poll_frame(context)).await
        {
            bytes.extend_from_slice(&frame.unwrap().into_data().unwrap_or_default());
        }
        results.push((response.status().as_u16(), bytes));
    }
    driver.abort();
    results
}

/// A body of nothing.
struct NoBody;

impl Body for NoBody {
    type Data = Bytes;
    type Error = std::convert::Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        _: &mut std::task::Context<'_>,
    ) -> std::task::Poll<Option<Result<hyper::body::Frame<Bytes>, Self::Error>>> {
        std::task::Poll::Ready(None)
    }

    fn is_end_stream(&self) -> bool {
        true
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn http2_is_spoken_with_tls_and_without() {
    let (folder, mut config) = served();
    let tls = certificate(folder.path(), "one");
    let plain = Running::start(config.clone());
    let stream = TcpStream::connect(plain.address).await.unwrap();
    let all = http2(stream, "/files/a.marq", 50).await;
    assert_eq!(all.len(), 50);
    assert!(
        all.iter()
            .all(|(status, body)| *status == 200 && *body == marq(0))
    );

    config.tls = Some(tls.clone());
    let secure = Running::start(config);
    let stream = greet(&secure, &tls, b"h2").await;
    let all = http2(stream, "/files/a.marq", 50).await;
    assert!(
        all.iter()
            .all(|(status, body)| *status == 200 && *body == marq(0))
    );
    let mut stream = greet(&secure, &tls, b"http/1.1").await;
    let request = b"GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    tokio::io::AsyncWriteExt::write_all(&mut stream, request)
        .await
        .unwrap();
    let mut answer = Vec::new();
    let _ = tokio::io::AsyncReadExt::read_to_end(&mut stream, &mut answer).await;
    assert!(answer.starts_with(b"HTTP/1.1 200"));
}

#[test]
fn a_client_that_never_finishes_its_greeting_is_cut() {
    let (folder, mut config) = served();
    config.tls = Some(certificate(folder.path(), "one"));
    config.connections.header = Duration::from_millis(300);
    let server = Running::start(config);
    for start in [&b""[..], b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\n\r\n"] {
        let mut stream = server.connect();
        stream.write_all(start).unwrap();
        let begin = Instant::now();
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        assert!(begin.elapsed() < Duration::from_secs(5));
        assert!(!rest.starts_with(b"HTTP/1.1 200"));
    }
    // An HTTP/2 client that says hello and nothing more.
    let (_folder, mut config) = served();
    config.connections.idle = Duration::from_millis(300);
    let server = Running::start(config);
    let mut stream = server.connect();
    stream
        .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0")
        .unwrap();
    let begin = Instant::now();
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(begin.elapsed() < Duration::from_secs(5));
}

#[tokio::test]
async fn a_certificate_that_is_none_is_refused_at_start() {
    let (folder, mut config) = served();
    let wrong = folder.path().join("wrong.pem");
    std::fs::write(&wrong, "no certificate").unwrap();
    config.tls = Some(Tls {
        certificate: wrong.clone(),
        key: wrong,
    });
    let error = Server::bind(config).await.unwrap_err();
    assert!(matches!(error, ServerError::Tls { .. }), "{error}");
}

#[test]
fn descriptions_say_what_a_client_needs() {
    let (folder, config) = served();
    std::fs::write(
        folder.path().join("a.json"),
        r#"{"title":"A <b>","licence":"CC-BY-4.0","attribution":"Somebody"}"#,
    )
    .unwrap();
    let server = Running::start(config);
    let answer = server.get("/api/files/a");
    assert_eq!(answer.status, 200);
    let json: serde_json::Value = serde_json::from_slice(&answer.body).unwrap();
    assert_eq!(json["licence"], "CC-BY-4.0");
    assert_eq!(json["page_count"], 5);
    let page = json["pages"][0].as_str().unwrap().replace("{first}", "0");
    assert_eq!(server.get(&page).status, 200);
    let pages = json["pages"][1]
        .as_str()
        .unwrap()
        .replace("{first}", "1")
        .replace("{last}", "4");
    assert_eq!(server.get(&pages).status, 200);
    let etag = answer.header("etag").unwrap().to_owned();
    let again = server.send("GET", "/api/files/a", &[("If-None-Match", &etag)]);
    assert_eq!(again.status, 304);
    assert_eq!(server.get("/api/files/nothing").status, 404);
    let page = server.get("/catalogue");
    assert_eq!(
        page.header("content-type"),
        Some("text/html; charset=utf-8")
    );
    assert!(page.header("content-security-policy").is_some());
    let html = page.text();
    assert!(html.contains("A &lt;b&gt;") && html.contains("CC-BY-4.0") && !html.contains("<b>"));
}
