//! Geometric distances between triangle meshes, image metrics, and plots of them.
//!
//! Works on plain arrays (positions, index triples, pixels) and knows neither files nor the atlas, so the
//! converter can call it for its error bound and the tests for their acceptance numbers.

pub mod distance;
pub mod image;
pub mod pareto;
pub mod plot;
pub mod popping;

pub use distance::{Bvh, Closest, Distances, Mesh, MeshError, OneWay, measure};
