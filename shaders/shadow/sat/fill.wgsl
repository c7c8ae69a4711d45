// Stores the mean extinction of each cell of a summed-area table, in whole steps: one thread for each cell.

#import umbravox::field::{field, brick_distance_at, interpolated_value, BRICK_SHIFT}
#import umbravox::gradient_opacity::gradient_factor_at
#import umbravox::labels::{label_shift, shifted_value}
#import umbravox::sat_table::table
#import umbravox::transfer::extinction_at
#import umbravox::work::add_work

// Layers of cells that this dispatch fills.
@group(2) @binding(0) var<storage, read> layers: array<u32>;
@group(2) @binding(1) var<storage, read_write> sums: array<u32>;

// Irrational steps along the axes, powers of the inverse of x in x^4 = x + 1: the fractional parts of their sums are
// spread evenly along each axis and in each box.
const SPREAD: vec3<f32> = vec3<f32>(0.8191725, 0.6710436, 0.5497005);

// Returns whether the field has values at a grid-space point: in the domain, and not clipped.
fn has_values(g: vec3<f32>) -> bool {
    var inside = all(g >= vec3<f32>(0.5)) && all(g <= vec3<f32>(field.size) + 0.5);
#ifdef CLIP
    for (var i = 0u; i < #{MOST_CLIP_PLANES}; i++) {
        let plane = field.clip[i];
        inside = inside && dot(plane.xyz, g) >= plane.w;
    }
#endif
    return inside;
}

fn extinction_of_point(g: vec3<f32>) -> f32 {
    let extinction = extinction_at(shifted_value(interpolated_value(g), label_shift(g)));
#ifdef GRADIENT_OPACITY
    return extinction * gradient_factor_at(g);
#else
    return extinction;
#endif
}

// Returns the sum of extinction over regular samples of a cell.
fn sampled_extinction(corner: vec3<f32>) -> f32 {
    let n = table.samples;
    let spacing = table.scale / f32(n);
    var sum = 0.0;
    for (var i = 0u; i < n * n * n; i++) {
        let g = corner + (vec3<f32>(vec3<u32>(i % n, i / n % n, i / (n * n))) + 0.5) * spacing;
        if has_values(g) { sum += extinction_of_point(g); }
    }
    return sum;
}

@compute @workgroup_size(#{LINE_THREADS})
fn fill(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let cells = table.counts.x * table.counts.y;
    let groups_per_layer = (cells + #{LINE_THREADS} - 1u) / #{LINE_THREADS};
    let item = group.y * groups.x + group.x;
    let place = item / groups_per_layer;
    let cell = (item % groups_per_layer) * #{LINE_THREADS} + local;
    if place >= arrayLength(&layers) || cell >= cells { return; }
    let layer = layers[place];
    let position = vec3<f32>(vec3<u32>(cell % table.counts.x, cell / table.counts.x, layer));
    let corner = table.first + position * table.scale;
    // Half a cell is at most a brick wide. If the bricks around the one of the centre are empty, the cell is.
    let centre = vec3<i32>(floor(corner + 0.5 * table.scale));
    let brick = clamp(centre, vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
    var steps = 0.0;
    if brick_distance_at(brick) < 2 {
        let samples = f32(table.samples * table.samples * table.samples);
        steps = sampled_extinction(corner) / (samples * table.extinction_step);
    }
    // The threshold varies from cell to cell, so that rounding does not change the mean of many cells.
    let rounded = floor(steps + fract(dot(position, SPREAD)));
    sums[min(layer * cells + cell, arrayLength(&sums) - 1u)] = u32(min(rounded, table.most_steps));
    add_work();
}
