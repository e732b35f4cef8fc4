// Clusters: indexed triangles on the lattice. Appended to the shader of the grids, whose fragments it shares.

// Position as in `samples.wgsl`; normal in the low half, the level above it; colour.
fn cluster_vertex(words: vec4<u32>) -> FromVertex {
    let offset = offset_from_eye(unpack_point(words.xy));
    var out: FromVertex;
    out.clip = frame.clip_from_offset * vec4<f32>(offset, 1.0);
    out.to_eye = -offset;
    out.normal = unpack_normal(words.z & 0xffffu);
    out.albedo = linear_from_srgb(select(GREY, unpack_colour(words.w), frame.has_colours != 0u));
    out.resolution = words.z >> 16u;
    // Clusters have the colours of their vertices alone.
    out.uv = vec2<f32>(0.0);
    out.tiles = vec2<u32>(0u, NO_TILES);
    return out;
}

@vertex
fn cluster_surface_vertex(@location(0) words: vec4<u32>) -> FromVertex {
    return cluster_vertex(words);
}

@vertex
fn cluster_line_vertex(@location(0) words: vec4<u32>) -> FromVertex {
    var out = cluster_vertex(words);
    // As for the grids' lines.
    out.clip.z = out.clip.z * 1.0005;
    return out;
}
