// `rays:estimator=jackknife` and `unbiased`: transmittance from unbiased estimates of optical depth.
#define_import_path umbravox::method

#import umbravox::field::FAR
#import umbravox::random_rays::{params, ShadowRay, shadow_ray, extinction_on, brick_on, section_from, MAX_SECTIONS, random_state, random}
#import umbravox::watch::report_iteration_limit

#ifdef JACKKNIFE
// Returns an estimate of the optical depth of a ray: a random sample in each of equal strata.
fn stratified_depth(ray: ShadowRay, state: ptr<function, u32>) -> f32 {
    let width = (ray.end - ray.start) / f32(params.samples);
    var sum = 0.0;
    var i = 0u;
    loop {
        sum += extinction_on(ray, ray.start + (f32(i) + random(state)) * width);
        i += 1u;
        if i >= params.samples { break; }
    }
    if i < params.samples { report_iteration_limit(); }
    return sum * width;
}

// Returns an estimate of the transmittance from the light to a grid-space point: the minimum-variance unbiased estimate of
// exp(-depth) from two normally distributed estimates of the depth. With mean m and half difference h of the two, both
// normal with the same variance v / 2, E[exp(-m)] = exp(-depth + v / 4) and E[cos(h)] = exp(-v / 4).
fn transmittance(g: vec3<f32>) -> f32 {
    let ray = shadow_ray(g);
    var state = random_state(ray);
    let a = stratified_depth(ray, &state);
    let b = stratified_depth(ray, &state);
    return exp(-0.5 * (a + b)) * cos(0.5 * (a - b));
}
#else
// Largest order of the power series. A larger one would have a probability of 2e-11.
const MAX_ORDER: u32 = 16u;
const MAX_ESTIMATES: u32 = 17u;
// Probability of order 0; order 1 never occurs alone.
const ZERO_ORDER: f32 = 0.9;
// Largest number of samples of one estimate of optical depth.
const MAX_RAY_SAMPLES: f32 = #{MAX_RAY_SAMPLES};

// Returns the integral of the majorants along a ray: the largest optical depth that its bricks allow.
fn majorant_depth(ray: ShadowRay) -> f32 {
    var t = ray.start;
    var section = section_from(ray, brick_on(ray, t), t);
    var depth = 0.0;
    var sections = MAX_SECTIONS;
    var goes_on = true;
    loop {
        sections -= 1u;
        depth += section.majorant * (section.exit - t);
        t = section.exit;
        goes_on = section.goes_on;
        if goes_on && sections > 0u { section = section_from(ray, section.next, t); }
        if !goes_on || sections == 0u { break; }
    }
    if goes_on { report_iteration_limit(); }
    return depth;
}

// Returns an estimate of the optical depth of a ray: samples at equal steps of the integral of majorants, which is `whole`,
// displaced together at random. Each sample has the weight extinction / majorant.
fn equidistant_depth(ray: ShadowRay, samples: u32, whole: f32, state: ptr<function, u32>) -> f32 {
    let step = whole / f32(samples);
    let offset = random(state);
    var t = ray.start;
    var section = section_from(ray, brick_on(ray, t), t);
    // Integral of majorants up to t.
    var passed = 0.0;
    var sum = 0.0;
    var i = 0u;
    var events = MAX_SECTIONS + samples;
    var goes_on = true;
    loop {
        events -= 1u;
        let here = section.majorant * (section.exit - t);
        let target_depth = (f32(i) + offset) * step;
        let samples_here = i < samples && target_depth < passed + here;
        if samples_here {
            let at = clamp(t + (target_depth - passed) / section.majorant, t, section.exit);
            sum += extinction_on(ray, at) / section.majorant;
            i += 1u;
        } else {
            passed += here;
            t = section.exit;
            goes_on = section.goes_on;
            if goes_on { section = section_from(ray, section.next, t); }
        }
        if !goes_on || events == 0u { break; }
    }
    if goes_on { report_iteration_limit(); }
    return sum * step;
}

// Returns a random order of the power series: 0, or at least 2, and k or more with a probability of 2 / k that of k - 1.
fn random_order(state: ptr<function, u32>) -> u32 {
    var order = select(2u, 0u, random(state) < ZERO_ORDER);
    loop {
        if order == 0u || order == MAX_ORDER || random(state) * f32(order + 1u) >= 2.0 { break; }
        order += 1u;
    }
    return order;
}

// Returns an estimate of exp(-depth) from `order` + 1 estimates of the depth: the power series about one of them, `pivot`.
//
// Indices are limited explicitly: software adapters also access arrays in invocations that do not take part.
fn power_series(depths: ptr<function, array<f32, MAX_ESTIMATES>>, order: u32, pivot: u32) -> f32 {
    let at = (*depths)[pivot];
    // Elementary symmetric sums of at - depths[i] for i other than the pivot, by order.
    var sums = array<f32, MAX_ESTIMATES>();
    sums[0] = 1.0;
    for (var i = 0u; i <= order; i++) {
        let x = select(at - (*depths)[min(i, MAX_ORDER)], 0.0, i == pivot);
        for (var k = order; k > 0u; k--) { sums[min(k, MAX_ORDER)] += x * sums[clamp(k, 1u, MAX_ORDER) - 1u]; }
    }
    var series = 0.0;
    // binomial(order, k) k!, and the reciprocal of the probability of order k or more.
    var arrangements = 1.0;
    var weight = 1.0;
    for (var k = 0u; k <= order; k++) {
        series += weight * sums[min(k, MAX_ORDER)] / arrangements;
        arrangements *= f32(order - k);
        weight = select(select(0.5 * f32(k + 1u) * weight, weight, k == 1u), 1.0 / (1.0 - ZERO_ORDER), k == 0u);
    }
    // Depths far apart exceed float32. Such a series has no weight where exp(-at) is 0.
    let estimate = exp(-at) * series;
    return select(0.0, estimate, abs(estimate) < FAR);
}

// Returns an estimate of the transmittance from the light to a grid-space point: a power series of exp(-depth) about one
// estimate of the depth, with the elementary symmetric means of the others, averaged over the choices of that one
// (Kettunen et al. 2021).
fn transmittance(g: vec3<f32>) -> f32 {
    let ray = shadow_ray(g);
    var state = random_state(ray);
    let whole = majorant_depth(ray);
    // Samples with a weight of 1 at most keep the estimates of depth close together.
    let samples = max(params.samples, u32(min(ceil(whole), MAX_RAY_SAMPLES)));
    let order = random_order(&state);
    var depths: array<f32, MAX_ESTIMATES>;
    var estimates = 0u;
    loop {
        depths[min(estimates, MAX_ORDER)] = equidistant_depth(ray, samples, whole, &state);
        estimates += 1u;
        if estimates > order { break; }
    }
    if estimates <= order { report_iteration_limit(); }
    var sum = 0.0;
    for (var i = 0u; i <= order; i++) { sum += power_series(&depths, order, min(i, MAX_ORDER)); }
    return sum / f32(order + 1u);
}
#endif
