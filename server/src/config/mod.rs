//! What a server is started with.
//!
//! Every setting has a default, and may come from a TOML file, from the environment or from flags; see
//! [`load`]. `deploy/marquetry.schema.json` describes the file for editors, and a test keeps it true.

mod load;
mod units;

pub use load::{ConfigError, ENVIRONMENT_PREFIX, load, parse};
pub use units::{bytes_of, duration_of};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

/// Where to listen, what to serve, and how patient to be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Address and port to listen on, as `HOST:PORT`; port 0 lets the system pick one.
    pub listen: String,
    /// Address for `/metrics` and `/health` alone; where it is given, the main address has no `/metrics`.
    pub admin_listen: Option<String>,
    /// Files, folders and URLs (`s3://`, `gs://`, `az://`, `http://`, `https://`) to serve. Where two give
    /// the same name, the first one counts.
    pub paths: Vec<PathBuf>,
    /// Limits on connections.
    pub connections: ConnectionLimits,
    /// Limits on requests.
    pub requests: RequestLimits,
    /// Certificate and key; without them the server speaks plain HTTP.
    pub tls: Option<Tls>,
    /// Who may read.
    pub auth: Auth,
    /// What is written to standard error.
    pub log: Log,
    /// How object stores and HTTP origins are read.
    pub upstream: Upstream,
}

impl Config {
    /// Serves `paths` on `listen` with the default limits.
    pub fn new(listen: impl Into<String>, paths: Vec<PathBuf>) -> Self {
        Self {
            listen: listen.into(),
            paths,
            ..Self::default()
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: "127.0.0.1:8080".to_owned(),
            admin_listen: None,
            paths: Vec::new(),
            connections: ConnectionLimits::default(),
            requests: RequestLimits::default(),
            tls: None,
            auth: Auth::default(),
            log: Log::default(),
            upstream: Upstream::default(),
        }
    }
}

/// How many connections, and for how long each may keep the server waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionLimits {
    /// Connections open at once; more wait in the listen queue.
    pub open: usize,
    /// Connections of one address (of one /64 network, for IPv6); 0 is no limit. Trusted proxies have none.
    pub per_address: usize,
    /// From connecting, or from the first byte of a request, to the last byte of its header.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub header: Duration,
    /// Between requests.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub idle: Duration,
    /// Within which a client has to take `min_rate` times this long of a response.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub write_stall: Duration,
    /// Bytes a second below which a reader is too slow, as a mean over `write_stall`.
    pub min_rate: u64,
    /// From a request's header to the last byte of its response.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub response: Duration,
    /// From the wish to stop until the server stops listening; `/health/ready` says 503 meanwhile.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub drain_delay: Duration,
    /// From then until connections still busy are cut.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub drain: Duration,
}

impl Default for ConnectionLimits {
    fn default() -> Self {
        Self {
            open: 4096,
            per_address: 1024,
            header: Duration::from_secs(10),
            idle: Duration::from_secs(75),
            write_stall: Duration::from_secs(30),
            min_rate: 256,
            response: Duration::from_mins(15),
            drain_delay: Duration::ZERO,
            drain: Duration::from_secs(10),
        }
    }
}

/// How many requests.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RequestLimits {
    /// Requests a second of one address (of one /64 network, for IPv6), in the long run; 0 is no limit.
    pub per_second: u32,
    /// Requests that may come at once before `per_second` counts; 0 is ten seconds' worth.
    pub burst: u32,
    /// Addresses of proxies whose `X-Forwarded-For` is believed, each an address or a network `A.B.C.D/N`.
    pub trusted_proxies: Vec<String>,
}

/// A certificate and its key, both PEM. Read anew when the files change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Tls {
    /// Certificate chain, the server's own certificate first.
    pub certificate: PathBuf,
    /// Private key.
    pub key: PathBuf,
}

/// Who may read files, pages and catalogue. Nothing given: everyone. The viewer itself is always public.
#[derive(Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Auth {
    /// Tokens, one of which a request must carry as `Authorization: Bearer TOKEN`.
    pub tokens: Vec<String>,
    /// File with one token a line.
    pub token_file: Option<PathBuf>,
    /// Secret that signs URLs (`?expires=…&signature=…`), at least 16 characters.
    pub signing_key: Option<String>,
    /// File whose first line is that secret.
    pub signing_key_file: Option<PathBuf>,
}

