//! Charts, their shared borders, and what is written of them.

pub mod patch;
