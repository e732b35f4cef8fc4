// The new picture over the old one; how much of it is the blend constant.

@group(0) @binding(0) var arriving: texture_2d<f32>;

@vertex
fn blend_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // One triangle that covers the picture.
    let corner = vec2<f32>(f32((index & 1u) << 2u), f32((index & 2u) << 1u));
    return vec4<f32>(corner - 1.0, 0.0, 1.0);
}

@fragment
fn blend_fragment(@builtin(position) pixel: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(arriving, vec2<i32>(pixel.xy), 0);
}
