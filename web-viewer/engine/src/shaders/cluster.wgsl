// Clusters: indexed triangles on the lattice. Appended to the shader of the grids, whose fragments it shares.

// Texels a side of the smallest part of a layer, and of a layer. As in `residency/textures.rs`.
const SMALLEST_PART: f32 = 64.0;
const TEXTURE_LAYER: f32 = 2048.0;

// Position as in `samples.wgsl`; normal in the low half, level and column on the texture above it; colour and row. `texture` is the code
// of the texture's part, 0 without one.
fn cluster_vertex(words: vec4<u32>, texture: u32) -> FromVertex {
    let offset = offset_from_eye(unpack_point(words.xy));
    var out: FromVertex;
    out.clip = frame.clip_from_offset * vec4<f32>(offset, 1.0);
    out.to_eye = -offset;
    out.normal = unpack_normal(words.z & 0xffffu);
    out.albedo = linear_from_srgb(select(GREY, unpack_colour(words.w), frame.has_colours != 0u));
    out.resolution = (words.z >> 16u) & 0xffu;
    out.uv = vec2<f32>(0.0);
    out.tiles = vec2<u32>(0u, NO_TILES);
    if texture > 0u {
        let corner = SMALLEST_PART * vec2<f32>(f32(texture & 0xffu), f32((texture >> 8u) & 0xffu));
        let texel = vec2<f32>(f32(words.z >> 24u), f32(words.w >> 24u)) + 0.5;
        let halved = exp2(-f32((texture >> 24u) & 3u));
        out.uv = (corner + halved * texel) / TEXTURE_LAYER;
        out.tiles = vec2<u32>((texture >> 16u) & 0xffu, WHOLE_TEXTURE);
    }
    return out;
}

@vertex
fn cluster_surface_vertex(
    @location(0) words: vec4<u32>,
    @location(1) texture: u32,
) -> FromVertex {
    return cluster_vertex(words, texture);
}

@vertex
fn cluster_line_vertex(
    @location(0) words: vec4<u32>,
    @location(1) texture: u32,
) -> FromVertex {
    var out = cluster_vertex(words, texture);
    // As for the grids' lines.
    out.clip.z = out.clip.z * 1.0005;
    return out;
}
