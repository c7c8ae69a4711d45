// Choices that depend on the type of the adapter; src/gpu/tuning.rs lists them and says why.
#define_import_path umbravox::tuning

// Number of steps after which lanes that have hit extinction do not wait for the other lanes of their subgroup: of rays by
// samples, such as eye rays, and of light rays by cells.
const EYE_STEPS_TOGETHER: u32 = #{EYE_STEPS_TOGETHER};
const LIGHT_STEPS_TOGETHER: u32 = #{LIGHT_STEPS_TOGETHER};
// Side of a workgroup in passes over shadow-map tiles, in texels.
const WORKGROUP_SIDE: u32 = #{WORKGROUP_SIDE};

// Whether samples of the volume have filter weights of 8 bits.
#ifdef MANUAL_TRILINEAR
const COARSE_FILTER: bool = false;
#else
#ifdef COARSE_WEIGHTS
const COARSE_FILTER: bool = true;
#else
const COARSE_FILTER: bool = false;
#endif
#endif

#ifdef CARD_ARITHMETIC
// Returns the point at which a texture filter with weights of 8 bits interpolates instead of g.
fn filter_point(g: vec3<f32>) -> vec3<f32> {
    return floor(g * 256.0 + 0.5) * (1.0 / 256.0);
}

// Returns the quotient of a depth and the step of a march, with an error that WGSL permits (2.5 units in the last place).
fn quotient(x: f32, y: f32) -> f32 {
    return x / y * (1.0 - 1.2e-7);
}
#else
fn filter_point(g: vec3<f32>) -> vec3<f32> {
    return g;
}

fn quotient(x: f32, y: f32) -> f32 {
    return x / y;
}
#endif

#ifdef SPREAD_WORKGROUPS
// Returns the work item of workgroup i of n. llvmpipe gives its threads contiguous ranges of workgroups, and
// neighbours cost alike. This order spreads each of up to 16 ranges over all of the work: it takes every second item
// first, and each half in the same way, four times.
fn workgroup_item(i: u32, n: u32) -> u32 {
    var at = i;
    var left = n;
    var first = 0u;
    var stride = 1u;
    for (var halving = 0; halving < 4; halving++) {
        let even = (left + 1u) / 2u;
        let odd = at >= even;
        at -= select(0u, even, odd);
        left = select(even, left - even, odd);
        first += select(0u, stride, odd);
        stride *= 2u;
    }
    return first + at * stride;
}
#else
// Returns the work item of workgroup i of n.
fn workgroup_item(i: u32, n: u32) -> u32 {
    return i;
}
#endif
