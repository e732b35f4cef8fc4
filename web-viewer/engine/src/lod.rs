//! Which nodes are drawn, at which resolution, and how they meet.
