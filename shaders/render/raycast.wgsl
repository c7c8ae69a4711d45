// Ray caster: pre-integrated extinction along eye rays, brick skipping, early ray termination, shadow queries.
//
// A march by regular samples (`umbravox::ray_march`) hits segments with extinction. With shadows, thick segments are
// split, and a few segments form a light interval, whose two ends share their shadow queries; with LOOKUP_EACH every
// segment has its own. Expensive code stands in the program once, and lanes of a subgroup wait for each other only there.
//
// A picture of several lights sums one pass for each (LIGHT_FACTOR). The first pass adds ambient and background. With
// SECTIONS a dispatch draws the matter of one section of the volume. With RAY_STATES rays wait for pages of the volume.
// The shadow method, a module that defines `umbravox::method`, offers
//   fn transmittance(g: vec3<f32>) -> f32
//       from the light to a grid-space point of the domain; 1 if nothing lies between. Its bindings are in group 1
//       from binding 1 on; binding 0 is the light space for all methods.
// `umbravox::shadow`, with a function of the same form, marches the last voxels towards the light before (`near`).

#import umbravox::frame::{frame, picture, ray_pixel}
#import umbravox::field::FAR
#import umbravox::ray_march::{Ray, RayMarch, ray_through, start_march, advance, is_searching, SURFACE_SEARCH, count_iteration, reached_iteration_limit, sample_depth, segment_end_value}
#import umbravox::eye_state::{LightInterval, KnownLight}
#ifdef RAY_STATES
#import umbravox::eye_state::{suspend_eye_ray, resume_march, resumed_interval, resumed_light}
#import umbravox::ray_state::{select_ray, has_state, finish_ray}
#endif
#ifdef RESUMABLE
#import umbravox::resumption::{resumption, UNKNOWN_LIGHT}
#endif
#ifdef SECTIONS
#import umbravox::section::section
#import umbravox::section_ray::{enter_section, start_in_section, keep_to_section, with_matter_behind}
#import umbravox::resumption::resumption
#endif
#import umbravox::labels::CUTS_BY_LABEL
#import umbravox::between_samples::{crosses_surface, find_surface}
#ifdef GRADIENT_OPACITY
#import umbravox::segment_mean::mean_over_cells
#else
#import umbravox::segment_mean::mean_over
#ifdef SHADING
#import umbravox::segment_mean::mean_over_halves
#endif
#endif
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_work, add_divergence, add_work, LOOKUPS}
#import umbravox::tuning::EYE_STEPS_TOGETHER
#ifdef SHADOWS
#import umbravox::mean_light::mean_light
#ifdef MESH
#import umbravox::mesh_light::light_at
#else
#import umbravox::shadow::transmittance as light_at
#endif
#endif
#ifdef SHADING
#import umbravox::labels::labeled_value_at
#endif
#ifdef SHADING_FACTOR
#import umbravox::shading::shading_factor
#endif
#ifdef MESH
#import umbravox::surface::surface_along
#endif

#ifdef RESUMABLE
const IS_RESUMABLE: bool = true;
#else
const IS_RESUMABLE: bool = false;
#endif
// Largest number of shadow queries of a pixel in one dispatch of a resumable picture.
const MAX_LOOKUPS: u32 = 8u;

