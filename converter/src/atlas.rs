//! Charts, their shared borders, and what is written of them.

pub mod build;
mod caps;
pub mod chart_graph;
pub mod colour;
pub mod depth;
pub(crate) mod leaves;
mod normals;
pub mod patch;
pub mod quantize;
pub mod summary;
pub(crate) mod survey;
