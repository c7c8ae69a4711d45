// Choice of the ratio of the hybrid split among eleven (Voicu 2011, 5.2.3 and 7), by how the opacity changes between
// layers. A coarse map with many layers approximates the exact curves.
//
// An image in Voicu 2011 is the opacity 1 - T of every texel at one plane.

#import umbravox::light::light
#import umbravox::tile_table::record_of
#import umbravox::layers_read::{Extent, extent_of, layer_point, optical_depth_at}

const RATIOS: u32 = #{RATIOS};

// Planes 1 to K of every ratio, as fractions of the depth extent.
@group(2) @binding(0) var<storage, read> planes: array<f32>;

// Returns the opacity of a texel's record at a plane of the final map.
fn opacity(record: u32, extent: Extent, plane: f32) -> f32 {
    return 1.0 - exp(-optical_depth_at(record, layer_point(extent.row, 0.0, 1.0, plane)));
}

#ifdef PER_REGION
struct Stage {
    texels_hit: atomic<u32>,
    region_texels: u32,
    regions_across: u32,
    rows: array<u32>,
}

@group(2) @binding(1) var<storage, read_write> stage: Stage;

// Chooses the ratio of a region whose largest step of opacity between neighbouring planes is smallest. Inside a layer
// both the exact and the stored curve lie between their values at its ends, so this step bounds their difference.
@compute @workgroup_size(8, 8)
fn choose(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2<u32>(light.map_size)) { return; }
    let record = record_of(id.xy);
    let extent = extent_of(record);
    let layers = arrayLength(&planes) / RATIOS;
    // The middle ratio is used if the ray of the region meets no extinction.
    var best = RATIOS / 2u;
    var best_step = 2.0;
    var ratio = 0u;
    var k = 0u;
    var before = 0.0;
    var step = 0.0;
    for (var i = 0u; i < RATIOS * layers; i++) {
        if !extent.filled { break; }
        let here = opacity(record, extent, planes[ratio * layers + k]);
        step = max(step, here - before);
        before = here;
        k += 1u;
        if k == layers {
            if step < best_step {
                best_step = step;
                best = ratio;
            }
            ratio += 1u;
            k = 0u;
            before = 0.0;
            step = 0.0;
        }
    }
    stage.rows[id.y * light.map_size + id.x] = best;
}
#else
// Sums over the texels of the images k and k + 1 of a ratio: image k, its square, the product of both, and the
// absolute difference of both in 8 bits.
@group(2) @binding(1) var<storage, read_write> sums: array<vec4<f32>>;

const THREADS: u32 = 256u;
var<workgroup> subtotals: array<vec4<f32>, 256>;

@compute @workgroup_size(256)
fn compare(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let layers = arrayLength(&planes) / RATIOS;
    let at = group.y * layers + group.x;
    let plane = planes[at];
    let next = planes[min(at + 1u, (group.y + 1u) * layers - 1u)];
    var sum = vec4<f32>(0.0);
    for (var i = local.x; i < light.map_size * light.map_size; i += THREADS) {
        let record = record_of(vec2<u32>(i % light.map_size, i / light.map_size));
        let extent = extent_of(record);
        if extent.filled {
            let a = opacity(record, extent, plane);
            let b = opacity(record, extent, next);
            sum += vec4<f32>(a, a * a, a * b, (round(255.0 * b) - round(255.0 * a)) / 255.0);
        }
    }
    subtotals[local.x] = sum;
    workgroupBarrier();
    for (var stride = THREADS / 2u; stride > 0u; stride /= 2u) {
        if local.x < stride { subtotals[local.x] += subtotals[local.x + stride]; }
        workgroupBarrier();
    }
    if local.x == 0u { sums[at] = subtotals[0]; }
}
#endif
