// Work counters, compiled in only with COUNT_WORK. Their results do not depend on the adapter.
#define_import_path umbravox::work

#import umbravox::watch::watched

// Kinds of work, in the order of `Work` in src/gpu/counters.rs. The first counts filtered samples of the volume.
const SAMPLES: u32 = 0u;
// Queries for the transmittance from the light at a point.
const LOOKUPS: u32 = 1u;
// Texture reads of all kinds.
const LOADS: u32 = 2u;
// Cells that light rays march through.
const CELLS: u32 = 3u;
// Pieces of light rays whose optical depth is integrated.
const PIECES: u32 = 4u;
// Steps of ray marches in counted blocks, see `add_divergence`.
const STEPS: u32 = 5u;
const KINDS: u32 = #{WORK_KINDS};

#ifdef COUNT_WORK
var<private> counts: array<u32, #{WORK_KINDS}>;
var<private> march_steps: u32;
#endif

fn count_work(kind: u32, times: u32) {
#ifdef COUNT_WORK
    counts[kind] += times;
#endif
}

// Counts a step of a ray march.
fn count_step() {
#ifdef COUNT_WORK
    march_steps += 1u;
#endif
}

// Adds the march steps of this invocation to those of its block of 8 x 4 threads, on a grid of threads of a given
// width; called before `add_work`. A subgroup of a card with 32 lanes processes such a block together.
fn add_divergence(at: vec2<u32>, width: u32) {
#ifdef COUNT_WORK
    let block = (at.y >> 2u) * ((width + 7u) >> 3u) + (at.x >> 3u);
    if block < #{MAX_BLOCKS} {
        counts[STEPS] += march_steps;
        atomicMax(&watched.longest[block], march_steps);
    }
#endif
}

// Adds the work counters of this invocation to the sums, two words each.
fn add_work() {
#ifdef COUNT_WORK
    for (var kind = 0u; kind < KINDS; kind++) {
        let before = atomicAdd(&watched.work[2u * kind], counts[kind]);
        if before + counts[kind] < before { atomicAdd(&watched.work[2u * kind + 1u], 1u); }
    }
#endif
}
