// `sat`: query of the transmittance from a point to the light, by cuboids of a summed-area table of extinction.
//
// The cone from the point to the light is cut into stretches along the axis of the grid closest to its direction. They
// end at faces of cells, and each is thicker than the one before. The cuboid of a stretch contains the cone there, and
// its mean extinction times the length of the stretch is the optical depth.
#define_import_path umbravox::method

#import umbravox::light::{light, toward_light}
#import umbravox::sat_table::{table, turned, turned_counts, turned_strides}
#import umbravox::work::{count_work, LOADS}

// Numbers of steps, each summed over all cells up to the cell, modulo 2^32.
@group(1) @binding(2) var<storage, read> sums: array<u32>;

// Half the side of a square with the area of a disc, in radii of the disc: sqrt(pi) / 2.
const SQUARE_OF_DISC: f32 = 0.8862269;

// Table with its axes turned, and the cells of a cuboid along the last axis: [bottom, top).
struct Slab {
    counts: vec3<i32>,
    strides: vec3<u32>,
    bottom: i32,
    top: i32,
}

// Returns the sum over the cells before the corner (u, v, w); corners outside the table move to its faces.
fn sum_before(slab: Slab, u: i32, v: i32, w: i32) -> u32 {
    let corner = clamp(vec3<i32>(u, v, w), vec3<i32>(0), slab.counts);
    let cell = vec3<u32>(max(corner - 1, vec3<i32>(0))) * slab.strides;
    let sum = sums[min(cell.x + cell.y + cell.z, arrayLength(&sums) - 1u)];
    return select(0u, sum, all(corner > vec3<i32>(0)));
}

// Returns the sum over the cells of the slab before the corner (u, v).
fn slab_sum(slab: Slab, u: i32, v: i32) -> u32 {
    return sum_before(slab, u, v, slab.top) - sum_before(slab, u, v, slab.bottom);
}

#ifdef BILINEAR
// Returns the sums before row v of three intervals between the corners u.
fn row_sums(slab: Slab, u: vec4<i32>, v: i32) -> vec3<u32> {
    let before = vec4<u32>(slab_sum(slab, u.x, v), slab_sum(slab, u.y, v), slab_sum(slab, u.z, v), slab_sum(slab, u.w, v));
    return before.yzw - before.xyz;
}

// Returns the sum over a cuboid of the slab whose sides, at least one cell apart, may lie inside cells. Cells that it
// covers in part count in part.
fn cuboid_sum(slab: Slab, centre: vec2<f32>, half_width: vec2<f32>) -> f32 {
    count_work(LOADS, 32u);
    let low = centre - half_width;
    let high = centre + half_width;
    let low_cell = floor(low);
    let high_cell = max(floor(high), low_cell + 1.0);
    let covered_low = clamp(low_cell + 1.0 - low, vec2<f32>(0.0), vec2<f32>(1.0));
    let covered_high = clamp(high - high_cell, vec2<f32>(0.0), vec2<f32>(1.0));
    let low_corner = vec2<i32>(low_cell);
    let high_corner = vec2<i32>(high_cell);
    let u = vec4<i32>(low_corner.x, low_corner.x + 1, high_corner.x, high_corner.x + 1);
    let v = vec4<i32>(low_corner.y, low_corner.y + 1, high_corner.y, high_corner.y + 1);
    let weights_u = vec3<f32>(covered_low.x, 1.0, covered_high.x);
    // Differences are exact although the sums wrap around. Each covers at most `most_cells` cells.
    let rows_a = row_sums(slab, u, v.x);
    let rows_b = row_sums(slab, u, v.y);
    let rows_c = row_sums(slab, u, v.z);
    let rows_d = row_sums(slab, u, v.w);
    return covered_low.y * dot(weights_u, vec3<f32>(rows_b - rows_a))
        + dot(weights_u, vec3<f32>(rows_c - rows_b))
        + covered_high.y * dot(weights_u, vec3<f32>(rows_d - rows_c));
}
#else
// Returns the sum over the cuboid of whole cells next to a cuboid of the slab, and scales it to the volume of the latter.
fn cuboid_sum(slab: Slab, centre: vec2<f32>, half_width: vec2<f32>) -> f32 {
    count_work(LOADS, 8u);
    let width = max(floor(2.0 * half_width), vec2<f32>(1.0));
    let low = vec2<i32>(floor(centre - 0.5 * width + 0.5));
    let high = low + vec2<i32>(width);
    let low_rows = slab_sum(slab, high.x, low.y) - slab_sum(slab, low.x, low.y);
    let high_rows = slab_sum(slab, high.x, high.y) - slab_sum(slab, low.x, high.y);
    let area = 4.0 * half_width.x * half_width.y;
    return f32(high_rows - low_rows) * (area / (width.x * width.y));
}
#endif

