// Cubic of the values along the chord of a cell: coefficients, roots and extrema.
#define_import_path umbravox::cubic

#import umbravox::field::Cell

// Largest number of steps of Newton's method. Each at least halves the interval: enough for every bit of a float32.
const ROOT_STEPS: i32 = 40;
// Allowed error of the value at a breakpoint, relative to the largest value of the stretch.
const ROOT_TOLERANCE: f32 = #{ROOT_TOLERANCE};

// c.x + u (c.y + u (c.z + u c.w))
fn cubic(c: vec4<f32>, u: f32) -> f32 {
    return c.x + u * (c.y + u * (c.z + u * c.w));
}

fn cubic_slope(c: vec4<f32>, u: f32) -> f32 {
    return c.y + u * (2.0 * c.z + 3.0 * u * c.w);
}

// Returns the coefficients of the cubic of values along the chord of a cell from f to f + e (cell coordinates in [0,
// 1]).
fn chord_cubic(cell: Cell, f: vec3<f32>, e: vec3<f32>) -> vec4<f32> {
    let c0 = cell.lo.x;
    let cx = cell.lo.y - cell.lo.x;
    let cy = cell.lo.z - cell.lo.x;
    let cz = cell.hi.x - cell.lo.x;
    let cxy = (cell.lo.w - cell.lo.z) - cx;
    let cxz = (cell.hi.y - cell.hi.x) - cx;
    let cyz = (cell.hi.z - cell.hi.x) - cy;
    let cxyz = ((cell.hi.w - cell.hi.z) - (cell.hi.y - cell.hi.x)) - cxy;
    return vec4<f32>(
        c0 + f.x * (cx + f.y * (cxy + f.z * cxyz) + f.z * cxz) + f.y * (cy + f.z * cyz) + f.z * cz,
        e.x * (cx + f.y * (cxy + f.z * cxyz) + f.z * cxz)
            + e.y * (cy + f.x * (cxy + f.z * cxyz) + f.z * cyz)
            + e.z * (cz + f.x * (cxz + f.y * cxyz) + f.y * cyz),
        e.x * e.y * (cxy + f.z * cxyz) + e.x * e.z * (cxz + f.y * cxyz) + e.y * e.z * (cyz + f.x * cxyz),
        e.x * e.y * e.z * cxyz,
    );
}

// Returns the parameter at which the cubic takes the value v. It is monotone from a to b, with the values va and vb
// there.
fn crossing(c: vec4<f32>, a: f32, b: f32, va: f32, vb: f32, v: f32) -> f32 {
    var lo = a;
    var hi = b;
    let rising = vb > va;
    var u = a + (b - a) * clamp((v - va) / (vb - va), 0.0, 1.0);
    let enough = ROOT_TOLERANCE * max(abs(va), abs(vb));
    for (var i = 0; i < ROOT_STEPS; i++) {
        let excess = cubic(c, u) - v;
        if abs(excess) <= enough { break; }
        if (excess > 0.0) == rising { hi = u; } else { lo = u; }
        let slope = cubic_slope(c, u);
        var next = u - excess / select(slope, 1.0, slope == 0.0);
        if !(next >= lo && next <= hi) { next = 0.5 * (lo + hi); }
        u = next;
    }
    return clamp(u, a, b);
}

// Returns the extrema of the cubic inside (0, 1), ascending; 2 for an extremum that does not exist.
fn extrema(c: vec4<f32>) -> vec2<f32> {
    let a = 3.0 * c.w;
    let b = c.z;
    let size = abs(c.y) + abs(c.z) + abs(c.w);
    var roots = vec2<f32>(2.0);
    if size == 0.0 { return roots; }
    let disc = b * b - a * c.y;
    if disc > 0.0 {
        let q = -(b + select(-1.0, 1.0, b >= 0.0) * sqrt(disc));
        if q != 0.0 { roots.x = c.y / q; }
        if abs(a) > 1e-7 * size { roots.y = q / a; }
    }
    roots = select(vec2<f32>(2.0), roots, (roots > vec2<f32>(0.0)) & (roots < vec2<f32>(1.0)));
    return vec2<f32>(min(roots.x, roots.y), max(roots.x, roots.y));
}
