// Loops that reach their bound, which follows from sizes: the host reads how many did, and refuses what they made.
#define_import_path umbravox::watch

struct Watched {
    overruns: atomic<u32>,
    // Sums of umbravox::work, low and high word of each.
    work: array<atomic<u32>, #{WORK_WORDS}>,
}

@group(0) @binding(7) var<storage, read_write> watched: Watched;

// A loop has reached its bound: what it makes is not to be used.
fn ran_out() {
    atomicAdd(&watched.overruns, 1u);
}
