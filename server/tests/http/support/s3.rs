//! A real S3 server for tests: `moto_server` of the Python package `moto`, installed by `cargo xtask setup-tests`.

use super::exchange;
use marquetry_server::Config;
use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// A test cannot run here.
#[derive(Debug)]
pub(crate) struct Ignored(String);

impl Ignored {
    /// Says so on standard error, past the capture of output.
    pub(crate) fn report(&self) {
        use std::io::Write;
        let name = std::thread::current().name().unwrap_or_default().to_owned();
        let _ = writeln!(std::io::stderr(), "test {name} ... ignored: {}", self.0);
    }
}

/// A running server, ended when dropped.
#[derive(Debug)]
pub(crate) struct S3 {
    address: SocketAddr,
    child: Child,
}

/// Where the tools for tests are installed: `target/tools`.
fn tools() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(3).unwrap().join("tools")
}

impl S3 {
    /// Starts a server on a free port, with the bucket `scans`.
    pub(crate) fn start() -> Result<Self, Ignored> {
        let program = tools().join("python/bin/moto_server");
        if !program.is_file() {
            return Err(Ignored(format!(
                "{} is not there; cargo xtask setup-tests installs it",
                program.display()
            )));
        }
        // It says which port it was given; one that is free now may be another test's by then.
        let mut child = Command::new(program)
            .args(["-H", "127.0.0.1", "-p", "0"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let log = child.stderr.take().unwrap();
        let (found, address) = channel();
        std::thread::spawn(move || {
            // Whoever does not read lets the server hang once the pipe is full.
            let mut lines = BufReader::new(log);
            let mut line = String::new();
            while lines.read_line(&mut line).is_ok_and(|read| read > 0) {
                let said = line.split_once("Running on http://");
                if let Some(address) = said.and_then(|(_, address)| address.trim().parse().ok()) {
                    let _ = found.send(address);
                }
                line.clear();
            }
            let _ = lines.read(&mut []);
        });
        let Ok(address) = address.recv_timeout(Duration::from_mins(1)) else {
            let _ = child.kill();
            panic!("moto_server does not say where it listens");
        };
        let s3 = Self { address, child };
        s3.send("PUT", "scans", &[]);
        Ok(s3)
    }

    /// Puts an object at `BUCKET/KEY`.
    pub(crate) fn put(&self, path: &str, bytes: &[u8]) {
        self.send("PUT", path, bytes);
    }

    /// Removes an object.
    pub(crate) fn delete(&self, path: &str) {
        self.send("DELETE", path, &[]);
    }

    fn send(&self, method: &str, path: &str, body: &[u8]) {
        let mut request = format!(
            "{method} /{path} HTTP/1.1\r\nHost: s3.amazonaws.com\r\nConnection: close\r\n\
             Authorization: AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4_request\r\n\
             Content-Length: {}\r\n\r\n",
            body.len()
        )
        .into_bytes();
        request.extend_from_slice(body);
        let answer = exchange(self.address, &request);
        assert!(
            (200..300).contains(&answer.status),
            "{method} {path}: {answer:?}"
        );
    }

    /// Settings to serve `url` from it.
    pub(crate) fn config(&self, url: &str) -> Config {
        let mut config = Config::new("127.0.0.1:0", vec![url.into()]);
        let options = [
            ("aws_endpoint", format!("http://{}", self.address)),
            ("aws_region", "us-east-1".to_owned()),
            ("aws_access_key_id", "test".to_owned()),
            ("aws_secret_access_key", "test".to_owned()),
            ("allow_http", "true".to_owned()),
        ];
        config.upstream.options = options
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        config.upstream.refresh = Duration::from_millis(200);
        config
    }
}

impl Drop for S3 {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
