//! Every shader parses and validates, without a GPU.

use marquetry_engine::passes::grid::SHADER;
use naga::valid::{Capabilities, ValidationFlags, Validator};

#[test]
fn grid_shader_is_valid() {
    let module = naga::front::wgsl::parse_str(SHADER)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(SHADER)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(SHADER)));
    let entries: Vec<&str> = module
        .entry_points
        .iter()
        .map(|entry| entry.name.as_str())
        .collect();
    assert_eq!(
        entries,
        [
            "surface_vertex",
            "line_vertex",
            "surface_fragment",
            "line_fragment"
        ]
    );
}
