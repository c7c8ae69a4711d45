// Work that is counted and not timed, in variants with COUNT_WORK: what no adapter changes. Without it nothing of this is
// in the shader.
#define_import_path umbravox::work

#import umbravox::watch::watched

// Kinds of work, in the order of `Work` in src/gpu/watch.rs.
// Samples of the volume by its filter.
const SAMPLES: u32 = 0u;
// Questions for the light at a point.
const LOOKUPS: u32 = 1u;
// Texture reads of all kinds.
const LOADS: u32 = 2u;
// Cells that are marched through.
const CELLS: u32 = 3u;
// Pieces of light rays whose optical depth is integrated.
const PIECES: u32 = 4u;
const KINDS: u32 = #{WORK_KINDS};

#ifdef COUNT_WORK
// Of this invocation.
var<private> counted: array<u32, #{WORK_KINDS}>;
#endif

fn count_work(kind: u32, times: u32) {
#ifdef COUNT_WORK
    counted[kind] += times;
#endif
}

// Adds what this invocation has done to the sums, two words each.
fn add_work() {
#ifdef COUNT_WORK
    for (var kind = 0u; kind < KINDS; kind++) {
        let before = atomicAdd(&watched.work[2u * kind], counted[kind]);
        if before + counted[kind] < before { atomicAdd(&watched.work[2u * kind + 1u], 1u); }
    }
#endif
}
