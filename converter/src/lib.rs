//! Scan to atlas: importers, segmentation, parametrization, resampling.

pub mod atlas;
pub mod cluster;
pub mod error;
pub mod import;
pub mod mesh;
pub mod parameterize;
pub mod pipeline;
pub mod process;
pub mod quadrangulate;
pub mod report;
pub mod resample;
pub mod segment;
