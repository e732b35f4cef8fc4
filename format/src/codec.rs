//! Coding of samples into page bytes.
//!
//! A page holds what its node adds to what the reader already has: the parent's quadrant, or the base. New
//! samples are predicted from the coarser ones (`grid`, `shading`) and stored as residuals, in byte planes, packed by
//! zstd (`packing`). Everything is integer arithmetic, so every machine decodes the same bytes to the same
//! samples.

pub(crate) mod grid;
pub mod octahedral;
pub(crate) mod packing;
pub(crate) mod page;
pub(crate) mod payload;
pub(crate) mod range;
pub(crate) mod sample;
pub(crate) mod shading;
pub(crate) mod targets;