// Transmittance below which the eye ray ends.
const EYE_OVER: f32 = 5e-4;
#ifdef SHADOWS
const SPLITS_SEGMENTS: bool = true;
const SURFACE_OVER: f32 = EYE_OVER;
#ifdef LOOKUP_EACH
const MAX_SEGMENTS: u32 = 1u;
const FAINT_INTERVAL: f32 = 0.0;
#else
// Largest number of segments in a light interval.
const MAX_SEGMENTS: u32 = 4u;
// Visible fraction of an interval up to which the light at its end also counts for its start.
const FAINT_INTERVAL: f32 = 0.05;
#endif
#else
const SPLITS_SEGMENTS: bool = false;
const SURFACE_OVER: f32 = 0.0;
const MAX_SEGMENTS: u32 = 1u;
#endif
// Optical depth limits: a segment above THICKEST_PART is split into parts of LIT_DEPTH. A part of which less than a
// quarter is visible to the eye may be thicker, by up to UNSEEN_PART.
const LIT_DEPTH: f32 = 0.75;
const THICKEST_PART: f32 = 1.0;
const UNSEEN_PART: f32 = 4.0;
const MAX_PARTS: f32 = 16.0;
// Number of iterations after which lanes with a complete light interval do not wait for the others.
const INTERVAL_STEPS: u32 = EYE_STEPS_TOGETHER;
// Fraction of all visible light along the eye ray at which a light interval is complete.
const COMPLETE_INTERVAL: f32 = 0.15;
// Largest number of iterations for a sample: one step, one test of thickness, four for each part, and a reserve.
const ITERATIONS_A_SAMPLE: u32 = 72u;

fn pixel_ndc(pixel: vec2<u32>) -> vec2<f32> {
    return (2.0 * (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) - 1.0) * vec2<f32>(1.0, -1.0) * frame.half_extent;
}

// Returns the eye ray through a pixel, between the depths that may contain extinction.
fn eye_ray(pixel: vec2<u32>, nearest_mm: f32, farthest_mm: f32) -> Ray {
    let ndc = pixel_ndc(pixel);
    let across = ndc.x * frame.grid_right + ndc.y * frame.grid_up;
    let slant = sqrt(1.0 + dot(ndc, ndc));
    // Depth 0 is where the ray crosses the frame's plane.
    let o = frame.plane_center + frame.plane_distance_mm * across;
    let d = (frame.grid_forward + across) / slant;
    var ray = ray_through(o, d, -frame.plane_distance_mm * slant, FAR, frame.step_mm);
    // The start of the ray does not move its lattice of samples.
    ray.start = max(ray.start, nearest_mm * slant);
    ray.end = min(ray.end, farthest_mm * slant);
    return ray;
}

#ifdef MESH
// Returns the depth of the eye on the ray of a pixel, mm.
fn eye_depth(pixel: vec2<u32>) -> f32 {
    let ndc = pixel_ndc(pixel);
    return -frame.plane_distance_mm * sqrt(1.0 + dot(ndc, ndc));
}
#endif

// Part of the segment that the march has hit.
struct Part {
    end: f32,
    end_value: f32,
    // Mean extinction (w, 1/mm) and extinction-weighted colour (rgb) of the part.
    mean: vec4<f32>,
}

// Returns the next part, at most `part_mm` long, of the segment that the march has hit.
fn next_part(march: RayMarch, part_mm: f32, ray: Ray) -> Part {
    let begin = march.segment_start;
    let begin_value = march.segment_value;
    let segment_end = sample_depth(ray, march.k);
    let segment_value = segment_end_value(march);
    // If a part is too short for float32, the last part takes the rest of the segment.
    let part_end = begin + part_mm;
    let takes_rest = begin + 1.5 * part_mm > segment_end || part_end <= begin;
    var end = segment_end;
    if SPLITS_SEGMENTS { end = select(part_end, segment_end, takes_rest); }
    let inner = SPLITS_SEGMENTS && end != segment_end;
    let share = select((end - begin) / (segment_end - begin), 1.0, end == segment_end);
    let linear = select(segment_value, mix(begin_value, segment_value, share), SPLITS_SEGMENTS);
#ifdef SHADING
    // One more sample: at the end of an inner part, else in the middle. Linear values between two samples would put a
    // surface beside the place where light rays meet it; the dark light just behind it would show as rings.
    let refined = frame.shading_weight > 0.0;
    let sample = labeled_value_at(ray.o + select(0.5 * (begin + end), end, inner) * ray.d);
    let end_value = select(linear, sample, inner && refined);
#ifdef GRADIENT_OPACITY
    let mean = mean_over_cells(ray, begin, end, march.shift);
#else
    let middle = select(0.5 * (begin_value + end_value), sample, !inner);
    var mean = vec4<f32>(0.0);
    if refined { mean = mean_over_halves(begin_value, middle, end_value); } else { mean = mean_over(begin_value, end_value); }
#endif
    return Part(end, end_value, mean);
#else
#ifdef GRADIENT_OPACITY
    return Part(end, linear, mean_over_cells(ray, begin, end, march.shift));
#else
    return Part(end, linear, mean_over(begin_value, linear));
#endif
#endif
}

