// Part of an eye ray in the section of the volume that a dispatch draws: the segments that start there.
//
// Eye rays pass the sections in the order of the light, or with TOWARDS_EYE in the opposite one: the light comes from behind
// the volume, and the matter drawn first lies behind what follows.
#define_import_path umbravox::section_ray

#import umbravox::field::FAR
#import umbravox::ray_march::{Ray, RayMarch, sample_depth, is_searching, skip_search}
#import umbravox::section::{section, section_coordinate}

// Number of samples before a section from which the march finds the same segments as one from the start of the ray.
const SAMPLES_BEFORE: f32 = 2.0;

// Depths on the eye ray at which it enters and leaves the section, mm.
var<private> entry_mm: f32;
var<private> exit_mm: f32;

fn enter_section(ray: Ray) {
    let ends = (vec2<f32>(section.start, section.end) - section_coordinate(ray.o)) / dot(section.plane.xyz, ray.d);
#ifdef TOWARDS_EYE
    entry_mm = select(ends.y, -FAR, section.is_last == 1u);
    exit_mm = select(ends.x, FAR, section.is_first == 1u);
#else
    entry_mm = select(ends.x, -FAR, section.is_first == 1u);
    exit_mm = select(ends.y, FAR, section.is_last == 1u);
#endif
}

// Moves the start of a march to just before the section.
fn start_in_section(march: ptr<function, RayMarch>, ray: Ray) {
    let first = max(floor(entry_mm / ray.step_mm) - SAMPLES_BEFORE, (*march).k);
    (*march).k = first;
    (*march).marching = (*march).marching && sample_depth(ray, first) < ray.end;
}

// Drops a segment or peak that the march has met in another section, and ends the march behind the section.
fn keep_to_section(march: ptr<function, RayMarch>, ray: Ray) {
    let met = (*march).hit || is_searching(*march);
    let start = (*march).segment_start;
    let is_behind = select(sample_depth(ray, (*march).k - 1.0), start, met) >= exit_mm;
    if is_behind { (*march).marching = false; }
    if met && (is_behind || start < entry_mm) {
        (*march).hit = false;
        if is_searching(*march) { skip_search(march); }
    }
}

// Returns colour and transmittance of the matter in front together with those of the matter behind it, if anything has been
// drawn there.
fn with_matter_behind(front: vec4<f32>, behind: vec4<f32>) -> vec4<f32> {
    return select(vec4<f32>(front.rgb + front.a * behind.rgb, front.a * behind.a), front, behind.x == -FAR);
}
