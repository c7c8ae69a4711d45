// State of an eye ray between two steps: its light interval, and what a ray stores that waits for a page of the volume.
#define_import_path umbravox::eye_state

#import umbravox::ray_march::RayMarch
#ifdef RAY_STATES
#import umbravox::field::wait_for_page
#import umbravox::ray_state::{start_state, put_word, put_float, take_word, take_float}
#endif

// Consecutive segments of an eye ray that share the shadow queries at their two ends.
struct LightInterval {
    segments: u32,
    // Depths of the interval's ends, mm, its optical depth, and the fraction of light to the eye that it absorbs.
    start: f32,
    end: f32,
    depth: f32,
    visible: f32,
    // Light emitted towards the eye before shadows, linear RGB, and that times the shading factor.
    color: vec3<f32>,
    shaded: vec3<f32>,
    // Length of the parts of a thick segment, mm; FAR for other segments.
    part_mm: f32,
    // Whether the interval must be lit before it takes more segments.
    complete: bool,
}

// Depth on the eye ray of the last shadow query, mm, and the transmittance from the light there.
struct KnownLight {
    t: f32,
    light: f32,
}

#ifdef RAY_STATES
// Stores the state of an eye ray that waits for a page before its next step: no segment is hit, and no search is pending.
fn suspend_eye_ray(march: RayMarch, interval: LightInterval, known: KnownLight) {
    wait_for_page(march.missing);
    start_state();
    put_float(march.k);
    put_float(march.value);
    put_word(select(0u, 1u, march.valid));
    put_word(march.steps_unskipped);
    put_word(march.steps_together);
    put_word(march.iterations_left);
#ifdef SURFACES
    put_float(march.before);
#endif
    put_word(interval.segments);
    put_float(interval.start);
    put_float(interval.end);
    put_float(interval.depth);
    put_float(interval.visible);
    put_float(interval.color.x);
    put_float(interval.color.y);
    put_float(interval.color.z);
    put_float(interval.shaded.x);
    put_float(interval.shaded.y);
    put_float(interval.shaded.z);
    put_float(known.t);
    put_float(known.light);
}

// Continues the march of an eye ray that has waited.
fn resume_march(march: ptr<function, RayMarch>) {
    (*march).k = take_float();
    (*march).value = take_float();
    (*march).valid = take_word() == 1u;
    (*march).steps_unskipped = take_word();
    (*march).steps_together = take_word();
    (*march).iterations_left = take_word();
#ifdef SURFACES
    (*march).before = take_float();
#endif
}

// Returns the light interval of an eye ray whose march was continued.
fn resumed_interval(part_mm: f32) -> LightInterval {
    var interval: LightInterval;
    interval.segments = take_word();
    interval.start = take_float();
    interval.end = take_float();
    interval.depth = take_float();
    interval.visible = take_float();
    interval.color.x = take_float();
    interval.color.y = take_float();
    interval.color.z = take_float();
    interval.shaded.x = take_float();
    interval.shaded.y = take_float();
    interval.shaded.z = take_float();
    interval.part_mm = part_mm;
    return interval;
}

// Returns the last shadow query of an eye ray whose light interval was continued.
fn resumed_light() -> KnownLight {
    let t = take_float();
    return KnownLight(t, take_float());
}
#endif