impl std::fmt::Debug for Auth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Auth")
            .field("tokens", &self.tokens.len())
            .field("token_file", &self.token_file)
            .field("signing_key", &self.signing_key.is_some())
            .field("signing_key_file", &self.signing_key_file)
            .finish()
    }
}

/// What is written to standard error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Log {
    /// Lines for people or for machines.
    pub format: LogFormat,
    /// One line for every request, not only for those that failed.
    pub requests: bool,
}

/// Form of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// How object stores and HTTP origins are read.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Upstream {
    /// Bytes of remote files kept in memory.
    #[serde(with = "units::bytes")]
    #[cfg_attr(test, schemars(with = "units::BytesSchema"))]
    pub cache: u64,
    /// How long a remote file is taken to be unchanged, and a listing to be complete.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub refresh: Duration,
    /// For one request to a remote source.
    #[serde(with = "units::duration")]
    #[cfg_attr(test, schemars(with = "units::DurationSchema"))]
    pub timeout: Duration,
    /// Requests to one remote source at once.
    pub concurrency: usize,
    /// Options of the object store, by the names that the crate `object_store` gives them: `aws_region`,
    /// `aws_endpoint`, `google_service_account`, `azure_storage_account_name`, `allow_http`, …
    pub options: BTreeMap<String, String>,
}

impl Default for Upstream {
    fn default() -> Self {
        Self {
            cache: 256 << 20,
            refresh: Duration::from_secs(5),
            timeout: Duration::from_secs(30),
            concurrency: 64,
            options: BTreeMap::new(),
        }
    }
}

impl std::fmt::Debug for Upstream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Upstream")
            .field("cache", &self.cache)
            .field("refresh", &self.refresh)
            .field("timeout", &self.timeout)
            .field("concurrency", &self.concurrency)
            // The values may be secrets.
            .field("options", &self.options.keys().collect::<Vec<_>>())
            .finish()
    }
}

impl Config {
    /// The configuration with every secret replaced, fit to be shown.
    #[must_use]
    pub fn redacted(&self) -> Self {
        let hidden = || "(hidden)".to_owned();
        let mut shown = self.clone();
        shown.auth.tokens.fill(hidden());
        shown.auth.signing_key = self.auth.signing_key.as_ref().map(|_| hidden());
        for (name, value) in &mut shown.upstream.options {
            if ["key", "secret", "token", "password", "account"]
                .iter()
                .any(|word| name.to_ascii_lowercase().contains(word))
            {
                *value = hidden();
            }
        }
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published schema is the one that the types give; `cargo xtask bless` writes it.
    #[test]
    fn the_published_schema_is_true_golden() {
        let schema = schemars::schema_for!(Config);
        let mut text = serde_json::to_string_pretty(&schema).unwrap();
        text.push('\n');
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../deploy/marquetry.schema.json"
        );
        if std::env::var_os("MARQUETRY_BLESS").is_some() {
            std::fs::write(path, &text).unwrap();
        }
        let published = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            published == text,
            "deploy/marquetry.schema.json is out of date: cargo xtask bless"
        );
    }

    #[test]
    fn the_example_file_is_valid_and_says_the_defaults() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/marquetry.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let example = parse(&text).unwrap();
        let expected = Config {
            paths: example.paths.clone(),
            ..Config::default()
        };
        assert_eq!(example, expected);
    }

    #[test]
    fn secrets_are_not_shown() {
        let mut config = Config::default();
        config.auth.tokens.push("hunter2-hunter2".into());
        config.auth.signing_key = Some("hunter2-hunter2-hunter2".into());
        let secret = ("aws_secret_access_key".into(), "hunter2".into());
        config.upstream.options.extend([secret]);
        let shown = format!(
            "{config:?}\n{}",
            toml::to_string(&config.redacted()).unwrap()
        );
        assert!(!shown.contains("hunter2"), "{shown}");
    }
}
