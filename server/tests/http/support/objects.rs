//! Real object stores for tests, installed by `cargo xtask setup-tests`: `moto_server` of the Python package `moto` for
//! S3, and for Google's, whose XML interface takes the same requests; `azurite` of npm for Azure's.
//!
//! Limit: moto has no `x-goog-…` headers, so neither generations nor tokens of Google's are tested; objects there are public.

use super::exchange;
use marquetry_server::Config;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// Azurite's account and key, which its documentation gives.
const ACCOUNT: &str = "devstoreaccount1";
const KEY: &str =
    "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw==";
/// An account's signature of that key for all that tests do, good until 2099.
const SIGNATURE: &str = "sv=2019-12-12&ss=b&srt=sco&sp=rwdlac&se=2099-01-01T00%3A00%3A00Z&\
                         sig=YKAtmJudHaH98kax9IHOYkiCF9veHhGg4TBHNwluLXo%3D";

/// Calls `test` with a store. Where none is installed, says so on standard error, past the capture of output.
pub(crate) fn on(kind: Kind, test: impl FnOnce(Objects)) {
    let program = kind.program();
    if program.is_file() {
        return test(Objects::start(kind, &program));
    }
    let name = std::thread::current().name().unwrap_or_default().to_owned();
    let _ = writeln!(
        std::io::stderr(),
        "test {name} ... ignored: {} is not there; cargo xtask setup-tests installs it",
        program.display()
    );
}

/// Whose protocol a store speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Amazon,
    Google,
    Azure,
}

/// A running store, ended when dropped.
#[derive(Debug)]
pub(crate) struct Objects {
    kind: Kind,
    address: SocketAddr,
    child: Child,
}

/// Where the tools for tests are installed: `target/tools`.
fn tools() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(3).unwrap().join("tools")
}

impl Kind {
    fn program(self) -> PathBuf {
        tools().join(match self {
            Self::Amazon | Self::Google => "python/bin/moto_server",
            Self::Azure => "node/node_modules/.bin/azurite-blob",
        })
    }

    /// It is to take a port that is free, and says which; one that is free now may be another test's by then.
    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Amazon | Self::Google => &["-H", "127.0.0.1", "-p", "0"],
            Self::Azure => &[
                "--blobHost",
                "127.0.0.1",
                "--blobPort",
                "0",
                "--inMemoryPersistence",
                "--skipApiVersionCheck",
                "--disableTelemetry",
            ],
        }
    }

    /// What a store of it says before its address.
    fn greeting(self) -> &'static str {
        match self {
            Self::Amazon | Self::Google => "Running on http://",
            Self::Azure => "successfully listens on http://",
        }
    }
}

impl Objects {
    /// Starts a store with the bucket `scans`.
    fn start(kind: Kind, program: &Path) -> Self {
        let mut command = Command::new(program);
        command.args(kind.arguments()).stdin(Stdio::null());
        let (mut reader, writer) = std::io::pipe().unwrap();
        command.stdout(writer.try_clone().unwrap()).stderr(writer);
        let mut child = command.spawn().unwrap();
        // The last writer is the store then, and the pipe ends with it.
        drop(command);
        let (found, address) = channel();
        std::thread::spawn(move || {
            // Whoever does not read lets the server hang once the pipe is full.
            let mut line = String::new();
            let mut lines = BufReader::new(&mut reader);
            while lines.read_line(&mut line).is_ok_and(|read| read > 0) {
                let said = line.split_once(kind.greeting());
                if let Some(address) = said.and_then(|(_, address)| address.trim().parse().ok()) {
                    let _ = found.send(address);
                }
                line.clear();
            }
            let _ = lines.read(&mut []);
        });
        let Ok(address) = address.recv_timeout(Duration::from_mins(1)) else {
            let _ = child.kill();
            panic!("{kind:?}'s store does not say where it listens");
        };
        let objects = Self {
            kind,
            address,
            child,
        };
        match kind {
            Kind::Amazon | Kind::Google => objects.send("PUT", "scans", "", &[]),
            Kind::Azure => objects.send("PUT", "scans", "restype=container&", &[]),
        }
        objects
    }

    /// Puts an object at `PATH` of the bucket.
    pub(crate) fn put(&self, path: &str, bytes: &[u8]) {
        self.send("PUT", &format!("scans/{path}"), "", bytes);
    }

    /// Removes an object.
    pub(crate) fn delete(&self, path: &str) {
        self.send("DELETE", &format!("scans/{path}"), "", &[]);
    }

    fn send(&self, method: &str, path: &str, query: &str, body: &[u8]) {
        let head = match self.kind {
            Kind::Amazon | Kind::Google => format!(
                "{method} /{path}?{query} HTTP/1.1\r\nHost: s3.amazonaws.com\r\n\
                 Authorization: AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4_request\r\n\
                 x-amz-acl: public-read\r\n"
            ),
            Kind::Azure => format!(
                "{method} /{ACCOUNT}/{path}?{query}{SIGNATURE} HTTP/1.1\r\nHost: {}\r\nx-ms-version: 2019-12-12\r\n\
                 x-ms-blob-type: BlockBlob\r\n",
                self.address
            ),
        };
        let length = body.len();
        let mut request =
            format!("{head}Connection: close\r\nContent-Length: {length}\r\n\r\n").into_bytes();
        request.extend_from_slice(body);
        let answer = exchange(self.address, &request);
        assert!(
            (200..300).contains(&answer.status),
            "{method} {path}: {answer:?}"
        );
    }

    /// Settings to serve what is below `path` of the bucket.
    pub(crate) fn config(&self, path: &str) -> Config {
        let store = format!("http://{}", self.address);
        let (scheme, options) = match self.kind {
            Kind::Amazon => (
                "s3",
                vec![
                    ("aws_endpoint", store),
                    ("aws_region", "us-east-1".to_owned()),
                    ("aws_access_key_id", "test".to_owned()),
                    ("aws_secret_access_key", "test".to_owned()),
                ],
            ),
            Kind::Google => (
                "gs",
                vec![
                    ("google_base_url", store),
                    ("google_skip_signature", "true".to_owned()),
                ],
            ),
            Kind::Azure => (
                "az",
                vec![
                    ("azure_storage_endpoint", format!("{store}/{ACCOUNT}")),
                    ("azure_storage_account_name", ACCOUNT.to_owned()),
                    ("azure_storage_account_key", KEY.to_owned()),
                ],
            ),
        };
        let url = format!("{scheme}://scans/{path}");
        let mut config = Config::new("127.0.0.1:0", vec![url.into()]);
        config.upstream.options = options
            .into_iter()
            .chain([("allow_http", "true".to_owned())])
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        config.upstream.refresh = Duration::from_millis(200);
        config
    }
}

impl Drop for Objects {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
