//! Any bytes as a file with the extension off, as far as the manifold.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| marquetry_converter::fuzzing::import(data, "off"));
