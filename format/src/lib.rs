//! The `.marq` file format: header, paged index, page codecs, reader, writer, verification.
//!
//! Knows no async runtime, no GPU and no mesh processing, and builds for wasm32, where it reads only.
//! `SPEC.md` beside this crate describes the bytes; the vocabulary is in the project's `ARCHITECTURE.md`.

#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::arithmetic_side_effects)
)]
#![cfg_attr(
    test,
    allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "test data are small"
    )
)]
#![cfg_attr(
    target_arch = "wasm32",
    allow(dead_code, reason = "wasm builds only read")
)]

mod bytes;
mod bytes_by_part;
pub mod chart;
pub mod cluster;
pub mod codec;
pub mod colour;
pub mod error;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
pub mod header;
pub mod index;
pub mod lattice;
pub mod limits;
pub mod metadata;
pub mod page;
mod parallel;
pub mod quadtree;
pub mod reader;
mod rules;
pub mod source;
pub mod task;
pub mod thumbnail;
pub mod verify;
#[cfg(not(target_arch = "wasm32"))]
pub mod writer;

pub use bytes_by_part::BytesByPart;
pub use chart::{Chart, ChartId, Glue, Side};
pub use cluster::{ClusterGroup, ClusterGroupId, ClusterId, ClusterMesh, ClusterNode, Clusters};
pub use codec::octahedral;
pub use colour::{ColourIndex, TexelSize, TileEntry, TileId, TileTexels};
pub use error::Error;
pub use index::{NormalCone, PageEntry};
pub use lattice::{Bounds, Lattice, LatticePoint};
pub use limits::Limits;
pub use metadata::{ContentKind, Metadata};
pub use page::{PageId, PageSamples};
pub use quadtree::{NodeId, Quadrant};
pub use reader::{Document, Opening, Step};
#[cfg(any(unix, windows))]
pub use source::FileSource;
pub use source::{ByteSource, SliceSource, SourceError};
pub use task::{DecodedPage, ImageTask, PageTask};