// Returns the light that a fully lit point with shading factor 1 reflects, without the ambient light.
#ifdef LIGHT_FACTOR
fn direct_light() -> vec3<f32> {
    return frame.light;
}
#else
fn direct_light() -> f32 {
    return 1.0 - frame.ambient;
}
#endif

// Adds the light that a segment or surface emits to a light interval; without shadows, to the pixel's colour.
fn add_emission(
    interval: ptr<function, LightInterval>,
    color: ptr<function, vec3<f32>>,
    emitted: vec3<f32>,
    shading: f32,
) {
#ifdef SHADOWS
    (*interval).color += emitted;
#ifdef SHADED
    (*interval).shaded += emitted * shading;
#endif
#else
    *color += emitted * (frame.ambient + direct_light() * shading);
#endif
}

// Adds the next part of the hit segment to a light interval; `left` is the transmittance to the eye.
fn accumulate_segment(
    interval: ptr<function, LightInterval>,
    color: ptr<function, vec3<f32>>,
    march: ptr<function, RayMarch>,
    left: ptr<function, f32>,
    ray: Ray,
) {
    let begin = (*march).segment_start;
    let part = next_part(*march, (*interval).part_mm, ray);
    let length_mm = part.end - begin;
    let depth = part.mean.w * length_mm;
    let thickness = depth * min(UNSEEN_PART * *left, 1.0) / THICKEST_PART;
    let whole = (*interval).part_mm == FAR;
    if CUTS_BY_LABEL == 1u && whole && crosses_surface(*march, thickness) {
        (*march).search = SURFACE_SEARCH;
    } else if SPLITS_SEGMENTS && whole && thickness > 1.0 {
        // The segment is taken again in parts.
        (*interval).part_mm = length_mm / clamp(ceil(depth / LIT_DEPTH), 1.0, MAX_PARTS);
    } else {
        (*march).segment_start = part.end;
        (*march).hit = SPLITS_SEGMENTS && part.end < sample_depth(ray, (*march).k);
        (*interval).part_mm = select(FAR, (*interval).part_mm, (*march).hit);
        (*march).segment_value = part.end_value;
        let alpha = 1.0 - exp(-depth);
        let emitted = *left * alpha * part.mean.rgb / max(part.mean.w, 1e-30);
        (*interval).visible += *left * alpha;
        *left *= 1.0 - alpha;
#ifdef SHADING_FACTOR
        add_emission(interval, color, emitted, shading_factor(ray.o + 0.5 * (begin + part.end) * ray.d, ray.d));
#else
        add_emission(interval, color, emitted, 1.0);
#endif
        // Skipping decides whether a part without extinction is visited at all: the interval must not depend on it.
        if SPLITS_SEGMENTS && depth > 0.0 {
            (*interval).start = select((*interval).start, begin, (*interval).segments == 0u);
            (*interval).end = part.end;
            (*interval).depth += depth;
            (*interval).segments += 1u;
        }
        let full = (*interval).segments >= MAX_SEGMENTS || (*interval).visible >= COMPLETE_INTERVAL;
        (*interval).complete = SPLITS_SEGMENTS && (full || *left < EYE_OVER);
    }
}

