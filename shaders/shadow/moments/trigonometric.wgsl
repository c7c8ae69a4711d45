// Bounds of the share of a distribution on the unit circle that lies in front of a depth, from its trigonometric
// moments (Muenstermann et al. 2018); the counterpart of `power.wgsl`.
//
// Depths lie at angles from 0 to `params.largest_angle`; no matter lies between that and the full circle. A point
// that is found there counts as in front by how near it is to the full circle. Complex numbers are vectors of real
// and imaginary part.
#define_import_path umbravox::moment_share

#import umbravox::moments::params
#import umbravox::real_roots::real_roots

const LEAST_NORM: f32 = #{LEAST_NORM};
const FULL: f32 = 6.28318530717959;

// Unit lower triangle of the Toeplitz matrix of the moments, and the inverse norms of p_1 to p_4; the norm of p_0 is
// 1.
struct Basis {
    b_a: vec2<f32>,
    c_a: vec2<f32>,
    c_b: vec2<f32>,
    d_a: vec2<f32>,
    d_b: vec2<f32>,
    d_c: vec2<f32>,
    e_a: vec2<f32>,
    e_b: vec2<f32>,
    e_c: vec2<f32>,
    e_d: vec2<f32>,
    inverse_norms: vec4<f32>,
}

// Orthogonal polynomials p_1 to p_4 at a point of the unit circle.
struct Polynomials {
    first: vec2<f32>,
    second: vec2<f32>,
    third: vec2<f32>,
    fourth: vec2<f32>,
}

fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

fn conjugate(a: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x, -a.y);
}

fn times_conjugate(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return times(a, conjugate(b));
}

fn basis_of(c1: vec2<f32>, c2: vec2<f32>, c3: vec2<f32>, c4: vec2<f32>) -> Basis {
    let d1 = max(1.0 - dot(c1, c1), LEAST_NORM);
    let l21 = (c1 - times_conjugate(c2, c1)) / d1;
    let d2 = max(1.0 - dot(c2, c2) - dot(l21, l21) * d1, LEAST_NORM);
    var basis: Basis;
    basis.b_a = c1;
    basis.c_a = c2;
    basis.c_b = l21;
    basis.inverse_norms = vec4<f32>(1.0 / d1, 1.0 / d2, 0.0, 0.0);
#ifndef DEGREE_2
    let l31 = (c2 - times_conjugate(c3, c1)) / d1;
    let l32 = (c1 - times_conjugate(c3, c2) - times_conjugate(l31, l21) * d1) / d2;
    let d3 = max(1.0 - dot(c3, c3) - dot(l31, l31) * d1 - dot(l32, l32) * d2, LEAST_NORM);
    basis.d_a = c3;
    basis.d_b = l31;
    basis.d_c = l32;
    basis.inverse_norms.z = 1.0 / d3;
#ifndef DEGREE_3
    let l41 = (c3 - times_conjugate(c4, c1)) / d1;
    let l42 = (c2 - times_conjugate(c4, c2) - times_conjugate(l41, l21) * d1) / d2;
    let l43 = (c1 - times_conjugate(c4, c3) - times_conjugate(l41, l31) * d1 - times_conjugate(l42, l32) * d2) / d3;
    let d4 = 1.0 - dot(c4, c4) - dot(l41, l41) * d1 - dot(l42, l42) * d2 - dot(l43, l43) * d3;
    basis.e_a = c4;
    basis.e_b = l41;
    basis.e_c = l42;
    basis.e_d = l43;
    basis.inverse_norms.w = 1.0 / max(d4, LEAST_NORM);
#endif
#endif
    return basis;
}

fn polynomials(basis: Basis, z: vec2<f32>) -> Polynomials {
    let z2 = times(z, z);
    var p: Polynomials;
    p.first = z - basis.b_a;
    p.second = z2 - basis.c_a - times(basis.c_b, p.first);
#ifndef DEGREE_2
    p.third = times(z2, z) - basis.d_a - times(basis.d_b, p.first) - times(basis.d_c, p.second);
#ifndef DEGREE_3
    p.fourth = times(z2, z2) - basis.e_a - times(basis.e_b, p.first) - times(basis.e_c, p.second) - times(basis.e_d, p.third);
#endif
#endif
    return p;
}

