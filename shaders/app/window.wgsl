// Shows a finished picture in the window: much less for a software adapter to do than the widgets' own shader.

override target_is_srgb: bool = false;

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var between: sampler;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
}

// One triangle that covers the view.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let uv = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return Corner(vec4<f32>(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0, 0.0, 1.0), uv);
}

@fragment
fn shown(in: Corner) -> @location(0) vec4<f32> {
    let srgb = textureSample(picture, between, in.uv).rgb;
    if target_is_srgb {
        // IEC 61966-2-1; the target encodes again.
        let high = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
        return vec4<f32>(select(high, srgb / 12.92, srgb <= vec3<f32>(0.04045)), 1.0);
    }
    return vec4<f32>(srgb, 1.0);
}
