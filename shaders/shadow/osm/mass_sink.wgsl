// Sink that adds the optical mass of one ray, or with WEIGH_LIGHT the light that it loses, to depth bins in fixed
// point.
#define_import_path umbravox::sink

#import umbravox::light::light
#ifdef WEIGH_LIGHT
#import umbravox::layers::params
#endif

const MASS_BINS: u32 = #{SPLIT_BINS};
// Number of fixed-point steps of a mass of 1, and the largest mass of a ray in a bin: the sum of 2^14 rays stays
// below 2^32.
const MASS_STEPS: f32 = 32768.0;
const MAX_MASS: f32 = 7.9;

@group(2) @binding(0) var<storage, read_write> mass: array<atomic<u32>, #{SPLIT_BINS}>;

struct Sink {
    // Present depth bin, and its mass so far.
    bin: u32,
    depth: f32,
    // Optical depth of the ray so far.
    optical_depth: f32,
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    // The sink has no limit on the optical depth of a piece: it divides each piece among bins by length.
    return 1e30;
}

fn store_bin(bin: u32, depth: f32) {
    // Rounded up: planes begin at the first bin with mass, and thin matter before it would otherwise cast no shadow.
    if depth > 0.0 { atomicAdd(&mass[bin], u32(ceil(min(depth, MAX_MASS) * MASS_STEPS))); }
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let per_mm = f32(MASS_BINS) / light.depth_range_mm;
    let begin = (z_from - light.depth_start_mm) * per_mm;
    let end = (z_to - light.depth_start_mm) * per_mm;
    let first = u32(clamp(begin, 0.0, f32(MASS_BINS - 1u)));
    let last = max(u32(clamp(end, 0.0, f32(MASS_BINS - 1u))), first);
    for (var bin = first; bin <= last; bin++) {
        if bin != (*sink).bin {
            store_bin((*sink).bin, (*sink).depth);
            (*sink).bin = bin;
            (*sink).depth = 0.0;
        }
        let share = (min(end, f32(bin + 1u)) - max(begin, f32(bin))) / max(end - begin, 1e-12);
        // The length of a piece inside one bin may be below the resolution of float32.
        let rise = min(depth, 1e30) * select(clamp(share, 0.0, 1.0), 1.0, first == last);
#ifdef WEIGH_LIGHT
        // The largest mass of a bin is the light of a whole ray.
        let lost = select(1.0 - exp(-rise), rise, rise < 1e-3);
        (*sink).depth += MAX_MASS * exp(-(*sink).optical_depth) * lost;
#else
        (*sink).depth += rise;
#endif
        (*sink).optical_depth += rise;
    }
#ifdef WEIGH_LIGHT
    return (*sink).optical_depth > params.max_depth;
#else
    return false;
#endif
}
