//! `marquetry serve`: files and folders over HTTP.

use super::output::Output;
use super::{Common, Verdict};
use anyhow::bail;
use marquetry_server::{Config, Server};
use std::path::PathBuf;

/// Serve .marq files and folders of them over HTTP, with the viewer
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Files and folders
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Address and port to listen on; port 0 picks a free one
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: String,
}

pub(super) fn run(
    arguments: Arguments,
    common: &Common,
    output: &Output,
) -> anyhow::Result<Verdict> {
    if let Some(url) = arguments.paths.iter().find(|path| path.starts_with("s3:")) {
        bail!(
            "{}: this version serves files and folders only",
            url.display()
        );
    }
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    if let Some(threads) = common.threads {
        runtime.worker_threads(threads.get());
    }
    runtime.enable_all().build()?.block_on(async {
        // Before it says that it listens, so that whoever reads that may stop it.
        let stop = stop_signal()?;
        let server = Server::bind(Config::new(arguments.listen, arguments.paths)).await?;
        let url = format!("http://{}", server.local_addr());
        output.say(&format!("listening on {url}"));
        output.report(&serde_json::json!({ "url": url }))?;
        server.run(stop).await;
        Ok(Verdict::Good)
    })
}

/// Resolves when the user or the system asks the process to end.
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
