// Sink that adds up the optical mass of one ray by depth, in fixed point.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::layers::own

// Nobody looks inside a piece.
const FAR: f32 = #{FAR};
const MASS_BINS: u32 = #{SPLIT_BINS};
// A step of the fixed point, and the most that a ray may give to a bin: 2^32 is out of reach of 2^14 rays.
const MASS_STEPS: f32 = 32768.0;
const MOST_MASS: f32 = 7.9;

@group(2) @binding(0) var<storage, read_write> mass: array<atomic<u32>, #{SPLIT_BINS}>;

struct Sink {
    // The bin that is being filled, and its optical depth so far.
    bin: u32,
    depth: f32,
}

fn longest_depth(sink: ptr<function, Sink>) -> f32 {
    return FAR;
}

fn store_bin(bin: u32, depth: f32) {
    // Rounded up: the planes begin at the first bin with mass, and thin matter in front of it would cast no shadow.
    if depth > 0.0 { atomicAdd(&mass[bin], u32(ceil(min(depth, MOST_MASS) * MASS_STEPS))); }
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    let per_mm = f32(MASS_BINS) / light.depth_range_mm;
    let begin = (z_from - light.depth_start_mm) * per_mm;
    let end = max((z_to - light.depth_start_mm) * per_mm, begin + 1e-6);
    // A piece gives every bin that it crosses its share.
    let last = u32(clamp(end, 0.0, f32(MASS_BINS - 1u)));
    var bin = u32(clamp(begin, 0.0, f32(MASS_BINS - 1u)));
    loop {
        if bin != (*sink).bin {
            store_bin((*sink).bin, (*sink).depth);
            (*sink).bin = bin;
            (*sink).depth = 0.0;
        }
        let share = (min(end, f32(bin + 1u)) - max(begin, f32(bin))) / (end - begin);
        (*sink).depth += depth * clamp(share, 0.0, 1.0);
        bin += 1u;
        if bin > last { break; }
    }
    return false;
}
