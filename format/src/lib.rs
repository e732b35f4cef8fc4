//! The `.marq` file format: header, paged index, page codecs, reader, writer, verification.
//!
//! Knows no async runtime, no GPU and no mesh processing, and builds for wasm32.
//! `SPEC.md` beside this crate describes the bytes; the vocabulary is in the project's `ARCHITECTURE.md`.

pub mod chart;
pub mod codec;
pub mod error;
pub mod index;
pub mod lattice;
pub mod limits;
pub mod metadata;
pub mod page;
pub mod quadtree;
pub mod reader;
pub mod source;
pub mod verify;
pub mod writer;

pub use chart::{Chart, ChartId, Glue, Side};
pub use error::Error;
pub use index::{NormalCone, PageEntry};
pub use lattice::{Bounds, Lattice, LatticePoint};
pub use limits::Limits;
pub use metadata::{ContentKind, Metadata};
pub use page::{PageId, PageSamples};
pub use quadtree::{NodeId, Quadrant};
pub use reader::{Document, Opening, Step};
pub use source::{ByteSource, SourceError};
