// `rays:estimator=ratio` and `residual`: ratio tracking and residual ratio tracking (Novák et al. 2014).
//
// A random walk to the light collides with the majorant of each brick, which is the largest extinction above the control
// extinction. A collision multiplies the estimate by 1 - (extinction - control) / majorant, and the control extinction is
// integrated exactly. With `ratio`, control extinctions are 0.
#define_import_path umbravox::method

#import umbravox::random_rays::{params, ShadowRay, shadow_ray, extinction_on, brick_on, section_from, random_state, random}
#import umbravox::watch::report_iteration_limit

// Estimate below which a walk ends at random (Russian roulette), and goes on with this estimate otherwise.
const LEAST_WEIGHT: f32 = 0.01;
// Largest number of collisions and sections of a walk.
const MAX_EVENTS: u32 = 32768u;

// Returns an estimate of the transmittance of a ray by one random walk.
fn tracked(ray: ShadowRay, state: ptr<function, u32>) -> f32 {
    var t = ray.start;
    var section = section_from(ray, brick_on(ray, t), t);
    var control_depth = 0.0;
    var weight = 1.0;
    var events = MAX_EVENTS;
    var done = false;
    loop {
        events -= 1u;
        let free = -log(random(state)) / max(section.majorant, 1e-30);
        let collides = section.majorant > 0.0 && t + free < section.exit;
        let to = select(section.exit, t + free, collides);
        control_depth += section.control * (to - t);
        t = to;
        if collides {
            weight *= 1.0 - (extinction_on(ray, t) - section.control) / section.majorant;
            if abs(weight) < LEAST_WEIGHT {
                let survives = random(state) * LEAST_WEIGHT < abs(weight);
                weight = select(0.0, select(-LEAST_WEIGHT, LEAST_WEIGHT, weight > 0.0), survives);
            }
        }
        done = weight == 0.0 || (!collides && !section.goes_on);
        if !collides && !done { section = section_from(ray, section.next, t); }
        if done || events == 0u { break; }
    }
    if !done { report_iteration_limit(); }
    return weight * exp(-control_depth);
}

// Returns an estimate of the transmittance from the light to a grid-space point: the mean of several random walks.
fn transmittance(g: vec3<f32>) -> f32 {
    let ray = shadow_ray(g);
    var state = random_state(ray);
    var sum = 0.0;
    var walks = 0u;
    loop {
        sum += tracked(ray, &state);
        walks += 1u;
        if walks >= params.samples { break; }
    }
    if walks < params.samples { report_iteration_limit(); }
    return sum / f32(params.samples);
}
