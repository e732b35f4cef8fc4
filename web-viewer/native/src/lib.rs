//! Native shell of the engine: window, headless rendering, file and HTTP sources.

mod clicks;
mod decoders;
pub mod error;
pub mod headless;
mod loader;
pub mod mesh;
pub mod path;
mod picture;
pub mod render;
pub mod source;
mod target;
pub mod window;
mod writer;

pub use decoders::Decoders;
pub use error::NativeError;
pub use headless::{Headless, Session};
pub use mesh::{MeshPainter, PlainMesh};
pub use picture::Picture;
