// Encodes a band of rows of a finished picture (linear light) as sRGB for the screen.

struct Band {
    size: vec2<u32>,
    first_row: u32,
    padding: u32,
}

@group(2) @binding(0) var<uniform> band: Band;
@group(2) @binding(1) var<storage, read> picture: array<vec4<f32>>;
@group(2) @binding(2) var shown: texture_storage_2d<rgba8unorm, write>;

// Encodes linear light as sRGB (IEC 61966-2-1).
fn srgb(linear: vec3<f32>) -> vec3<f32> {
    let x = clamp(linear, vec3<f32>(0.0), vec3<f32>(1.0));
    return select(1.055 * pow(x, vec3<f32>(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3<f32>(0.0031308));
}

@compute @workgroup_size(#{PICTURE_SIDE}, #{PICTURE_SIDE})
fn display(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= band.size.x || id.y >= band.size.y { return; }
    let color = srgb(picture[id.y * band.size.x + id.x].rgb);
    textureStore(shown, vec2<u32>(id.x, id.y + band.first_row), vec4<f32>(color, 1.0));
}