// Cone from a point to the light in coordinates of cells, with its main axis in the last place.
struct Cone {
    axis: u32,
    // The point, and the direction in cells per mm.
    p: vec3<f32>,
    d: vec3<f32>,
    // Number of cells along the main axis, and coordinate of the point along it in the sense towards the light.
    cells: f32,
    rise: f32,
    // Cells per mm along the main axis.
    speed: f32,
    // Half the width of the cone across the main axis in cells, per mm from its apex.
    widening: vec2<f32>,
}

fn cone_to_light(p: vec3<f32>, direction: vec3<f32>, distance_mm: f32) -> Cone {
    let size = abs(direction);
    let largest = max(size.x, max(size.y, size.z));
    let axis = select(select(2u, 1u, size.y == largest), 0u, size.x == largest);
    let d = turned(direction, axis);
    let q = turned(p, axis);
    let cells = f32(turned_counts(axis).z);
    let rise = select(cells - q.z, q.z, d.z > 0.0);
    // Grid units per mm of each axis, in the light frame. A circle about the ray meets planes across the main axis in an
    // ellipse.
    let a = turned(light.grid_per_a, axis);
    let b = turned(light.grid_per_b, axis);
    let h = turned(light.grid_per_h, axis);
    let slope = d.xy / select(d.z, 1.0, d.z == 0.0);
    let across_u = vec3<f32>(a.x, b.x, h.x) - slope.x * vec3<f32>(a.z, b.z, h.z);
    let across_v = vec3<f32>(a.y, b.y, h.y) - slope.y * vec3<f32>(a.z, b.z, h.z);
    // The apex lies `near_mm` before the query.
    let radius_per_mm = table.half_tangent + table.light_radius_mm / max(distance_mm + light.near_mm, 1e-6);
    let widening = SQUARE_OF_DISC * radius_per_mm / table.scale * vec2<f32>(length(across_u), length(across_v));
    return Cone(axis, q, d, cells, rise, max(size.x, max(size.y, max(size.z, 1e-20))), widening);
}

// Returns half the widths of a cuboid across the main axis. Sums of more than `most_cells` cells of the table could exceed
// 32 bits: such a cuboid is cut on its sides.
fn cut_half_width(half_width: vec2<f32>, counts: vec3<i32>, thickness: f32) -> vec2<f32> {
    let inside = min(2.0 * half_width, vec2<f32>(counts.xy));
    let most = table.most_cells / thickness;
    let even = max(inside * sqrt(most / (inside.x * inside.y)), vec2<f32>(1.0));
    // A side of one cell leaves all the cut to the other.
    let cut = max(min(even, most / even.yx), vec2<f32>(1.0));
    return select(half_width, 0.5 * cut, vec2<bool>(inside.x * inside.y > most));
}

// Returns the optical depth of the cone between two coordinates along its main axis, in the sense towards the light.
fn stretch_depth(cone: Cone, start: f32, end: f32) -> f32 {
    let near_mm = (start - cone.rise) / cone.speed;
    let length_mm = (end - start) / cone.speed;
    let middle_mm = near_mm + 0.5 * length_mm;
    let first = floor(start);
    let last = max(ceil(end), first + 1.0);
    // The cuboid contains the cone, and is at least one cell wide.
    var half_width = max(0.5 * length_mm * abs(cone.d.xy) + (middle_mm + light.near_mm) * cone.widening, vec2<f32>(0.5));
    let counts = vec3<i32>(turned_counts(cone.axis));
    half_width = cut_half_width(half_width, counts, last - first);
    let up = cone.d.z > 0.0;
    let bottom = select(cone.cells - last, first, up);
    let top = select(cone.cells - first, last, up);
    let slab = Slab(counts, turned_strides(cone.axis), i32(bottom), i32(top));
    let sum = cuboid_sum(slab, cone.p.xy + middle_mm * cone.d.xy, half_width);
    let mean = sum * table.extinction_step / (4.0 * half_width.x * half_width.y * (last - first));
    return mean * length_mm;
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let to_light = toward_light(g);
    let cone = cone_to_light((g - table.first) / table.scale, to_light.d / table.scale, to_light.mm);
    // No extinction lies outside the table. The cone ends at the light.
    var start = max(cone.rise, 0.0);
    let end = min(cone.cells, cone.rise + to_light.mm * cone.speed);
    let first_face = floor(start);
    var thickness = 1.0;
    var reach = 0.0;
    var depth = 0.0;
    var boxes_left = table.boxes;
    var done = start >= end;
    loop {
        boxes_left -= 1u;
        reach += thickness;
        thickness *= table.growth;
        let face = select(first_face + floor(reach + 0.5), cone.cells, boxes_left == 0u);
        let until = clamp(face, start, max(end, start));
        if !done { depth += stretch_depth(cone, start, until); }
        start = until;
        done = start >= end;
        if done || boxes_left == 0u { break; }
    }
    return exp(-depth);
}
