// Gradient opacity: a factor on the extinction by the gradient magnitude of the value. Only with GRADIENT_OPACITY.
//
// The gradient is that of the trilinear value inside a cell, with float32 weights, in world space. It jumps at the faces
// of cells.
#define_import_path umbravox::gradient_opacity

#import umbravox::field::{field, Cell, cell_values, trilinear, FAR}

#ifdef GRADIENT_OPACITY
struct GradientOpacity {
    // Gradient in world space, value units per mm, of texel values that rise by 1 per cell along each axis of the grid.
    world_x: vec3<f32>,
    // Factor at gradient magnitude 0.
    first_factor: f32,
    world_y: vec3<f32>,
    // Number of vectors of segments in use.
    vectors: u32,
    world_z: vec3<f32>,
    // Segments between the points, four in a vector: gradient magnitude at the start, length, and slope of the factor.
    // Unused segments have slope 0.
    starts: array<vec4<f32>, #{GRADIENT_VECTORS}>,
    lengths: array<vec4<f32>, #{GRADIENT_VECTORS}>,
    slopes: array<vec4<f32>, #{GRADIENT_VECTORS}>,
}

@group(0) @binding(#{GRADIENT_BINDING}) var<uniform> gradient_opacity: GradientOpacity;

// Distance past a face of a cell at which the next face is searched, in voxels.
const PAST_CELL: f32 = 1e-3;
// Two-point Gauss quadrature over both halves of a part, on [0, 1].
const HALVES_GAUSS: vec4<f32> = vec4<f32>(0.10566243, 0.39433757, 0.60566243, 0.89433757);

// Returns the change of the factors over four segments, at four gradient magnitudes.
fn segment_changes(i: u32, magnitudes: vec4<f32>) -> vec4<f32> {
    let starts = gradient_opacity.starts[i];
    let lengths = gradient_opacity.lengths[i];
    let slopes = gradient_opacity.slopes[i];
    return slopes.x * clamp(magnitudes - starts.x, vec4<f32>(0.0), vec4<f32>(lengths.x))
        + slopes.y * clamp(magnitudes - starts.y, vec4<f32>(0.0), vec4<f32>(lengths.y))
        + slopes.z * clamp(magnitudes - starts.z, vec4<f32>(0.0), vec4<f32>(lengths.z))
        + slopes.w * clamp(magnitudes - starts.w, vec4<f32>(0.0), vec4<f32>(lengths.w));
}

// Returns the factors on the extinction at four gradient magnitudes.
fn factors_of(magnitudes: vec4<f32>) -> vec4<f32> {
    var factors = gradient_opacity.first_factor + segment_changes(0u, magnitudes);
    // No loop: software adapters limit the iterations of all loops together.
    if gradient_opacity.vectors > 1u {
        factors += segment_changes(1u, magnitudes);
        if gradient_opacity.vectors > 2u { factors += segment_changes(2u, magnitudes) + segment_changes(3u, magnitudes); }
    }
    return clamp(factors, vec4<f32>(0.0), vec4<f32>(1.0));
}

// Returns the factors on the extinction at four points of a cell, in cell coordinates in [0, 1]. `sense` is -1 along axes
// of the grid that are mirrored.
fn gradient_factors(cell: Cell, x: vec4<f32>, y: vec4<f32>, z: vec4<f32>, sense: vec3<f32>) -> vec4<f32> {
    let cx = cell.lo.y - cell.lo.x;
    let cy = cell.lo.z - cell.lo.x;
    let cz = cell.hi.x - cell.lo.x;
    let cxy = (cell.lo.w - cell.lo.z) - cx;
    let cxz = (cell.hi.y - cell.hi.x) - cx;
    let cyz = (cell.hi.z - cell.hi.x) - cy;
    let cxyz = ((cell.hi.w - cell.hi.z) - (cell.hi.y - cell.hi.x)) - cxy;
    let gx = sense.x * (cx + y * (cxy + z * cxyz) + z * cxz);
    let gy = sense.y * (cy + x * (cxy + z * cxyz) + z * cyz);
    let gz = sense.z * (cz + x * (cxz + y * cxyz) + y * cyz);
    let world = gradient_opacity;
    let wx = world.world_x.x * gx + world.world_y.x * gy + world.world_z.x * gz;
    let wy = world.world_x.y * gx + world.world_y.y * gy + world.world_z.y * gz;
    let wz = world.world_x.z * gx + world.world_y.z * gy + world.world_z.z * gz;
    return factors_of(sqrt(wx * wx + wy * wy + wz * wz));
}

// Returns the factor on the extinction at a grid-space point inside the domain.
fn gradient_factor_at(g: vec3<f32>) -> f32 {
    let base = floor(g);
    let f = g - base;
    let cell = cell_values(vec3<i32>(base));
    return gradient_factors(cell, vec4<f32>(f.x), vec4<f32>(f.y), vec4<f32>(f.z), vec3<f32>(1.0)).x;
}

// Part of a ray in one cell.
struct CellPart {
    // Depth at which the part ends, mm.
    end: f32,
    // Values at the start, in the middle and at the end, without the shift of a label.
    values: vec3<f32>,
    // Mean factors on the extinction in the first and the second half; 0 where no value has extinction.
    factors: vec2<f32>,
}

// Returns the part of the ray o + t d (grid space, d per mm) in the cell that begins at depth `from`, up to depth `to`.
fn next_cell_part(o: vec3<f32>, d: vec3<f32>, inv_d: vec3<f32>, from_mm: f32, to_mm: f32) -> CellPart {
    let g = o + from_mm * d;
    let faces = select(ceil(g - PAST_CELL) - 1.0, floor(g + PAST_CELL) + 1.0, d > vec3<f32>(0.0));
    let exits = select(vec3<f32>(FAR), from_mm + (faces - g) * inv_d, abs(d) >= vec3<f32>(1e-20));
    let end = max(min(min(exits.x, exits.y), min(exits.z, to_mm)), from_mm);
    let corner = floor(o + 0.5 * (from_mm + end) * d);
    let cell = cell_values(vec3<i32>(corner));
    let start = clamp(g - corner, vec3<f32>(0.0), vec3<f32>(1.0));
    let chord = clamp(o + end * d - corner, vec3<f32>(0.0), vec3<f32>(1.0)) - start;
    let values = vec3<f32>(
        trilinear(cell, start),
        trilinear(cell, start + 0.5 * chord),
        trilinear(cell, start + chord),
    );
    let x = start.x + HALVES_GAUSS * chord.x;
    let y = start.y + HALVES_GAUSS * chord.y;
    let z = start.z + HALVES_GAUSS * chord.z;
    let factors = gradient_factors(cell, x, y, z, vec3<f32>(1.0));
    // Bins of the tables at the first and the last value have extinction everywhere.
    let least = min(values.xy, values.yz);
    let greatest = max(values.xy, values.yz);
    let visible = (least < vec2<f32>(field.last_value)) & (greatest > vec2<f32>(field.first_value));
    return CellPart(end, values, select(vec2<f32>(0.0), 0.5 * (factors.xz + factors.yw), visible));
}

// Returns a limit on the number of cells that a ray crosses over a length, mm.
fn most_cell_parts(d: vec3<f32>, length_mm: f32) -> u32 {
    return u32(clamp(dot(abs(d), vec3<f32>(length_mm)), 0.0, 1e4)) + 8u;
}
#endif
