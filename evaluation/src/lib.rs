//! Geometric distances and image metrics.
