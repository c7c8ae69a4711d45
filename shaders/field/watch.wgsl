// Loops that reach their iteration limit, which follows from sizes: the host rejects results of passes with such
// loops.
//
// Software adapters end long loops without an error, so that callers also report loops that ended early.
#define_import_path umbravox::watch

struct Watched {
    loops_at_limit: atomic<u32>,
    // Work counters of umbravox::work, low and high word of each.
    work: array<atomic<u32>, #{WORK_WORDS}>,
    // Number of march steps of the longest ray in each block of 8 x 4 threads.
    longest: array<atomic<u32>, #{MAX_BLOCKS}>,
}

@group(0) @binding(7) var<storage, read_write> watched: Watched;

// Reports a loop that ended before its end condition: the host must not use the result.
fn report_iteration_limit() {
    atomicAdd(&watched.loops_at_limit, 1u);
}
