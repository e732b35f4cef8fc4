//! `marquetry serve`: files, folders and buckets over HTTP.

use super::output::Output;
use super::{Common, Verdict};
use anyhow::{Context, bail};
use marquetry_server::config::{self, Config, Log, LogFormat, Tls};
use marquetry_server::{Server, sign};
use std::path::PathBuf;
use std::time::Duration;

/// Serve .marq files over HTTP, with the viewer
///
/// Every setting may also stand in a TOML file (--config) or in the environment, where it is called
/// `MARQUETRY_SERVE_` and its path in capitals with two underscores between the parts
/// (`MARQUETRY_SERVE_CONNECTIONS__IDLE=30s`). Flags win over the environment, that over the file.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Files, folders, and URLs: `s3://BUCKET/PREFIX`, `gs://…`, `az://…`, `https://HOST/PATH`
    #[arg(required_unless_present_any = ["config", "sign"], value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Address and port to listen on; port 0 picks a free one [default: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDR")]
    listen: Option<String>,
    /// Settings, as TOML
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Check settings, certificates and files, print the settings in force, and end
    #[arg(long)]
    check_config: bool,
    /// Address for /metrics and /health alone
    #[arg(long, value_name = "ADDR")]
    admin_listen: Option<String>,
    /// Certificate chain (PEM); the server then speaks TLS
    #[arg(long, value_name = "FILE.pem", requires = "tls_key")]
    tls_certificate: Option<PathBuf>,
    /// Its private key (PEM)
    #[arg(long, value_name = "FILE.pem", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Form of the log
    #[arg(long, value_enum)]
    log_format: Option<Format>,
    /// Log every request, not only those that failed
    #[arg(long)]
    log_requests: bool,
    /// Print the query that opens the file NAME (`*`: all of them) for the time --valid, and end
    #[arg(long, value_name = "NAME")]
    sign: Option<String>,
    /// How long what --sign prints is valid
    #[arg(long, value_name = "TIME", default_value = "24h", value_parser = duration)]
    valid: Duration,
}

/// Forms of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Text,
    Json,
}

fn duration(text: &str) -> Result<Duration, String> {
    config::duration_of(text).ok_or_else(|| "a time such as 30s, 5m or 24h".to_owned())
}

impl Arguments {
    /// The settings in force.
    fn settings(&self) -> Result<Config, config::ConfigError> {
        // What is no UTF-8 is no setting of ours.
        let environment = std::env::vars_os().filter_map(|(name, value)| {
            Some((name.into_string().ok()?, value.into_string().ok()?))
        });
        let mut settings = config::load(self.config.as_deref(), environment)?;
        if !self.paths.is_empty() {
            settings.paths.clone_from(&self.paths);
        }
        if let Some(listen) = &self.listen {
            settings.listen.clone_from(listen);
        }
        if self.admin_listen.is_some() {
            settings.admin_listen.clone_from(&self.admin_listen);
        }
        if let (Some(certificate), Some(key)) = (&self.tls_certificate, &self.tls_key) {
            settings.tls = Some(Tls {
                certificate: certificate.clone(),
                key: key.clone(),
            });
        }
        match self.log_format {
            Some(Format::Text) => settings.log.format = LogFormat::Text,
            Some(Format::Json) => settings.log.format = LogFormat::Json,
            None => {}
        }
        settings.log.requests |= self.log_requests;
        Ok(settings)
    }

    /// How to log. Settings that are wrong are complained about later.
    pub(super) fn log(&self) -> Log {
        self.settings()
            .map(|settings| settings.log)
            .unwrap_or_default()
    }
}

pub(super) fn run(
    arguments: &Arguments,
    common: &Common,
    output: &Output,
) -> anyhow::Result<Verdict> {
    let settings = arguments.settings()?;
    if let Some(name) = &arguments.sign {
        let query = sign(&settings.auth, name, arguments.valid)?
            .context("no auth.signing_key in the settings to sign with")?;
        output.say(&query);
        return Ok(Verdict::Good);
    }
    if settings.paths.is_empty() {
        bail!("nothing to serve: name paths on the command line or in the settings");
    }
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    if let Some(threads) = common.threads {
        runtime.worker_threads(threads.get());
    }
    runtime
        .enable_all()
        .build()?
        .block_on(serve(settings, arguments.check_config, output))
}

async fn serve(settings: Config, check_only: bool, output: &Output) -> anyhow::Result<Verdict> {
    // Before it says that it listens, so that whoever reads that may stop it.
    let stop = stop_signal()?;
    if check_only {
        let shown = toml::to_string(&settings.redacted())?;
        let anywhere = |()| "127.0.0.1:0".to_owned();
        // A server that runs already has the addresses.
        Server::bind(Config {
            listen: anywhere(()),
            admin_listen: settings.admin_listen.as_ref().map(|_| anywhere(())),
            ..settings
        })
        .await?;
        output.say(&shown);
        return Ok(Verdict::Good);
    }
    let server = Server::bind(settings).await?;
    let scheme = if server.is_secure() { "https" } else { "http" };
    let url = format!("{scheme}://{}", server.local_addr());
    output.say(&format!("listening on {url}"));
    let admin = server
        .admin_addr()
        .map(|address| format!("http://{address}"));
    if let Some(admin) = &admin {
        output.say(&format!("metrics at {admin}/metrics"));
    }
    output.report(&serde_json::json!({ "url": url, "admin_url": admin }))?;
    server.run(stop).await;
    Ok(Verdict::Good)
}

/// Resolves when the user or the system asks the process to end; asked a second time, the process ends at once.
#[cfg(unix)]
fn stop_signal() -> std::io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        tokio::spawn(async move {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            std::process::exit(1);
        });
    })
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "as on unix")]
fn stop_signal() -> std::io::Result<impl Future<Output = ()>> {
    Ok(async {
        // Without a handler the process is simply killed, as it would be anyway.
        let _ = tokio::signal::ctrl_c().await;
    })
}
