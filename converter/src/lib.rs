//! Scan to atlas: importers, segmentation, parametrization, resampling.

pub mod atlas;
pub mod cluster;
pub mod error;
mod fit;
#[cfg(any(test, feature = "fuzzing"))]
pub mod fuzzing;
pub mod import;
pub mod memory;
pub mod mesh;
pub mod output;
pub mod parameterize;
pub mod pipeline;
pub mod process;
pub mod quadrangulate;
pub mod report;
pub mod resample;
pub mod segment;
pub mod texture;
pub mod thumbnail;
