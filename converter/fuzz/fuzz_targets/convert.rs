//! Any bytes as a mesh file, converted and verified.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| marquetry_converter::fuzzing::convert(data, "mesh"));
