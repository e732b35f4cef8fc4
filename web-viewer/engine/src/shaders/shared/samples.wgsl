// Samples as `residency/upload.rs` packs them.
@group(0) @binding(1) var position_texels: texture_2d_array<u32>;
@group(0) @binding(2) var normal_texels: texture_2d_array<u32>;
@group(0) @binding(3) var colour_texels: texture_2d_array<u32>;

// 3×21 bits in two words.
fn unpack_point(words: vec2<u32>) -> vec3<u32> {
    return vec3<u32>(
        words.x & 0x1fffffu,
        (words.x >> 21u) | ((words.y & 0x3ffu) << 11u),
        (words.y >> 10u) & 0x1fffffu,
    );
}

// Octahedral, 2×8 bits; a byte b stands for (2b − 255) / 255.
fn unpack_normal(code: u32) -> vec3<f32> {
    let bytes = vec2<f32>(f32(code & 0xffu), f32((code >> 8u) & 0xffu));
    let p = 2.0 * bytes - 255.0;
    let z = 255.0 - abs(p.x) - abs(p.y);
    let folded = (255.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return normalize(vec3<f32>(select(folded, p, z >= 0.0), z));
}

fn unpack_colour(code: u32) -> vec3<f32> {
    return vec3<f32>(f32(code & 0xffu), f32((code >> 8u) & 0xffu), f32((code >> 16u) & 0xffu)) / 255.0;
}
