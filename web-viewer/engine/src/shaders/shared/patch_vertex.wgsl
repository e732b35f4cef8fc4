// Where a vertex of a drawn leaf is. `Patch::vertex` in `lod/mesh.rs` is the same function.
//
// Both charts at a border run this code on equal samples and equal morphs, and so get equal floats.

const SNAP: f32 = -1.0;

struct PatchVertex {
    // From the eye, lattice units.
    offset: vec3<f32>,
    // Not normalized.
    normal: vec3<f32>,
    // sRGB.
    colour: vec3<f32>,
    // Place in the node's square.
    uv: vec2<f32>,
}

// A vertex may lie on two sides; the one that moves it more decides.
fn side_morph(so_far: f32, mode: f32) -> f32 {
    return max(so_far, select(mode, 1.0, mode == SNAP));
}

fn patch_vertex(place: vec4<u32>, sides: vec4<f32>, own_morph: f32, index: u32) -> PatchVertex {
    let grid_resolution = place.w & 0xffu;
    let stride_log2 = (place.w >> 8u) & 0xffu;
    let level = (place.w >> 16u) & 0xffu;
    let cells = 1u << grid_resolution;
    var i = index % (cells + 1u);
    var j = index / (cells + 1u);

    let on_side = vec4<bool>(j == 0u, i == cells, j == cells, i == 0u);
    var morph = own_morph;
    if any(on_side) {
        morph = 0.0;
        if on_side.x { morph = side_morph(morph, sides.x); }
        if on_side.y { morph = side_morph(morph, sides.y); }
        if on_side.z { morph = side_morph(morph, sides.z); }
        if on_side.w { morph = side_morph(morph, sides.w); }
    }
    if cells == 1u {
        morph = 0.0;
    } else {
        // The coarser neighbour has no odd sample here: onto the even one, not onto the midpoint, which would be a T-junction.
        if (on_side.x && sides.x == SNAP) || (on_side.z && sides.z == SNAP) { i = i & 0xfffffffeu; }
        if (on_side.y && sides.y == SNAP) || (on_side.w && sides.w == SNAP) { j = j & 0xfffffffeu; }
    }

    let texel = vec2<i32>(place.xy + (vec2<u32>(i, j) << vec2<u32>(stride_log2)));
    let layer = i32(place.z);
    let is_odd = ((i | j) & 1u) == 1u;
    // Even samples of a root stay: their goal belongs to the resolution that introduced them.
    let attribute_morph = select(0.0, morph, is_odd || level > 0u);
    let position_morph = select(0.0, morph, is_odd);

    let points = textureLoad(position_texels, texel, layer, 0);
    let own_offset = offset_from_eye(unpack_point(points.xy));
    let goal_offset = offset_from_eye(unpack_point(points.zw));
    let normals = textureLoad(normal_texels, texel, layer, 0).x;
    let own_normal = unpack_normal(normals & 0xffffu);
    let goal_normal = unpack_normal(normals >> 16u);

    var out: PatchVertex;
    out.uv = vec2<f32>(vec2<u32>(i, j)) / f32(cells);
    out.offset = own_offset + (goal_offset - own_offset) * position_morph;
    out.normal = own_normal + (goal_normal - own_normal) * attribute_morph;
    out.colour = vec3<f32>(1.0);
    if frame.has_colours != 0u {
        let colours = textureLoad(colour_texels, texel, layer, 0);
        let own_colour = unpack_colour(colours.x);
        let goal_colour = unpack_colour(colours.y);
        out.colour = own_colour + (goal_colour - own_colour) * attribute_morph;
    }
    return out;
}
