//! Which pages are in memory, and how they come and go.

pub mod fetch;
