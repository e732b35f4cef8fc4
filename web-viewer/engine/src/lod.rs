//! Which nodes are drawn, at which resolution, and how they meet. No GPU.
//!
//! [`desire`] says what the view wants, [`balance`] makes neighbours differ by at most one resolution, [`residency`]
//! keeps to pages that are there, [`rest`] says how far that is on its way to the next coarser surface,
//! [`animate`] moves what is drawn towards that in steps that do not pop, and
//! [`edge_morph`] decides how each side of each node meets its neighbour. [`mesh`] is the CPU reference of the drawing.

pub mod animate;
pub mod balance;
pub mod cluster;
pub mod cut;
pub mod desire;
pub mod edge_morph;
pub mod mesh;
pub mod residency;
pub mod rest;
pub mod uniform;

pub use cut::{Across, Cut, Leaf};
