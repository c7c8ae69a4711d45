// The light march through what strands do to the rays of texels: pieces that the host has cut and sorted
// (src/field/strand_lines.rs), texel by texel.
//
// It offers what `shaders/field/march.wgsl` does, with the same contract for the sink, for whole rays through the centres of
// texels, from the light or from behind; it promises nothing: what is behind the promise of a march is the field.
#define_import_path umbravox::march

#import umbravox::light::{light, light_point, light_ray}
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::sink::{Sink, sink_piece}
#import umbravox::watch::ran_out
#import umbravox::work::{count_work, PIECES}

// Of each record the place of its first piece, and behind the last one the place behind all; then the pieces, each two depths
// (mm) and an optical depth.
@group(2) @binding(#{LINES_BINDING}) var<storage, read> line_words: array<u32>;
// Words of a piece.
const PIECE_WORDS: u32 = 3u;

// Hands on the pieces of the texel whose ray o + z d is (grid space, d per mm) over the depths [z_from, z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    // A light's own place is on the rays of all texels: the farther end is on this one's alone.
    let z = select(z_to, z_from, abs(z_from) > abs(z_to));
    let near = vec2<i32>(round(light_point(o + z * d).texel));
    let texel = vec2<u32>(clamp(near, vec2<i32>(0), vec2<i32>(i32(light.map_size) - 1)));
    let from_behind = dot(d, light_ray(vec2<f32>(texel)).d) < 0.0;
    let record = record_of(texel);
    let known = select(record, 0u, record == NO_TILE);
    let first = line_words[known];
    let count = select((line_words[known + 1u] - first) / PIECE_WORDS, 0u, record == NO_TILE);
    var done = count == 0u;
    var i = 0u;
    loop {
        if !done {
            let at = first + PIECE_WORDS * select(i, count - 1u - i, from_behind);
            let a = bitcast<f32>(line_words[at]);
            let b = bitcast<f32>(line_words[at + 1u]);
            let ends = select(vec2<f32>(a, b), vec2<f32>(-b, -a), from_behind);
            let over = sink_piece(sink, ends.x, ends.y, bitcast<f32>(line_words[at + 2u]));
            count_work(PIECES, 1u);
            i += 1u;
            done = over || i >= count;
        }
        if done { break; }
    }
    // Some adapters end loops that they find long, and say nothing.
    if !done { ran_out(); }
}
