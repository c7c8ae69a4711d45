// March along the prism of a texel: all light rays whose nearest texel it is. The prism is cut into slabs of equal
// length, and the box around each gives the range of extinction on all these rays. The least extinction (UPPER) gives an
// upper bound on their transmittance, the largest a lower bound.
#define_import_path umbravox::prism

#import umbravox::field::{field, brick_distance_at, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::light::light_ray
#import umbravox::ranges::{enclosing, extinction_range}
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_step, count_work, PIECES}

// Largest number of pieces of a slab; the ray ends before it has as many.
const MAX_SLAB_PIECES: u32 = 1024u;

// Returns half the size, in grid units, of the box around the rays of a texel at a depth. Between two depths, the half
// sizes are at most those on the line between their values. `margin_mm` is added on all sides.
fn half_size(texel: vec2<f32>, z: f32, margin_mm: f32) -> vec3<f32> {
    let axis = light_ray(texel);
    var half = vec3<f32>(0.0);
    for (var corner = 0u; corner < 4u; corner++) {
        let side = vec2<f32>(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
        let ray = light_ray(texel + enclosing.half_texels * side);
        half = max(half, abs(ray.o - axis.o + z * (ray.d - axis.d)));
    }
    return half + margin_mm * enclosing.grid_per_mm;
}

// Returns the number of slabs from a point on the axis on in which the prism meets no active brick.
fn empty_slabs(g: vec3<f32>, d: vec3<f32>) -> u32 {
    let brick = vec3<i32>(floor(g)) >> BRICK_SHIFT;
    let last = vec3<i32>(field.size) >> BRICK_SHIFT;
    let distance = brick_distance_at(clamp(brick, vec3<i32>(0), last)) - enclosing.brick_margin;
    let moves = abs(d) >= vec3<f32>(1e-20);
    let face = select(brick - (distance - 1), brick + distance, d > vec3<f32>(0.0)) * BRICK_CELLS;
    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - g) / select(vec3<f32>(1.0), d, moves), moves);
    // Rounding must not count a slab that ends behind the exit.
    let exit_mm = min(exits.x, min(exits.y, exits.z)) - 1e-3 * field.min_spacing_mm;
    return select(0u, u32(clamp(exit_mm / enclosing.slab_mm, 0.0, 1e6)), distance > 0);
}

// Passes a slab with an optical depth to the sink, in pieces that are short enough for it; returns whether the ray ends.
fn take_slab(sink: ptr<function, Sink>, z: f32, depth: f32) -> bool {
    var taken = 0.0;
    var over = false;
    for (var i = 0u; i < MAX_SLAB_PIECES; i++) {
        if over || taken >= depth { break; }
        let from_mm = z + enclosing.slab_mm * (taken / depth);
        let next = min(taken + longest_depth(sink, from_mm, z + enclosing.slab_mm), depth);
        count_work(PIECES, 1u);
        over = sink_piece(sink, from_mm, z + enclosing.slab_mm * (next / depth), next - taken);
        taken = next;
    }
    return over;
}

// Marches along the prism of a texel over the depths [z_start, z_end].
fn march_prism(sink: ptr<function, Sink>, texel: vec2<f32>, z_start: f32, z_end: f32) {
    let axis = light_ray(texel);
    let start = half_size(texel, z_start, enclosing.margins_mm.x);
    let end = half_size(texel, z_end, enclosing.margins_mm.y);
    let slabs = u32(ceil((z_end - z_start) / enclosing.slab_mm));
    var k = 0u;
    var over = false;
    // One more iteration than slabs, to come to the end.
    for (var i = 0u; i <= slabs; i++) {
        if over || k >= slabs { break; }
        count_step();
        let z = z_start + f32(k) * enclosing.slab_mm;
        let g = axis.o + z * axis.d;
        let empty = empty_slabs(g, axis.d);
        k += max(empty, 1u);
        if empty == 0u {
            let along = enclosing.slab_mm * axis.d;
            let shares = (z - z_start + vec2<f32>(0.0, enclosing.slab_mm)) / (z_end - z_start);
            let half = max(mix(start, end, shares.x), mix(start, end, shares.y));
            let sigmas = extinction_range(min(g, g + along) - half, max(g, g + along) + half);
#ifdef UPPER
            let sigma = sigmas.x;
#else
            let sigma = sigmas.y;
#endif
            if sigma > 0.0 { over = take_slab(sink, z, sigma * enclosing.slab_mm); }
        }
    }
    // Adapters that limit the iterations of all loops together also end this one: ranges of the last slabs may be
    // incomplete then.
    var counted = 0u;
    for (var i = 0u; i < min(slabs, 2u); i++) { counted += 1u; }
    if counted < min(slabs, 2u) || (!over && k < slabs) { report_iteration_limit(); }
}
