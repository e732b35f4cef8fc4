// Plain indexed meshes. Appended to the shader of the grids, whose light it shares.

@group(1) @binding(0) var mesh_texels: texture_2d<f32>;
@group(1) @binding(1) var mesh_sampler: sampler;

struct FromMesh {
    @builtin(position) clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) albedo: vec3<f32>,
    // Lattice units.
    @location(2) to_eye: vec3<f32>,
    @location(3) uv: vec2<f32>,
}

@vertex
fn mesh_vertex(
    @location(0) point: vec2<u32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec4<f32>,
    @location(3) uv: vec2<f32>,
) -> FromMesh {
    let offset = offset_from_eye(unpack_point(point));
    var out: FromMesh;
    out.clip = frame.clip_from_offset * vec4<f32>(offset, 1.0);
    out.to_eye = -offset;
    out.normal = normal;
    out.albedo = linear_from_srgb(select(GREY, colour.rgb, frame.has_colours != 0u));
    out.uv = uv;
    return out;
}

@fragment
fn mesh_fragment(in: FromMesh, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let albedo = in.albedo * textureSample(mesh_texels, mesh_sampler, in.uv).rgb;
    return shaded(albedo, in.normal, in.to_eye, is_front);
}
