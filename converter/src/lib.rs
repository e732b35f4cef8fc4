//! Scan to atlas: importers, segmentation, parametrization, resampling.

pub mod atlas;
pub mod import;
pub mod mesh;
pub mod parameterize;
pub mod resample;
pub mod segment;
