//! Opening a file and decoding its pages.
//!
//! [`Opening`] is a state machine without I/O, for async callers; [`Document::open`] drives it over a
//! blocking [`ByteSource`](crate::ByteSource).

mod decoding;
mod document;
mod opening;

pub use document::Document;
pub use opening::{FIRST_IMAGE_BYTES, FIRST_READ_BYTES, Opening, Step};
