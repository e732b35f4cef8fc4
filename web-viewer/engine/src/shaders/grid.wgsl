// Plain drawing: one instance of a regular grid for each leaf of the cut.

override encode_srgb: bool = false;

struct FromVertex {
    // Equal inputs give equal outputs in every pipeline: lines lie on the triangles they outline.
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) albedo: vec3<f32>,
    @location(2) @interpolate(flat) resolution: u32,
    // Lattice units.
    @location(3) to_eye: vec3<f32>,
    @location(4) uv: vec2<f32>,
    @location(5) @interpolate(flat) tiles: vec2<u32>,
}

fn grid_vertex(place: vec4<u32>, sides: vec4<f32>, morph: f32, tiles: vec2<u32>, index: u32) -> FromVertex {
    let vertex = patch_vertex(place, sides, morph, index);
    var out: FromVertex;
    out.clip = frame.clip_from_offset * vec4<f32>(vertex.offset, 1.0);
    out.to_eye = -vertex.offset;
    out.normal = vertex.normal;
    out.albedo = linear_from_srgb(select(GREY, vertex.colour, frame.has_colours != 0u));
    out.resolution = place.w >> 24u;
    out.uv = vertex.uv;
    out.tiles = tiles;
    return out;
}

@vertex
fn surface_vertex(
    @location(0) place: vec4<u32>,
    @location(1) sides: vec4<f32>,
    @location(2) morph: f32,
    @location(3) tiles: vec2<u32>,
    @builtin(vertex_index) index: u32,
) -> FromVertex {
    return grid_vertex(place, sides, morph, tiles, index);
}

@vertex
fn line_vertex(
    @location(0) place: vec4<u32>,
    @location(1) sides: vec4<f32>,
    @location(2) morph: f32,
    @location(3) tiles: vec2<u32>,
    @builtin(vertex_index) index: u32,
) -> FromVertex {
    var out = grid_vertex(place, sides, morph, tiles, index);
    // Depth is reversed: a little more is a little nearer. WebGPU has no depth bias for lines.
    out.clip.z = out.clip.z * 1.0005;
    return out;
}

fn encoded(colour: vec3<f32>) -> vec4<f32> {
    if encode_srgb {
        return vec4<f32>(srgb_from_linear(clamp(colour, vec3<f32>(0.0), vec3<f32>(1.0))), 1.0);
    }
    return vec4<f32>(colour, 1.0);
}

// Cosine of the angle to the viewer from which on a normal tells the side.
const CLEARLY: f32 = 0.25;

// The colour of a surface: `normal` as interpolated, `to_eye` in lattice units.
fn shaded(albedo: vec3<f32>, normal: vec3<f32>, to_eye: vec3<f32>, is_front: bool) -> vec4<f32> {
    // Zero where interpolated normals cancel: then the viewer's direction is as good as any.
    let squared = dot(normal, normal);
    let outward = select(frame.back.xyz, normal * inverseSqrt(max(squared, 1e-12)), squared > 1e-12);
    if frame.shade == SHADE_NORMAL {
        return encoded(linear_from_srgb(0.5 + 0.5 * outward));
    }
    if frame.shade == SHADE_UNLIT {
        return encoded(albedo);
    }
    // Open scans are seen from behind, too. A triangle smaller than the lattice's rounding may be turned over while its
    // surface is not: then the normal knows better, if it clearly is the viewer's. Along the edge of what is seen from behind
    // interpolated normals lean over to the viewer as well.
    let is_outside = is_front || dot(outward, to_eye) > CLEARLY * length(to_eye);
    return encoded(lit(albedo, select(-outward, outward, is_outside)));
}

@fragment
fn surface_fragment(in: FromVertex, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let along_x = dpdx(in.uv);
    let along_y = dpdy(in.uv);
    if is_cut_away(in.clip.xy, in.to_eye) {
        discard;
    }
    var albedo: vec3<f32>;
    if frame.shade == SHADE_LOD {
        albedo = linear_from_srgb(resolution_colour(in.resolution));
    } else {
        albedo = tile_colour(in.tiles, in.uv, along_x, along_y, in.albedo);
    }
    return shaded(albedo, in.normal, in.to_eye, is_front);
}

@fragment
fn line_fragment(in: FromVertex) -> @location(0) vec4<f32> {
    if is_cut_away(in.clip.xy, in.to_eye) {
        discard;
    }
    return encoded(0.12 * in.albedo);
}
