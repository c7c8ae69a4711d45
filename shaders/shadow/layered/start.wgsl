// Depth pass of the papers, which finds the first extinction on each light ray. The march of the build passes that
// point before it needs it, so this pass runs only with `--no-skip`.

#import umbravox::light::{light, light_ray, depth_end_mm}
#import umbravox::tiles::tile_texel
#import umbravox::march::march
#import umbravox::sink::Sink

// Depth of the first extinction, mm, tile by tile.
@group(2) @binding(1) var<storage, read_write> starts_mm: array<f32>;

@compute @workgroup_size(#{WORKGROUP_SIDE}, #{WORKGROUP_SIDE})
fn find_starts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let here = tile_texel(group, groups, local);
    if !here.inside { return; }
    let ray = light_ray(vec2<f32>(here.texel));
    var sink = Sink(depth_end_mm());
    march(&sink, ray.o, ray.d, light.depth_start_mm, depth_end_mm());
    starts_mm[here.index] = sink.start_mm;
}