// Advances the march until the light interval is complete, the ray ends, or INTERVAL_STEPS iterations are taken.
fn accumulate_interval(
    interval: ptr<function, LightInterval>,
    color: ptr<function, vec3<f32>>,
    march: ptr<function, RayMarch>,
    left: ptr<function, f32>,
    ray: Ray,
) {
    var steps = 0u;
    loop {
        steps += 1u;
        if !(*interval).complete {
            let is_new = !(*march).hit;
            advance(march, ray);
#ifdef RAY_STATES
            if (*march).missing >= 0 {
                // After a step without extinction the interval is complete. It is lit while its pages are resident.
                (*interval).complete = (*interval).segments > 0u && (*march).steps_together > 0u;
                break;
            }
#endif
#ifdef SECTIONS
            if is_new { keep_to_section(march, ray); }
#endif
            // A light interval ends where the extinction or the ray ends.
            (*interval).complete = (*interval).segments > 0u && (!(*march).hit || (*march).segment_start != (*interval).end);
            if (*march).hit && !(*interval).complete { accumulate_segment(interval, color, march, left, ray); }
            if SPLITS_SEGMENTS { count_iteration(march); }
        }
        let over = (*interval).segments == 0u && (*left < EYE_OVER || !((*march).hit || (*march).marching));
        if (*interval).complete || over || is_searching(*march) || steps >= INTERVAL_STEPS { break; }
    }
}

#ifdef SHADOWS
// Queries the transmittance from the light at one end of a complete interval, adds the light that reaches the eye to
// `color`, and empties the interval. If the start is not known yet, it queries the start and keeps the interval.
fn light_interval(
    interval: ptr<function, LightInterval>,
    known: ptr<function, KnownLight>,
    color: ptr<function, vec3<f32>>,
    ray: Ray,
) {
    let at_start = (*known).t != (*interval).start && (*interval).visible > FAINT_INTERVAL;
    count_work(LOOKUPS, 1u);
    let light = light_at(ray.o + select((*interval).end, (*interval).start, at_start) * ray.d);
    if at_start {
        *known = KnownLight((*interval).start, light);
    } else {
        let first = select(light, (*known).light, (*known).t == (*interval).start);
        let direct = direct_light() * mean_light(first, light, max((*interval).depth, 1e-12));
#ifdef SHADED
        *color += frame.ambient * (*interval).color + direct * (*interval).shaded;
        (*interval).shaded = vec3<f32>(0.0);
#else
        *color += (frame.ambient + direct) * (*interval).color;
#endif
        (*interval).color = vec3<f32>(0.0);
        (*interval).depth = 0.0;
        (*interval).visible = 0.0;
        (*interval).segments = 0u;
        (*interval).complete = false;
        *known = KnownLight((*interval).end, light);
    }
}
#endif

