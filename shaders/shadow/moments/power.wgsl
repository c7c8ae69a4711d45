// What share of a distribution on [-1, 1] lies in front of a depth, as far as its power moments say (Muenstermann et al.
// 2018, 4; Tari et al. 2005).
//
// Among all distributions with these moments the one with matter at the depth itself and at as few others as possible says
// least and most: its weights in front of the depth are the least share, and with that at the depth the greatest. Its other
// places are the roots of the kernel polynomial K(x0, x) = sum of p_k(x0) p_k(x) / D_k, p_k being the monic orthogonal
// polynomials of the moments and D_k their norms; a place's weight is 1 / K(x, x).
#define_import_path umbravox::moment_share

#import umbravox::vectors::own
#import umbravox::real_roots::{quadratic_roots, cubic_roots, quartic_roots}

const MOMENTS: u32 = #{MOMENTS};
// Roots, and degree of the last orthogonal polynomial.
const DEGREE: u32 = #{DEGREE};
// Norms below this are rounding.
const LEAST_NORM: f32 = #{LEAST_NORM};
// A place further away than this has no weight.
const FARTHEST: f32 = 1e3;

// Entries of the unit lower triangle of the moments' Hankel matrix, row by row, and the norms.
var<private> lower: array<f32, 25>;
var<private> norms: array<f32, 5>;
var<private> at: array<f32, 5>;

fn factor(b: array<f32, #{MOMENTS} + 1>) {
    var moments = b;
    for (var j = 0u; j <= DEGREE; j++) {
        for (var i = j; i <= DEGREE; i++) {
            var left = moments[i + j];
            for (var k = 0u; k < j; k++) { left -= lower[5u * i + k] * lower[5u * j + k] * norms[k]; }
            if i == j { norms[j] = max(left, LEAST_NORM); }
            lower[5u * i + j] = left / norms[j];
        }
    }
}

// The orthogonal polynomials at x, in `at`; returns K(x, x).
fn kernel_at(x: f32) -> f32 {
    var power = 1.0;
    var sum = 0.0;
    for (var i = 0u; i <= DEGREE; i++) {
        var p = power;
        for (var k = 0u; k < i; k++) { p -= lower[5u * i + k] * at[k]; }
        at[i] = p;
        sum += p * p / norms[i];
        power *= x;
    }
    return sum;
}

fn root_vector(q: array<f32, 5>) -> vec4<f32> {
    // An unused root is a place without weight.
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

// The share in front of a depth share, `own.a.x` of the way from the least to the greatest. `sums`: optical depth and the
// moments times it.
fn share_before(sums: array<f32, #{MOMENTS} + 1>, depth_share: f32) -> f32 {
    var b = sums;
    let scale = 1.0 / b[0];
    var wide = array<f32, 8>(0.0, own.b.x, 0.0, own.b.y, 0.0, own.b.z, 0.0, own.b.w);
    for (var k = 1u; k <= MOMENTS; k++) { b[k] = mix(b[k] * scale, wide[k - 1u], own.a.y); }
    b[0] = 1.0;
    factor(b);
    let x = 2.0 * depth_share - 1.0;
    let here = kernel_at(x);
    // K(x, .) by powers.
    var c = array<f32, 5>();
    for (var n = 0u; n <= DEGREE; n++) {
        let i = DEGREE - n;
        c[i] = at[i] / norms[i];
        for (var j = i + 1u; j <= DEGREE; j++) { c[i] -= lower[5u * j + i] * c[j]; }
    }
    // By powers of y = (its argument) - x, and then of 1 / y: the roots are finite, since none lies at x, and the leading
    // coefficient is K(x, x), which is largest.
    for (var n = 0u; n < DEGREE; n++) {
        for (var i = DEGREE; i > n; i--) { c[i - 1u] += x * c[i]; }
    }
    var q = array<f32, 5>();
    for (var i = 0u; i < DEGREE; i++) { q[i] = c[DEGREE - i] / here; }
    var roots = root_vector(q);
    var before = own.a.x / here;
    var all = 1.0 / here;
    for (var i = 0u; i < DEGREE; i++) {
        let t = roots[i];
        if abs(t) * FARTHEST > 1.0 {
            let weight = 1.0 / kernel_at(x + 1.0 / t);
            all += weight;
            before += select(0.0, weight, t < 0.0);
        }
    }
    return clamp(before / all, 0.0, 1.0);
}
