//! Any bytes as a GLB or glTF file, as far as the manifold.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let extension = if data.starts_with(b"{") { "gltf" } else { "glb" };
    marquetry_converter::fuzzing::import(data, extension);
});
