// Choices that depend on the type of the adapter; src/gpu/tuning.rs lists them and says why.
#define_import_path umbravox::tuning

// Number of steps after which lanes that have hit extinction do not wait for the other lanes of their subgroup.
const STEPS_TOGETHER: u32 = #{STEPS_TOGETHER};
// Side of a workgroup in passes over shadow-map tiles, in texels.
const WORKGROUP_SIDE: u32 = #{WORKGROUP_SIDE};

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
