// Loops that reach their bound, which follows from sizes: the host reads how many did, and refuses what they made.
#define_import_path umbravox::watch

@group(0) @binding(7) var<storage, read_write> overruns: atomic<u32>;

// A loop has reached its bound: what it makes is not to be used.
fn ran_out() {
    atomicAdd(&overruns, 1u);
}
