// Colour tiles. What each place of a node shows is in a map of two texels an entry, as `colour/map.rs` writes it.
@group(0) @binding(4) var tile_texels: texture_2d_array<f32>;
@group(0) @binding(5) var tile_sampler: sampler;
@group(0) @binding(6) var tile_map: texture_2d<f32>;

const NO_TILES: u32 = 0xffffffffu;
// In place of a part of the map: `uv` is a place on a layer of the texels.
const WHOLE_TEXTURE: u32 = 0xfffffffeu;
// Entries in a row of the map.
const MAP_ROW: u32 = 512u;
// Samples along a pixel's longer side at most.
const MOST_STEPS: f32 = 4.0;
// Texels that one of the coarsest mip stands for, along each axis.
const COARSEST: f32 = 8.0;
// The same for a texture whose patches have others beside them.
const COARSEST_OF_PATCHES: f32 = 2.0;

// The linear colour at `uv` of a node whose part of the map is `place`; `sampled` where no tile is there. `along_x` and
// `along_y` are the steps of `uv` from pixel to pixel.
fn tile_colour(place: vec2<u32>, uv: vec2<f32>, along_x: vec2<f32>, along_y: vec2<f32>, sampled: vec3<f32>) -> vec3<f32> {
    if place.y == NO_TILES {
        return sampled;
    }
    if place.y == WHOLE_TEXTURE {
        return filtered(uv, i32(place.x), along_x, along_y, 1.0, COARSEST_OF_PATCHES);
    }
    let side = 1u << place.y;
    let cell = min(vec2<u32>(max(uv, vec2<f32>(0.0)) * f32(side)), vec2<u32>(side - 1u));
    let number = place.x + cell.y * side + cell.x;
    let texel = vec2<u32>(2u * (number % MAP_ROW), number / MAP_ROW);
    let transform = textureLoad(tile_map, texel, 0);
    let shown = textureLoad(tile_map, texel + vec2<u32>(1u, 0u), 0);
    if shown.z == 0.0 {
        return sampled;
    }
    let step_x = along_x * transform.zw;
    let step_y = along_y * transform.zw;
    let at = transform.xy + uv * transform.zw;
    let colour = filtered(at, i32(shown.x), step_x, step_y, exp2(max(shown.y, 0.0)), COARSEST);
    return mix(sampled, colour, shown.z);
}

// The mean over a pixel that is `step_x` by `step_y`: up to four trilinear samples along its longer side. `least` is the
// fewest texels that it may cover: a tile that has just come starts as blurred as its parent was; `coarsest` the most across it.
//
// Not left to the sampler's anisotropy: how far from `at` it reaches would be the device's affair, and the margin of a
// tile is narrow.
fn filtered(at: vec2<f32>, layer: i32, step_x: vec2<f32>, step_y: vec2<f32>, least: f32, coarsest: f32) -> vec3<f32> {
    let size = f32(textureDimensions(tile_texels).x);
    let texels = vec2<f32>(length(step_x), length(step_y)) * size;
    let major = clamp(max(texels.x, texels.y), least, MOST_STEPS * coarsest);
    let minor = clamp(min(texels.x, texels.y), max(least, major / MOST_STEPS), coarsest);
    let longer = select(step_y, step_x, texels.x > texels.y);
    let axis = longer * (major / max(max(texels.x, texels.y), major));
    let count = clamp(ceil(major / minor - 0.1), 1.0, MOST_STEPS);
    let level = log2(minor);
    var sum = vec3<f32>(0.0);
    for (var k = 0.0; k < count; k += 1.0) {
        let place = at + axis * ((k + 0.5) / count - 0.5);
        sum += textureSampleLevel(tile_texels, tile_sampler, place, layer, level).rgb;
    }
    return sum / count;
}
