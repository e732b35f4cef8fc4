//! End-to-end tests on the real binaries: the harness.
//!
//! The tests themselves are in `tests/`. They run the `marquetry` binary as a user does, and look at what it wrote with
//! readers of their own where that is what is tested.

pub mod binary;
pub mod converted;
pub mod data;
pub mod http;
pub mod meshes;
pub mod network;
pub mod ply;
pub mod raster;
pub mod server;
pub mod stability;
pub mod stage;
pub mod textured;

pub use binary::{Finished, marquetry};
pub use converted::{BOTH_WAYS, Converted, WITH_CHARTS, convert};
