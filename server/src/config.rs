//! What a server is started with.

use std::path::PathBuf;
use std::time::Duration;

/// Where to listen, what to serve, and how patient to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Config {
    /// Address and port to listen on, as `HOST:PORT`; port 0 lets the system pick one.
    pub listen: String,
    /// Files and folders to serve. A folder is searched for `*.marq`, its sub-folders included, each time
    /// the catalogue is asked for. Where two paths give the same name, the first one counts.
    pub paths: Vec<PathBuf>,
    /// Limits on connections.
    pub connections: ConnectionLimits,
}

impl Config {
    /// Serves `paths` on `listen` with the default limits.
    pub fn new(listen: impl Into<String>, paths: Vec<PathBuf>) -> Self {
        Self {
            listen: listen.into(),
            paths,
            connections: ConnectionLimits::default(),
        }
    }
}

/// How many connections, and for how long each may keep the server waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionLimits {
    /// Connections open at once; more wait in the listen queue.
    pub open: usize,
    /// From the end of one request (or from connecting) to the last byte of the next one's header.
    pub header: Duration,
    /// Without the client taking a single byte of a response.
    pub write_stall: Duration,
    /// From the wish to stop until connections still busy are cut.
    pub drain: Duration,
}

impl Default for ConnectionLimits {
    fn default() -> Self {
        Self {
            open: 1024,
            header: Duration::from_secs(30),
            write_stall: Duration::from_secs(30),
            drain: Duration::from_secs(10),
        }
    }
}