fn kernel_of(basis: Basis, p: Polynomials) -> f32 {
    let squares = vec4<f32>(dot(p.first, p.first), dot(p.second, p.second), dot(p.third, p.third), dot(p.fourth, p.fourth));
    return 1.0 + dot(squares, basis.inverse_norms);
}

// Returns the weight of the point of a root, and the part of that weight that lies in front of the depth.
fn weight_of(basis: Basis, z: vec2<f32>, angle: f32, t: f32) -> vec2<f32> {
    let point = vec2<f32>(t * t - 1.0, 2.0 * t) / (t * t + 1.0);
    let weight = 1.0 / kernel_of(basis, polynomials(basis, times(z, point)));
    let reached = angle + 2.0 * atan2(1.0, t);
    return vec2<f32>(weight, weight * clamp((reached - params.largest_angle) / (FULL - params.largest_angle), 0.0, 1.0));
}

fn share_before(first: vec4<f32>, second: vec4<f32>, third: vec4<f32>, depth_share: f32) -> f32 {
    let scale = (1.0 - params.bias) / first.x;
    let basis = basis_of(
        first.yz * scale,
        vec2<f32>(first.w, second.x) * scale,
        second.yz * scale,
        vec2<f32>(second.w, third.x) * scale,
    );
    let angle = params.largest_angle * depth_share;
    let z = vec2<f32>(cos(angle), sin(angle));
    let p = polynomials(basis, z);
    let here = kernel_of(basis, p);
    // Coefficients of K(z, .), each times that power of z.
    let norms = basis.inverse_norms;
    let z2 = times(z, z);
    let c4 = conjugate(p.fourth) * norms.w;
    let c3 = conjugate(p.third) * norms.z - times(basis.e_d, c4);
    let c2 = conjugate(p.second) * norms.y - times(basis.d_c, c3) - times(basis.e_c, c4);
    let c1 = conjugate(p.first) * norms.x - times(basis.c_b, c2) - times(basis.d_b, c3) - times(basis.e_b, c4);
    let g0 = vec2<f32>(1.0, 0.0) - times(basis.b_a, c1) - times(basis.c_a, c2) - times(basis.d_a, c3)
        - times(basis.e_a, c4);
    let g1 = times(c1, z);
    let g2 = times(c2, z2);
    let g3 = times(c3, times(z2, z));
    let g4 = times(c4, times(z2, z2));
    // With z (t + i) / (t - i) for the point of the circle, t the cotangent of half the angle from z on, K (t - i)^n
    // is real and its leading coefficient K(z, z): sums of (t + i)^k (t - i)^(n - k) times g_k.
#ifdef DEGREE_2
    let q = vec4<f32>(2.0 * g0.y - 2.0 * g2.y, g1.x - g0.x - g2.x, 0.0, 0.0);
#else
#ifdef DEGREE_3
    let q = vec4<f32>(
        3.0 * g0.y + g1.y - g2.y - 3.0 * g3.y,
        g1.x + g2.x - 3.0 * g0.x - 3.0 * g3.x,
        g1.y + g3.y - g0.y - g2.y,
        0.0,
    );
#else
    let q = vec4<f32>(
        4.0 * g0.y + 2.0 * g1.y - 2.0 * g3.y - 4.0 * g4.y,
        2.0 * g2.x - 6.0 * g0.x - 6.0 * g4.x,
        2.0 * g1.y - 4.0 * g0.y - 2.0 * g3.y + 4.0 * g4.y,
        g0.x - g1.x + g2.x - g3.x + g4.x,
    );
#endif
#endif
    let roots = real_roots(q / here);
    var weights = weight_of(basis, z, angle, roots.x) + weight_of(basis, z, angle, roots.y);
#ifndef DEGREE_2
    weights += weight_of(basis, z, angle, roots.z);
#ifndef DEGREE_3
    weights += weight_of(basis, z, angle, roots.w);
#endif
#endif
    return clamp((weights.y + params.beta / here) / (weights.x + 1.0 / here), 0.0, 1.0);
}
