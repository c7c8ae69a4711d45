// Builds a layered shadow map: one thread for each texel.

#import umbravox::light::{light, light_ray, depth_end_mm}
#import umbravox::work::{add_divergence, add_work}
#import umbravox::tiles::tile_texel
#import umbravox::tile_table::record_of
#import umbravox::layers::params
#import umbravox::march::march
#import umbravox::sink::{Sink, start_writer, find_end, met_extinction, finish}
#ifdef RAY_STATES
#import umbravox::ray_state::{select_ray, has_state, go_to_word, put_word, take_word, MARCH_WORDS}
#import umbravox::sink::{save_sink, load_sink}
#endif

struct Stage {
    // Number of texels whose ray meets extinction.
    texels_hit: atomic<u32>,
    // Side of a region in texels, number of regions along each side of the map, and the table row with the layer
    // split of each region.
    region_texels: u32,
    regions_across: u32,
    rows: array<u32>,
}

@group(2) @binding(2) var<storage, read_write> stage: Stage;

@compute @workgroup_size(#{WORKGROUP_SIDE}, #{WORKGROUP_SIDE})
fn build(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let here = tile_texel(group, groups, local);
    if !here.inside { return; }
    let record = record_of(here.texel);
    var first_march = 0u;
#ifdef RAY_STATES
    if !select_ray(record) { return; }
#endif
    var row = 0u;
#ifdef SPLIT_ROWS
    let region = min(here.texel / stage.region_texels, vec2<u32>(stage.regions_across - 1u));
    row = stage.rows[region.y * stage.regions_across + region.x];
#endif
    start_writer(record, row);
    let ray = light_ray(vec2<f32>(here.texel));
    let z_end = depth_end_mm();
    var sink = Sink(0.0, params.longest_depth);
#ifdef RAY_STATES
    if has_state() {
        go_to_word(MARCH_WORDS);
        first_march = take_word();
        load_sink(&sink);
        go_to_word(0u);
    }
#endif
#ifdef ENDS
    // One march towards the light finds the end depth, and one from the light fills the layers. The loop keeps the
    // code of the march in the program once.
    for (var number = first_march; number < 2u; number++) {
        let behind = number == 0u;
        find_end(behind);
        let first = select(light.depth_start_mm, -z_end, behind);
        let to = select(z_end, -light.depth_start_mm, behind);
        march(&sink, ray.o, select(ray.d, -ray.d, behind), first, to);
#ifdef RAY_STATES
        if has_state() {
            put_word(number);
            save_sink(&sink);
            add_work();
            return;
        }
#endif
        if !met_extinction() { break; }
    }
#else
    march(&sink, ray.o, ray.d, light.depth_start_mm, z_end);
#ifdef RAY_STATES
    if has_state() {
        put_word(0u);
        save_sink(&sink);
        add_work();
        return;
    }
#endif
#endif
    finish(sink.optical_depth);
    if met_extinction() { atomicAdd(&stage.texels_hit, 1u); }
    add_divergence(here.texel, light.map_size);
    add_work();
}
