// `halfangle`: carries the light from one slice to the next, one thread for each texel of the light buffer. It adds the optical
// depth between the two slices to that in front of the first one.

#import umbravox::light::{light, light_ray}
#import umbravox::work::{add_divergence, add_work}
#import umbravox::tiles::tile_texel
#import umbravox::tile_table::record_of
#import umbravox::section::{section, section_coordinate}
#import umbravox::march::march
#import umbravox::sink::{start_sink, ENOUGH_DEPTH}

@group(1) @binding(3) var<storage, read> in_front: array<f32>;
@group(2) @binding(1) var<storage, read_write> behind: array<f32>;

@compute @workgroup_size(#{WORKGROUP_SIDE}, #{WORKGROUP_SIDE})
fn carry_light(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let here = tile_texel(group, groups, local);
    if !here.inside { return; }
    let record = record_of(here.texel);
    let ray = light_ray(vec2<f32>(here.texel));
    let slices = (vec2<f32>(section.start, section.end) - section_coordinate(ray.o)) / dot(section.plane.xyz, ray.d);
    var sink = start_sink();
    // The buffer is undefined in front of the first slice.
    let depth = select(in_front[record], 0.0, section.is_first == 1u);
    if depth <= ENOUGH_DEPTH {
        march(&sink, ray.o, ray.d, slices.x, slices.y);
    }
    behind[record] = depth + sink.optical_depth.total;
    add_divergence(here.texel, light.map_size);
    add_work();
}
