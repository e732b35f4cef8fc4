//! The server: `.marq` files, their pages, a catalogue and the viewer over HTTP/1.1 and HTTP/2.
//!
//! Three ways to the same bytes. *Pages* (`/pages/NAME/CONTENT-ID/FIRST-LAST`) have the content id in
//! their path, so they never change and any cache may keep them for ever; this is what the viewer uses,
//! since browsers serialise, or cache wrongly, several ranges of one URL. *Files* (`/files/NAME.marq`)
//! answer byte ranges as RFC 9110 has it, for every other client. The *catalogue* names what there is.
//!
//! Files lie on disk, in an object store or on another HTTP server; see `source`. A response is made from one
//! version of a file, checked at each read, so it never mixes two; when the file is rewritten in place during a
//! response, the connection is cut instead. Pages are compared with their checksums before they are sent.
//!
//! Connections are driven by an accept loop of our own with deadlines for everything that a client can delay; see
//! `accept`. Settings are in [`config`].

pub mod config;
pub mod error;

mod accept;
mod app;
mod auth;
mod body;
mod conditional;
mod limits;
mod metrics;
mod range;
mod routes;
mod service;
mod source;
mod target;

pub use app::Server;
pub use auth::sign;
pub use config::{Config, ConnectionLimits};
pub use error::ServerError;
