//! Structures shared with the shaders have the same layout on both sides.

use marquetry_engine::gpu_types::{Frame, Instance, SNAP};
use marquetry_engine::passes::grid::SHADER;
use marquetry_engine::wgpu::VertexFormat;
use std::mem::{offset_of, size_of};

fn module() -> naga::Module {
    naga::front::wgsl::parse_str(SHADER)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(SHADER)))
}

#[test]
fn frame_has_the_same_members_in_the_same_places() {
    let module = module();
    let (members, span) = module
        .types
        .iter()
        .find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some("Frame") => {
                Some((members, *span))
            }
            _ => None,
        })
        .unwrap();
    let wgsl: Vec<(&str, usize)> = members
        .iter()
        .map(|m| (m.name.as_deref().unwrap(), m.offset as usize))
        .collect();
    let rust = [
        ("clip_from_offset", offset_of!(Frame, clip_from_offset)),
        ("eye_whole", offset_of!(Frame, eye_whole)),
        ("shade", offset_of!(Frame, shade)),
        ("eye_fraction", offset_of!(Frame, eye_fraction)),
        ("has_colours", offset_of!(Frame, has_colours)),
        ("right", offset_of!(Frame, right)),
        ("up", offset_of!(Frame, up)),
        ("back", offset_of!(Frame, back)),
        ("section", offset_of!(Frame, section)),
        ("mask", offset_of!(Frame, mask)),
    ];
    assert_eq!(wgsl, rust);
    assert_eq!(span as usize, size_of::<Frame>());
}

#[test]
fn instance_attributes_cover_the_instance() {
    let mut end = 0;
    for attribute in Instance::ATTRIBUTES {
        assert_eq!(attribute.offset, end);
        end += attribute.format.size();
    }
    assert_eq!(end, size_of::<Instance>() as u64);
}

#[test]
fn instance_attributes_have_the_types_of_the_shader() {
    let module = module();
    for entry in module
        .entry_points
        .iter()
        .filter(|entry| entry.stage == naga::ShaderStage::Vertex)
    {
        for argument in &entry.function.arguments {
            let Some(naga::Binding::Location { location, .. }) = &argument.binding else {
                continue;
            };
            let format = match &module.types[argument.ty].inner {
                naga::TypeInner::Vector {
                    size: naga::VectorSize::Quad,
                    scalar,
                } if *scalar == naga::Scalar::U32 => VertexFormat::Uint32x4,
                naga::TypeInner::Vector {
                    size: naga::VectorSize::Quad,
                    scalar,
                } if *scalar == naga::Scalar::F32 => VertexFormat::Float32x4,
                naga::TypeInner::Vector {
                    size: naga::VectorSize::Bi,
                    scalar,
                } if *scalar == naga::Scalar::U32 => VertexFormat::Uint32x2,
                naga::TypeInner::Scalar(scalar) if *scalar == naga::Scalar::F32 => {
                    VertexFormat::Float32
                }
                other => panic!("location {location} is {other:?}"),
            };
            let attribute = Instance::ATTRIBUTES
                .iter()
                .find(|a| a.shader_location == *location)
                .unwrap();
            assert_eq!(attribute.format, format, "location {location}");
        }
    }
}

#[test]
fn snap_is_the_same_number() {
    assert!(SHADER.contains(&format!("const SNAP: f32 = {SNAP:?};")));
}
