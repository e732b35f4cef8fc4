//! Scan to atlas: importers, segmentation, parametrization, resampling.
