// Bounds of the share of a distribution on [-1, 1] that lies in front of a depth, from its power moments
// (Muenstermann et al. 2018; Tari et al. 2005).
//
// The canonical distribution with these moments has matter at the depth itself and at as few other points as
// possible. Its weight in front of the depth is the least share, and with the weight at the depth the greatest. Its
// other points are the roots of the kernel polynomial K(x0, x) = sum of p_k(x0) p_k(x) / D_k, p_k being the monic
// orthogonal polynomials of the moments and D_k their norms. The weight of a point is 1 / K(x, x).
//
// There are no loops: software adapters limit the iterations of all loops of a ray together.
#define_import_path umbravox::moment_share

#import umbravox::moments::params
#import umbravox::real_roots::real_roots

// Norms of orthogonal polynomials below this are rounding errors.
const LEAST_NORM: f32 = #{LEAST_NORM};
// Distance beyond which a point of the canonical distribution has no weight.
const FARTHEST: f32 = 1e3;

// Unit lower triangle of the Hankel matrix of the moments, row by row from the second, and the inverse norms of p_1
// to p_4; the norm of p_0 is 1.
struct Basis {
    row_b: f32,
    row_c: vec2<f32>,
    row_d: vec3<f32>,
    row_e: vec4<f32>,
    inverse_norms: vec4<f32>,
}

fn inverse_norm(norm: f32) -> f32 {
    return 1.0 / max(norm, LEAST_NORM);
}

// Returns the basis of the moments b_1 to b_4 and b_5 to b_8; moments beyond the last are 0.
fn basis_of(b: vec4<f32>, more: vec4<f32>) -> Basis {
    let d1 = max(b.y - b.x * b.x, LEAST_NORM);
    let l21 = (b.z - b.y * b.x) / d1;
    let l31 = (b.w - b.z * b.x) / d1;
    let d2 = max(b.w - b.y * b.y - l21 * l21 * d1, LEAST_NORM);
#ifdef DEGREE_2
    return Basis(b.x, vec2<f32>(b.y, l21), vec3<f32>(0.0), vec4<f32>(0.0), vec4<f32>(1.0 / d1, 1.0 / d2, 0.0, 0.0));
#else
    let l32 = (more.x - b.z * b.y - l31 * l21 * d1) / d2;
    let d3 = max(more.y - b.z * b.z - l31 * l31 * d1 - l32 * l32 * d2, LEAST_NORM);
    let third = vec3<f32>(b.z, l31, l32);
#ifdef DEGREE_3
    let norms = vec4<f32>(1.0 / d1, 1.0 / d2, 1.0 / d3, 0.0);
    return Basis(b.x, vec2<f32>(b.y, l21), third, vec4<f32>(0.0), norms);
#else
    let l41 = (more.x - b.w * b.x) / d1;
    let l42 = (more.y - b.w * b.y - l41 * l21 * d1) / d2;
    let l43 = (more.z - b.w * b.z - l41 * l31 * d1 - l42 * l32 * d2) / d3;
    let d4 = more.w - b.w * b.w - l41 * l41 * d1 - l42 * l42 * d2 - l43 * l43 * d3;
    let norms = vec4<f32>(1.0 / d1, 1.0 / d2, 1.0 / d3, inverse_norm(d4));
    return Basis(b.x, vec2<f32>(b.y, l21), third, vec4<f32>(b.w, l41, l42, l43), norms);
#endif
#endif
}

// Returns the orthogonal polynomials p_1 to p_4 at x.
fn polynomials(basis: Basis, x: f32) -> vec4<f32> {
    let p1 = x - basis.row_b;
    let p2 = x * x - basis.row_c.x - basis.row_c.y * p1;
    let p3 = x * x * x - basis.row_d.x - basis.row_d.y * p1 - basis.row_d.z * p2;
    let p4 = x * x * x * x - basis.row_e.x - basis.row_e.y * p1 - basis.row_e.z * p2 - basis.row_e.w * p3;
    return vec4<f32>(p1, p2, p3, p4);
}

fn kernel_of(basis: Basis, p: vec4<f32>) -> f32 {
    return 1.0 + dot(p * p, basis.inverse_norms);
}

// Returns the weight of the point of a root, and that weight again if the point lies in front of the depth, else 0.
fn weight_of(basis: Basis, x: f32, t: f32) -> vec2<f32> {
    let counts = abs(t) * FARTHEST > 1.0;
    let point = x + 1.0 / select(1.0, t, counts);
    let weight = select(0.0, 1.0 / kernel_of(basis, polynomials(basis, point)), counts);
    return vec2<f32>(weight, select(0.0, weight, t < 0.0));
}

// Returns the fraction of the optical depth that lies in front of a depth, `params.beta` of the way from the least to
// the greatest. The vectors hold the optical depth and the moments times it.
fn share_before(first: vec4<f32>, second: vec4<f32>, third: vec4<f32>, depth_share: f32) -> f32 {
    let scale = 1.0 / first.x;
    let wide = vec4<f32>(0.0, params.biased_moments.x, 0.0, params.biased_moments.y);
    let wider = vec4<f32>(0.0, params.biased_moments.z, 0.0, params.biased_moments.w);
    let b = mix(vec4<f32>(first.yzw, second.x) * scale, wide, params.bias);
    let more = mix(vec4<f32>(second.yzw, third.x) * scale, wider, params.bias);
    let basis = basis_of(b, more);
    let x = 2.0 * depth_share - 1.0;
    let p = polynomials(basis, x);
    let here = kernel_of(basis, p);
    // Coefficients of K(x, .), from the first power on.
    let h = p * basis.inverse_norms;
    let c4 = h.w;
    let c3 = h.z - basis.row_e.w * c4;
    let c2 = h.y - basis.row_d.z * c3 - basis.row_e.z * c4;
    let c1 = h.x - basis.row_c.y * c2 - basis.row_d.y * c3 - basis.row_e.y * c4;
    // Coefficients in y = (argument) - x, and then in t = 1 / y: the roots are finite, since none lies at x, and the
    // leading coefficient K(x, x) is the largest.
    let shifted = vec4<f32>(
        c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * 4.0 * c4)),
        c2 + x * (3.0 * c3 + x * 6.0 * c4),
        c3 + x * 4.0 * c4,
        c4,
    );
    let roots = real_roots(shifted / here);
    var weights = weight_of(basis, x, roots.x) + weight_of(basis, x, roots.y);
#ifndef DEGREE_2
    weights += weight_of(basis, x, roots.z);
#ifndef DEGREE_3
    weights += weight_of(basis, x, roots.w);
#endif
#endif
    return clamp((weights.y + params.beta / here) / (weights.x + 1.0 / here), 0.0, 1.0);
}
