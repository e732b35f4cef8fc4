// What is the same for a whole frame. `Frame` in `gpu_types.rs`.
struct Frame {
    clip_from_offset: mat4x4<f32>,
    eye_whole: vec3<i32>,
    shade: u32,
    eye_fraction: vec3<f32>,
    has_colours: u32,
    right: vec4<f32>,
    up: vec4<f32>,
    back: vec4<f32>,
    // What stays: xyz · offset from the eye is at most w.
    section: vec4<f32>,
    // Noise from which (x) and below which (y) pixels are drawn.
    mask: vec4<f32>,
}

// 0 is lit; 3 is lit, too, with lines over it.
const SHADE_NORMAL: u32 = 1u;
const SHADE_LOD: u32 = 2u;
const SHADE_UNLIT: u32 = 4u;

@group(0) @binding(0) var<uniform> frame: Frame;

// The subtraction is exact: only what is left of it, small near the eye, is rounded to a float.
fn offset_from_eye(lattice_point: vec3<u32>) -> vec3<f32> {
    return vec3<f32>(vec3<i32>(lattice_point) - frame.eye_whole) - frame.eye_fraction;
}
