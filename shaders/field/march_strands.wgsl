// Light march through strands: pieces of the rays of texels that the host has cut and sorted
// (src/field/strand_lines.rs).
//
// It offers the same function as `shaders/field/march.wgsl` under the same contract for the sink, for whole rays
// through the centres of texels, from the light or towards it. It has no error bound: the bound of a march refers to
// the scalar field.
#define_import_path umbravox::march

#import umbravox::light::{light, light_point, light_ray}
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::sink::{Sink, sink_piece}
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_work, PIECES}

// Index of the first piece of each texel's record, and the end of all pieces; then the pieces: two depths (mm) and an
// optical depth each.
@group(2) @binding(#{LINES_BINDING}) var<storage, read> strand_pieces: array<u32>;
const PIECE_WORDS: u32 = 3u;

// Passes the pieces of the texel whose ray is o + z d (grid space, d per mm) to the sink, over the depths [z_from,
// z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    // All rays pass through the position of a point light; the farther end lies on this ray alone.
    let z = select(z_to, z_from, abs(z_from) > abs(z_to));
    let nearest = vec2<i32>(round(light_point(o + z * d).texel));
    let texel = vec2<u32>(clamp(nearest, vec2<i32>(0), vec2<i32>(i32(light.map_size) - 1)));
    let towards_light = dot(d, light_ray(vec2<f32>(texel)).d) < 0.0;
    let record = record_of(texel);
    let known = select(record, 0u, record == NO_TILE);
    let first = strand_pieces[known];
    let count = select((strand_pieces[known + 1u] - first) / PIECE_WORDS, 0u, record == NO_TILE);
    var done = count == 0u;
    var i = 0u;
    loop {
        if !done {
            let at = first + PIECE_WORDS * select(i, count - 1u - i, towards_light);
            let a = bitcast<f32>(strand_pieces[at]);
            let b = bitcast<f32>(strand_pieces[at + 1u]);
            let ends = select(vec2<f32>(a, b), vec2<f32>(-b, -a), towards_light);
            let over = sink_piece(sink, ends.x, ends.y, bitcast<f32>(strand_pieces[at + 2u]));
            count_work(PIECES, 1u);
            i += 1u;
            done = over || i >= count;
        }
        if done { break; }
    }
    if !done { report_iteration_limit(); }
}
