//! nginx, as Debian packages it, to compare with.

use super::process_of::Process;
use anyhow::{Context, Result};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::Path;
use std::process::{Command, Stdio};

/// Serves `folder` with as many workers as there are cores, `sendfile`, and no access log. Without `tcp_nopush`, which
/// Debian sets: on the loopback interface it makes answers of 64 KiB wait 40 ms for an acknowledgement.
///
/// `cached` keeps files open between requests (`open_file_cache`), which Debian's settings do not.
pub(crate) fn start(folder: &Path, scratch: &Path, cached: bool) -> Result<Process> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no free port")?;
    let address: SocketAddr = listener.local_addr().context("no free port")?;
    drop(listener);
    let cache = if cached {
        "open_file_cache max=1000 inactive=60s;"
    } else {
        ""
    };
    let (folder, scratch_text) = (folder.display(), scratch.display());
    let settings = format!(
        "daemon off;\nuser root;\nworker_processes auto;\npid {scratch_text}/nginx.pid;\nerror_log {scratch_text}/error.log;\n\
         events {{ worker_connections 4096; }}\n\
         http {{\n  access_log off;\n  sendfile on;\n  tcp_nopush off;\n  tcp_nodelay on;\n  keepalive_requests 1000000000;\n  {cache}\n\
         \x20 client_body_temp_path {scratch_text}/body;\n  proxy_temp_path {scratch_text}/proxy;\n\
         \x20 fastcgi_temp_path {scratch_text}/fastcgi;\n  uwsgi_temp_path {scratch_text}/uwsgi;\n  scgi_temp_path {scratch_text}/scgi;\n\
         \x20 server {{ listen {address}; root {folder}; }}\n}}\n"
    );
    let file = scratch.join("nginx.conf");
    std::fs::write(&file, settings).context("cannot write nginx.conf")?;
    let child = Command::new(program())
        .arg("-c")
        .arg(&file)
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .spawn()
        .context("cannot start nginx")?;
    Process::at(child, address)
}

/// Where Debian puts it, which is not on everybody's search path.
fn program() -> &'static str {
    let there = "/usr/sbin/nginx";
    if Path::new(there).is_file() {
        there
    } else {
        "nginx"
    }
}
