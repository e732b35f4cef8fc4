//! The server: `.marq` files, their pages, a catalogue and the viewer over HTTP/1.1.
//!
//! Three ways to the same bytes. *Pages* (`/pages/NAME/CONTENT-ID/FIRST-LAST`) have the content id in
//! their path, so they never change and any cache may keep them for ever; this is what the viewer uses,
//! since browsers serialise, or cache wrongly, several ranges of one URL. *Files* (`/files/NAME.marq`)
//! answer byte ranges as RFC 9110 has it, for every other client. The *catalogue* names what there is.
//!
//! Files are read by positioned reads on an open handle, never mapped: a mapped file that another
//! process shortens kills the server. A response is made from one handle whose length, time and inode
//! are checked after each read, so it never mixes two versions of a file; when the file is rewritten in
//! place during a response, the connection is cut instead.
//!
//! Limits: no TLS and no HTTP/2 (put a proxy in front), no authentication, no object stores.

pub mod config;
pub mod error;

mod accept;
mod app;
mod body;
mod conditional;
mod range;
mod routes;
mod source;
mod telemetry;

pub use app::Server;
pub use config::{Config, ConnectionLimits};
pub use error::ServerError;
