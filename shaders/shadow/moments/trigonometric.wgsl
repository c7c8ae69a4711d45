// As `power.wgsl`, of a distribution on the unit circle by its trigonometric moments (Muenstermann et al. 2018, 4).
//
// Depths lie at angles from 0 to `own.a.z`; between that and the full circle no matter lies, and a place that is found
// there counts as in front by how near it is to the full circle. Complex numbers are vectors of real and imaginary part.
#define_import_path umbravox::moment_share

#import umbravox::vectors::own
#import umbravox::real_roots::{quadratic_roots, cubic_roots, quartic_roots}

const MOMENTS: u32 = #{MOMENTS};
const DEGREE: u32 = #{DEGREE};
const LEAST_NORM: f32 = #{LEAST_NORM};
const FULL: f32 = 6.28318530717959;

// Entries of the unit lower triangle of the moments' Toeplitz matrix, row by row, and the norms.
var<private> lower: array<vec2<f32>, 25>;
var<private> norms: array<f32, 5>;
var<private> at: array<vec2<f32>, 5>;

fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

fn conjugate(a: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x, -a.y);
}

// From c_0 = 1, c_1, ...
fn factor(c: array<vec2<f32>, 5>) {
    var moments = c;
    for (var j = 0u; j <= DEGREE; j++) {
        for (var i = j; i <= DEGREE; i++) {
            var left = moments[i - j];
            for (var k = 0u; k < j; k++) {
                left -= times(lower[5u * i + k], conjugate(lower[5u * j + k])) * norms[k];
            }
            if i == j { norms[j] = max(left.x, LEAST_NORM); }
            lower[5u * i + j] = left / norms[j];
        }
    }
}

// The orthogonal polynomials at a point of the circle, in `at`; returns K(z, z).
fn kernel_at(z: vec2<f32>) -> f32 {
    var power = vec2<f32>(1.0, 0.0);
    var sum = 0.0;
    for (var i = 0u; i <= DEGREE; i++) {
        var p = power;
        for (var k = 0u; k < i; k++) { p -= times(lower[5u * i + k], at[k]); }
        at[i] = p;
        sum += dot(p, p) / norms[i];
        power = times(power, z);
    }
    return sum;
}

fn root_vector(q: array<f32, 5>) -> vec4<f32> {
#ifdef DEGREE_2
    return vec4<f32>(quadratic_roots(q[1], q[0]), 0.0, 0.0);
#else
#ifdef DEGREE_3
    return vec4<f32>(cubic_roots(q[2], q[1], q[0]), 0.0);
#else
    return quartic_roots(q[3], q[2], q[1], q[0]);
#endif
#endif
}

fn share_before(sums: array<f32, #{MOMENTS} + 1>, depth_share: f32) -> f32 {
    var b = sums;
    let scale = (1.0 - own.a.y) / b[0];
    var c = array<vec2<f32>, 5>();
    c[0] = vec2<f32>(1.0, 0.0);
    for (var k = 1u; k <= DEGREE; k++) { c[k] = vec2<f32>(b[2u * k - 1u], b[2u * k]) * scale; }
    factor(c);
    let angle = own.a.z * depth_share;
    let z = vec2<f32>(cos(angle), sin(angle));
    let here = kernel_at(z);
    // K(z, .) by powers, each times that power of z.
    var g = array<vec2<f32>, 5>();
    for (var n = 0u; n <= DEGREE; n++) {
        let i = DEGREE - n;
        g[i] = conjugate(at[i]) / norms[i];
        for (var j = i + 1u; j <= DEGREE; j++) { g[i] -= times(lower[5u * j + i], g[j]); }
    }
    var power = vec2<f32>(1.0, 0.0);
    for (var i = 0u; i <= DEGREE; i++) {
        g[i] = times(g[i], power);
        power = times(power, z);
    }
    // With z (t + i) / (t - i) for the point of the circle, t the cotangent of half the angle from z on, K (t - i)^n is real
    // and its leading coefficient K(z, z): sums of (t + i)^k (t - i)^(n - k) times g_k.
    var q = array<f32, 5>();
#ifdef DEGREE_2
    q[1] = -(2.0 * g[2].y - 2.0 * g[0].y);
    q[0] = -(g[0].x - g[1].x + g[2].x);
#else
#ifdef DEGREE_3
    q[2] = -(-3.0 * g[0].y - g[1].y + g[2].y + 3.0 * g[3].y);
    q[1] = -(3.0 * g[0].x - g[1].x - g[2].x + 3.0 * g[3].x);
    q[0] = -g[0].y + g[1].y - g[2].y + g[3].y;
#else
    q[3] = -(-4.0 * g[0].y - 2.0 * g[1].y + 2.0 * g[3].y + 4.0 * g[4].y);
    q[2] = -(6.0 * g[0].x - 2.0 * g[2].x + 6.0 * g[4].x);
    q[1] = -4.0 * g[0].y + 2.0 * g[1].y - 2.0 * g[3].y + 4.0 * g[4].y;
    q[0] = g[0].x - g[1].x + g[2].x - g[3].x + g[4].x;
#endif
#endif
    for (var i = 0u; i < DEGREE; i++) { q[i] = q[i] / here; }
    var roots = root_vector(q);
    var before = own.a.x / here;
    var all = 1.0 / here;
    for (var i = 0u; i < DEGREE; i++) {
        let t = roots[i];
        let place = vec2<f32>(t * t - 1.0, 2.0 * t) / (t * t + 1.0);
        let weight = 1.0 / kernel_at(times(z, place));
        let reached = angle + 2.0 * atan2(1.0, t);
        let wrapped = clamp((reached - own.a.z) / (FULL - own.a.z), 0.0, 1.0);
        all += weight;
        before += weight * wrapped;
    }
    return clamp(before / all, 0.0, 1.0);
}
