// Light that comes with the camera, and colour spaces. Linear unless named sRGB.

// Of a surface without colours.
const GREY: vec3<f32> = vec3<f32>(0.78, 0.78, 0.76);

fn linear_from_srgb(colour: vec3<f32>) -> vec3<f32> {
    let low = colour / 12.92;
    let high = pow((colour + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, colour <= vec3<f32>(0.04045));
}

fn srgb_from_linear(colour: vec3<f32>) -> vec3<f32> {
    let low = colour * 12.92;
    let high = 1.055 * pow(colour, vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(high, low, colour <= vec3<f32>(0.0031308));
}

// Sky and ground along the picture's up, and one key light from above the viewer's left shoulder.
fn lit(albedo: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let sky = vec3<f32>(0.27, 0.30, 0.35);
    let ground = vec3<f32>(0.07, 0.06, 0.05);
    // Of length 1: 0.8, 0.6 and -0.55 along the picture's axes, which are at right angles.
    let key_direction = 0.70097 * frame.back.xyz + 0.52573 * frame.up.xyz - 0.48192 * frame.right.xyz;
    let hemisphere = mix(ground, sky, 0.5 + 0.5 * dot(normal, frame.up.xyz));
    let key = vec3<f32>(0.95, 0.91, 0.84) * max(dot(normal, key_direction), 0.0);
    return albedo * (hemisphere + key);
}

// A colour for each resolution; neighbours are told apart at a glance.
fn resolution_colour(resolution: u32) -> vec3<f32> {
    let hue = 0.12 + 0.381966 * f32(resolution);
    return 0.52 + 0.42 * cos(6.2831853 * (hue + vec3<f32>(0.0, 0.33, 0.67)));
}
