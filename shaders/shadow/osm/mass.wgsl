// Computes the optical mass of the volume by depth, over rays spread over the map, for `slicing=density` and
// `slicing=lit`.

#import umbravox::light::{light, light_ray, depth_end_mm}
#import umbravox::work::add_work
#import umbravox::march::march
#import umbravox::sink::{Sink, store_bin}

// Number of rays along each side of the map; each represents a block of texels.
const MASS_RAYS: u32 = #{MASS_RAYS};

@compute @workgroup_size(8, 8)
fn weigh(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2<u32>(MASS_RAYS)) { return; }
    let texel = (vec2<f32>(id.xy) + 0.5) * (f32(light.map_size) / f32(MASS_RAYS)) - 0.5;
    let ray = light_ray(texel);
    var sink = Sink(0u, 0.0, 0.0);
    march(&sink, ray.o, ray.d, light.depth_start_mm, depth_end_mm());
    store_bin(sink.bin, sink.depth);
    add_work();
}
