//! Decodes any bytes as the mesh of a cluster, without checksums; what decodes must survive coding.
//!
//! `cargo +nightly fuzz run cluster_decode -- -max_total_time=60`, in `format/`.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| marquetry_format::fuzzing::cluster(data));
