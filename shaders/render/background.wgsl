// Fills tiles of a picture that show only the background.

#import umbravox::frame::{frame, picture, background_pixel}

@compute @workgroup_size(#{PICTURE_SIDE}, #{PICTURE_SIDE})
fn fill(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let pixel = background_pixel(group, groups, local);
    if !pixel.inside { return; }
    picture[pixel.index] = vec4<f32>(frame.background, 0.0);
}