@compute @workgroup_size(#{PICTURE_SIDE}, #{PICTURE_SIDE})
fn raycast(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let pixel = ray_pixel(group, groups, local);
    if !pixel.inside { return; }
    let index = pixel.index;
    var ray = eye_ray(pixel.at, pixel.nearest_mm, pixel.farthest_mm);
#ifdef MESH
    // An eye ray ends at the first surface.
    var surface = surface_along(ray.o, ray.d, eye_depth(pixel.at));
    ray.end = min(ray.end, surface.z);
    ray.t_out = max(min(ray.t_out, surface.z), ray.t_in);
#endif
    var march = start_march(ray, ITERATIONS_A_SAMPLE);
    var color = vec3<f32>(0.0);
    // Transmittance to the eye.
    var left = 1.0;
#ifdef LIGHT_FACTOR
    if frame.adds == 1u { color = picture[index].rgb; }
#endif
#ifdef SECTIONS
    // Light of earlier passes, and colour and transmittance of the sections before.
    let drawn = color;
    let others = resumption.resume[index];
    color = vec3<f32>(0.0);
    enter_section(ray);
    start_in_section(&march, ray);
#ifndef TOWARDS_EYE
    if others.x != -FAR {
        color = others.rgb;
        left = others.a;
        march.marching = march.marching && left >= EYE_OVER;
    }
#endif
#endif
#ifdef RESUMABLE
    let resume = resumption.resume[index];
    if resume.x == FAR { return; }
    if resume.x != -FAR {
        color = picture[index].rgb;
        left = picture[index].a;
        march.k = resume.x;
        march.value = resume.z;
        march.valid = resume.z != FAR;
        march.before = resume.w;
    }
#endif
    var interval = LightInterval(0u, 0.0, 0.0, 0.0, 0.0, vec3<f32>(0.0), vec3<f32>(0.0), FAR, false);
    var known = KnownLight(-FAR, 1.0);
#ifdef RAY_STATES
    if !select_ray(index) { return; }
    if has_state() {
        color = picture[index].rgb;
        left = picture[index].a;
        resume_march(&march);
        interval = resumed_interval(FAR);
        known = resumed_light();
    }
#endif
#ifdef SHADOWS
#ifdef RESUMABLE
    if resume.x != -FAR && resume.y != UNKNOWN_LIGHT { known = KnownLight(sample_depth(ray, march.k), resume.y); }
#endif
#endif
    var lookups = 0u;
    var interrupted = false;
    loop {
        if IS_RESUMABLE && !march.hit && interval.segments == 0u && lookups >= MAX_LOOKUPS && march.marching {
            interrupted = true;
            break;
        }
        accumulate_interval(&interval, &color, &march, &left, ray);
#ifdef RAY_STATES
        if march.missing >= 0 && !interval.complete { break; }
#endif
        if is_searching(march) { find_surface(&march, ray); }
#ifdef SHADOWS
        if interval.complete {
            light_interval(&interval, &known, &color, ray);
            lookups += 1u;
        }
#endif
        var over = !interval.complete && interval.segments == 0u && (left < EYE_OVER || !(march.hit || march.marching));
#ifdef MESH
        // The opaque surface behind the volume is a light interval without length.
        if over && surface.met && left >= SURFACE_OVER {
            surface.met = false;
            interval.start = surface.z;
            interval.end = surface.z;
            add_emission(&interval, &color, left * surface.color, surface.cosine);
            left = 0.0;
#ifdef SHADOWS
            interval.segments = 1u;
            interval.complete = true;
            over = false;
#endif
        }
#endif
        if over { break; }
    }
    add_divergence(pixel.at, frame.size.x);
    add_work();
#ifdef RAY_STATES
    if march.missing >= 0 && left >= EYE_OVER {
        picture[index] = vec4<f32>(color, left);
        suspend_eye_ray(march, interval, known);
        return;
    }
    finish_ray();
#endif
    if reached_iteration_limit(march) || (march.marching && left >= EYE_OVER && !interrupted) { report_iteration_limit(); }
#ifdef RESUMABLE
    if interrupted {
        picture[index] = vec4<f32>(color, left);
        let here = known.t == sample_depth(ray, march.k);
        let value = select(FAR, march.value, march.valid);
        resumption.resume[index] = vec4<f32>(march.k, select(UNKNOWN_LIGHT, known.light, here), value, march.before);
        atomicAdd(&resumption.unfinished, 1u);
        return;
    }
    resumption.resume[index] = vec4<f32>(FAR);
#endif
#ifdef SECTIONS
    var total = vec4<f32>(color, left);
#ifdef TOWARDS_EYE
    total = with_matter_behind(total, others);
#endif
    resumption.resume[index] = total;
    if section.is_last == 1u { picture[index] = vec4<f32>(drawn + total.rgb + total.a * frame.background, 1.0 - total.a); }
#else
    picture[index] = vec4<f32>(color + left * frame.background, 1.0 - left);
#endif
}
