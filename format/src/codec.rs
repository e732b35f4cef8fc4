//! Coding of samples into page bytes.
