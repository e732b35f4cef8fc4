//! The server as its clients see it, over HTTP. One program: what all of these need takes long to compile.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod hostile;
mod operation;
mod ranges;
mod routes;
mod sources;
mod support;
