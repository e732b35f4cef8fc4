// Which pixels of the surface are drawn. `Frame::cut_open` and `Frame::masked` set what they are compared with.

// Whether there is a section, or a change from one picture to another.
override discards: bool = false;

// Jimenez, "Next Generation Post Processing in Call of Duty: Advanced Warfare", 2014: noise whose values are spread
// evenly over every few pixels. One value a pixel, so what one picture leaves free the other fills, and nothing is open.
fn interleaved_gradient_noise(pixel: vec2<f32>) -> f32 {
    return fract(52.9829189 * fract(dot(floor(pixel), vec2<f32>(0.06711056, 0.00583715))));
}

fn is_cut_away(pixel: vec2<f32>, to_eye: vec3<f32>) -> bool {
    if !discards {
        return false;
    }
    let noise = interleaved_gradient_noise(pixel);
    return dot(frame.section.xyz, -to_eye) > frame.section.w || noise < frame.mask.x || noise >= frame.mask.y;
}
