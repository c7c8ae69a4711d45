// The window's widgets on a software adapter: egui's triangles, each pixel by one filtered texture sample.

@group(0) @binding(0) var glyphs: texture_2d<f32>;
@group(0) @binding(1) var between: sampler;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) color: vec4<f32>,
}

// A position in the window, x right, y down, from 0 to 1; a colour in sRGB codes, its alpha multiplied in.
@vertex
fn corner(@location(0) at: vec2<f32>, @location(1) uv: vec2<f32>, @location(2) color: vec4<f32>) -> Corner {
    return Corner(vec4<f32>(at.x * 2.0 - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0), uv, color);
}

@fragment
fn shaded(in: Corner) -> @location(0) vec4<f32> {
    return in.color * textureSample(glyphs, between, in.uv);
}
