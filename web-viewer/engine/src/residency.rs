//! Which pages are in memory, and how they come and go. No GPU, no I/O.

pub mod fetch;
pub mod ids;
pub mod lru;
pub mod page_table;
pub mod textures;
pub mod upload;
