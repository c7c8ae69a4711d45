// Roots of a polynomial of degree two, three or four that has real roots only.
#define_import_path umbravox::real_roots

// Number of steps of Laguerre's method, which converges from any start on such polynomials, in the end cubically.
const LAGUERRE_STEPS: i32 = 7;

fn quadratic_roots(b: f32, c: f32) -> vec2<f32> {
    let root = sqrt(max(0.25 * b * b - c, 0.0));
    // The larger root without cancellation, the other by their product.
    let larger = -0.5 * b - select(-root, root, b >= 0.0);
    return vec2<f32>(larger, select(c / larger, 0.0, larger == 0.0));
}

fn cubic_roots(a: f32, b: f32, c: f32) -> vec3<f32> {
    let q = max((a * a - 3.0 * b) / 9.0, 0.0);
    let r = (2.0 * a * a * a - 9.0 * a * b + 27.0 * c) / 54.0;
    let length = sqrt(q);
    let angle = acos(clamp(r / max(q * length, 1e-30), -1.0, 1.0)) / 3.0;
    let third = 2.09439510239320;
    return -2.0 * length * vec3<f32>(cos(angle), cos(angle + third), cos(angle - third)) - a / 3.0;
}

fn quartic_roots(a: f32, b: f32, c: f32, d: f32) -> vec4<f32> {
    var t = -0.25 * a;
    for (var i = 0; i < LAGUERRE_STEPS; i++) {
        let value = (((t + a) * t + b) * t + c) * t + d;
        let slope = ((4.0 * t + 3.0 * a) * t + 2.0 * b) * t + c;
        let bend = (12.0 * t + 6.0 * a) * t + 2.0 * b;
        let root = sqrt(max(9.0 * slope * slope - 12.0 * value * bend, 0.0));
        let below = slope + select(-root, root, slope >= 0.0);
        t -= select(4.0 * value / below, 0.0, below == 0.0);
    }
    // Division by that root leaves a cubic.
    let p = a + t;
    let q = b + t * p;
    return vec4<f32>(cubic_roots(p, q, c + t * q), t);
}

// Longest accepted Newton step, relative to the root and 1: longer steps come from double roots.
const LONGEST_STEP: f32 = 0.1;

// Refines each root by one step of Newton's method. Closed forms have the absolute accuracy of the largest root, and
// other roots may be far smaller.
fn refined(roots: vec4<f32>, c: array<f32, 5>) -> vec4<f32> {
    let value = (((c[4] * roots + c[3]) * roots + c[2]) * roots + c[1]) * roots + c[0];
    let slope = ((4.0 * c[4] * roots + 3.0 * c[3]) * roots + 2.0 * c[2]) * roots + c[1];
    let step = value / select(slope, vec4<f32>(1.0), slope == vec4<f32>(0.0));
    return roots - select(vec4<f32>(0.0), step, abs(step) < LONGEST_STEP * (1.0 + abs(roots)));
}

// Returns the n roots of t^n + c.x t^(n-1) + c.y t^(n-2) + ..., followed by zeros.
fn real_roots(c: vec4<f32>) -> vec4<f32> {
#ifdef DEGREE_2
    return vec4<f32>(quadratic_roots(c.x, c.y), 0.0, 0.0);
#else
#ifdef DEGREE_3
    let all = array<f32, 5>(c.z, c.y, c.x, 1.0, 0.0);
    let roots = vec4<f32>(cubic_roots(c.x, c.y, c.z), 0.0);
#else
    let all = array<f32, 5>(c.w, c.z, c.y, c.x, 1.0);
    let roots = quartic_roots(c.x, c.y, c.z, c.w);
#endif
    return refined(refined(roots, all), all);
#endif
}
