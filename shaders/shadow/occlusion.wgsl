// Ambient occlusion: mean transmittance of rays from a point, in given directions and of one length.
#define_import_path umbravox::method

#import umbravox::march::march
#import umbravox::sink::start_sink

// Directions, grid units per mm (xyz), and the length of the rays, mm (w).
@group(1) @binding(1) var<storage, read> directions: array<vec4<f32>>;

// Returns the mean transmittance of the rays from a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let count = arrayLength(&directions);
    var sum = 0.0;
    var i = 0u;
    loop {
        let direction = directions[min(i, count - 1u)];
        var sink = start_sink();
        march(&sink, g, direction.xyz, 0.0, direction.w);
        sum += exp(-sink.optical_depth.total);
        i += 1u;
        if i >= count { break; }
    }
    return sum / f32(count);
}
