// Clusters: indexed triangles on the lattice. Appended to the shader of the grids, whose fragments it shares.

// Texels a side of the smallest part of a layer, and of a layer. As in `residency/textures.rs`.
const SMALLEST_PART: f32 = 64.0;
const TEXTURE_LAYER: f32 = 2048.0;

// By slot, row by row: how far its vertices are on the way to their targets.
@group(0) @binding(7) var cluster_morphs: texture_2d<f32>;

// Slots in a row, and vertices of a slot. As in `passes/cluster.rs` and `residency/upload.rs`.
const MORPHS_ACROSS: u32 = 128u;
const SLOT_VERTICES: u32 = 256u;

// Position as in `samples.wgsl`; normal in the low half, level and column on the texture above it; colour and row. `texture` is the code
// of the texture's part, 0 without one. `above`: position, normal and colour of the target.
fn cluster_vertex(words: vec4<u32>, texture: u32, above: vec4<u32>, index: u32) -> FromVertex {
    let slot = index / SLOT_VERTICES;
    let morph = textureLoad(cluster_morphs, vec2<u32>(slot % MORPHS_ACROSS, slot / MORPHS_ACROSS), 0).x;
    let own = offset_from_eye(unpack_point(words.xy));
    // What has its own place as target stays there exactly, whatever the morph.
    let offset = own + morph * (offset_from_eye(unpack_point(above.xy)) - own);
    let colour = mix(unpack_colour(words.w), unpack_colour(above.w), morph);
    var out: FromVertex;
    out.clip = frame.clip_from_offset * vec4<f32>(offset, 1.0);
    out.to_eye = -offset;
    out.normal = mix(unpack_normal(words.z & 0xffffu), unpack_normal(above.z & 0xffffu), morph);
    out.albedo = linear_from_srgb(select(GREY, colour, frame.has_colours != 0u));
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
    @location(2) above: vec4<u32>,
    @builtin(vertex_index) index: u32,
) -> FromVertex {
    return cluster_vertex(words, texture, above, index);
}

@vertex
fn cluster_line_vertex(
    @location(0) words: vec4<u32>,
    @location(1) texture: u32,
    @location(2) above: vec4<u32>,
    @builtin(vertex_index) index: u32,
) -> FromVertex {
    var out = cluster_vertex(words, texture, above, index);
    // As for the grids' lines.
    out.clip.z = out.clip.z * 1.0005;
    return out;
}
