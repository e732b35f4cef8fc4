//! Every shader parses and validates, without a GPU.

use marquetry_engine::gpu_types::CLUSTER_ATTRIBUTES;
use marquetry_engine::passes::cluster::{MORPHS_ACROSS, shader};
use marquetry_engine::passes::{blend, grid::SHADER};
use marquetry_engine::residency::upload::CLUSTER_VERTICES;
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

#[test]
fn cluster_shader_is_valid() {
    let source = shader();
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    for name in ["cluster_surface_vertex", "cluster_line_vertex"] {
        let entry = module.entry_points.iter().find(|entry| entry.name == name);
        let arguments = &entry.unwrap().function.arguments;
        // The attributes that `CLUSTER_ATTRIBUTES` and `CLUSTER_TEXTURE_ATTRIBUTES` say, and the number of the vertex.
        assert_eq!(arguments.len(), 4);
        for attribute in CLUSTER_ATTRIBUTES {
            let argument = arguments.iter().find(|argument| {
                let location = attribute.shader_location;
                matches!(argument.binding, Some(naga::Binding::Location { location: own, .. }) if own == location)
            });
            assert!(matches!(
                module.types[argument.unwrap().ty].inner,
                naga::TypeInner::Vector {
                    size: naga::VectorSize::Quad,
                    scalar: naga::Scalar::U32
                }
            ));
        }
        let numbers = [
            format!("SLOT_VERTICES: u32 = {CLUSTER_VERTICES}u;"),
            format!("MORPHS_ACROSS: u32 = {MORPHS_ACROSS}u;"),
        ];
        assert!(numbers.iter().all(|number| source.contains(number)));
    }
}

#[test]
fn blend_shader_is_valid() {
    let module = naga::front::wgsl::parse_str(blend::SHADER)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(blend::SHADER)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(blend::SHADER)));
}
