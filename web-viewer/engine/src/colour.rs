//! Colour tiles in view: which are wanted, fetched, resident, and which of them each drawn node shows.
//!
//! Tiles are streamed beside the pages, at their own level: the finest whose texels are no smaller than a pixel. Until they
//! come, a node shows the deepest tile above it that is there, or the colours of its samples. What each place of a node
//! shows is written in a small map that the shader looks up, since a node may be covered by many tiles and a tile by
//! many nodes.

pub mod desire;
pub mod layer;
pub mod map;
pub mod slots;
pub mod store;
pub mod stream;
pub mod upload;
