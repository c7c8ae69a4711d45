// The ray caster: pre-integrated extinction along eye rays, brick skipping, early end, shadows through one lookup.
//
// A ray is walked from sample to sample (`umbravox::walk`), which finds stretches with extinction. With shadows a stretch
// is cut into parts, parts make a run, and a run asks the lookup once for the light at its end; with LOOKUP_EACH every
// part is a run of its own. What is expensive stands in the program once, and lanes of a subgroup wait for each other only
// there.
//
// A picture of several lights is a pass for each, with LIGHT_FACTOR, and their sum; the first one carries ambient light and
// the background.
//
// The lookup, a module that defines `umbravox::method`, offers
//   fn transmittance(g: vec3<f32>) -> f32           from the light to a grid-space point of the domain; 1 where nothing
//                                                   lies between. Whatever it reads is bound in group 1 from binding 1
//                                                   on; binding 0 is the light space for all methods.

#import umbravox::frame::{frame, picture, pixel_of}
#import umbravox::field::{field, value_at, FAR}
#import umbravox::walk::{Line, Walk, line_through, start_walk, walk_on, count_turn, exhausted, sample_depth}
#import umbravox::transfer::{color_integral_at, mean_color}
#import umbravox::watch::ran_out
#import umbravox::work::{count_work, add_work, LOOKUPS}
#ifdef SHADOWS
#ifdef MESH
#import umbravox::mesh_light::light_at
#else
#import umbravox::method::transmittance as light_at
#endif
#endif
#ifdef SHADING
#import umbravox::labels::seen_value_at
#import umbravox::light::{light_point, light_ray}
#endif
#ifdef KAJIYA_KAY
#import umbravox::strand::strand_factor
#endif
#ifdef MESH
#import umbravox::surface::{Surface, surface_along}
#endif

#ifdef RESUMABLE
// A picture made in several dispatches, since one would loop longer than some adapters allow (software ones end every
// loop of an invocation after 65,536 turns in all).
struct Resumption {
    // Pixels that are not finished.
    unfinished: atomic<u32>,
    // The sample to go on from, a pixel: -FAR before the first dispatch, FAR when the pixel is finished.
    resume: array<f32>,
}
@group(2) @binding(2) var<storage, read_write> resumption: Resumption;
// Shadow lookups a pixel and dispatch.
const MOST_LOOKUPS: u32 = 8u;
#endif

// Transmittance below which the eye ray is over.
const EYE_OVER: f32 = 5e-4;
// Optical depth of the parts of a stretch that is thicker than `THICKEST_PART`; one of which the eye sees less than a
// quarter may be that much thicker.
const LIT_DEPTH: f32 = 0.75;
const THICKEST_PART: f32 = 1.0;
const UNSEEN_PART: f32 = 4.0;
const MAX_PARTS: f32 = 16.0;
// A run of parts shares its lookups until it has so many parts, or until the eye sees so much of it (of all that it sees
// along the ray): what is seen through much else needs no light of its own.
const FULL_RUN: f32 = 0.15;
// Of a run whose start may be lit as its end is, the same.
#ifdef LOOKUP_EACH
const RUN_PARTS: u32 = 1u;
const FAINT_RUN: f32 = 0.0;
#else
const RUN_PARTS: u32 = 4u;
const FAINT_RUN: f32 = 0.05;
#endif
// Turns after which lanes whose run is complete do not wait for the others (best of 4, 6, 8 and no limit on llvmpipe).
const GATHER_TURNS: u32 = 4u;
const DARKEST: f32 = 1e-6;
// One to walk, one to see that a stretch is thick, four for each part of it, and some to spare.
const TURNS_A_SAMPLE: u32 = 72u;

// ---- The ray of a pixel ----

// The ray through a pixel, as far as something may show along it.
fn eye_ray(pixel: vec2<u32>, nearest_mm: f32, farthest_mm: f32) -> Line {
    let ndc = (2.0 * (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) - 1.0) * vec2<f32>(1.0, -1.0) * frame.half_extent;
    let across = ndc.x * frame.grid_right + ndc.y * frame.grid_up;
    let slant = sqrt(1.0 + dot(ndc, ndc));
    // Depth 0 is where the ray crosses the frame's plane.
    let o = frame.plane_center + frame.plane_distance_mm * across;
    let d = (frame.grid_forward + across) / slant;
    var ray = line_through(o, d, -frame.plane_distance_mm * slant, FAR, frame.step_mm);
    // The lattice of samples stays as it is.
    ray.start = max(ray.start, nearest_mm * slant);
    ray.end = min(ray.end, farthest_mm * slant);
    return ray;
}

#ifdef MESH
// Depth of the eye on the ray of a pixel, mm.
fn eye_depth(pixel: vec2<u32>) -> f32 {
    let ndc = (2.0 * (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) - 1.0) * frame.half_extent;
    return -frame.plane_distance_mm * sqrt(1.0 + dot(ndc, ndc));
}
#endif

// Mean extinction (w, 1/mm) and extinction-weighted colour (rgb) where the value goes from a to b.
fn mean_over(a: f32, b: f32) -> vec4<f32> {
    return mean_color(a, b, color_integral_at(a), color_integral_at(b));
}

// ---- Shading and light ----

#ifdef SHADING
// The same where the value is known on the way, too: half of the way each.
fn mean_by(a: f32, middle: f32, b: f32) -> vec4<f32> {
    let integral = color_integral_at(middle);
    let first = mean_color(a, middle, color_integral_at(a), integral);
    return 0.5 * (first + mean_color(middle, b, integral, color_integral_at(b)));
}
#endif

#ifdef SHADING
#ifdef KAJIYA_KAY
// Shading factor of the strands at a grid-space point.
fn shading_factor(g: vec3<f32>, eye_direction: vec3<f32>) -> f32 {
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    let l = -normalize(to_world * light_ray(light_point(g).texel).d);
    return strand_factor(g, l, -normalize(to_world * eye_direction));
}
#else
// Shading factor at a grid-space point; surfaces are lit from both sides, shadows decide which one light reaches.
fn shading_factor(g: vec3<f32>, eye_direction: vec3<f32>) -> f32 {
    let gradient_grid = vec3<f32>(
        value_at(g + vec3<f32>(0.5, 0.0, 0.0)) - value_at(g - vec3<f32>(0.5, 0.0, 0.0)),
        value_at(g + vec3<f32>(0.0, 0.5, 0.0)) - value_at(g - vec3<f32>(0.0, 0.5, 0.0)),
        value_at(g + vec3<f32>(0.0, 0.0, 0.5)) - value_at(g - vec3<f32>(0.0, 0.0, 0.5)),
    );
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    // Gradients transform with the inverse transpose; its scale does not matter to a direction.
    let gradient = cross(to_world[1], to_world[2]) * gradient_grid.x
        + cross(to_world[2], to_world[0]) * gradient_grid.y
        + cross(to_world[0], to_world[1]) * gradient_grid.z;
    // No early return where there is no gradient: a software adapter (llvmpipe of Mesa 22.3) crashes on it.
    let size = length(gradient);
    let n = gradient / max(size, 1e-30);
    let l = -normalize(to_world * light_ray(light_point(g).texel).d);
    let diffuse = abs(dot(n, l));
#ifdef BLINN_PHONG
    let h = normalize(l - normalize(to_world * eye_direction));
    let factor = diffuse + #{HIGHLIGHT} * pow(abs(dot(n, h)), #{GLOSS});
#else
    let factor = diffuse;
#endif
    return select(1.0, mix(1.0, factor, frame.shading_weight), size > 0.0);
}
#endif
#endif

#ifdef SHADOWS
// Mean of the light over a stretch of optical depth, where the light's transmittance goes from a to b as exponentials of
// the eye's own optical depth do: exact through any layered medium, whatever the step.
fn mean_light(a: f32, b: f32, depth: f32) -> f32 {
    let x = depth + log(max(a, DARKEST) / max(b, DARKEST));
    let weight = select((1.0 - exp(-x)) / x, 1.0 - 0.5 * x, abs(x) < 1e-3);
    let own = select((1.0 - exp(-depth)) / depth, 1.0 - 0.5 * depth, depth < 1e-3);
    return a * weight / own;
}
#endif

#ifdef SHADOWS
// ---- Runs of parts that wait for their light ----

struct Run {
    parts: u32,
    // Depths between which it lies, mm, its optical depth, how much of it the eye sees, and its colour.
    start: f32,
    end: f32,
    depth: f32,
    seen: f32,
    color: vec3<f32>,
    shaded: vec3<f32>,
    // Length of a stretch's parts where it is too thick to be lit as a whole.
    part_mm: f32,
    // Complete: nothing more is gathered before it is lit.
    closing: bool,
}

// Gathers the part of a stretch that lies behind; `left` is the transmittance to the eye.
fn gather_part(run: ptr<function, Run>, walk: ptr<function, Walk>, left: ptr<function, f32>, ray: Line) {
    let begin = (*walk).from_t;
    let b = sample_depth(ray, (*walk).k);
    // A part that float32 cannot tell from nothing takes the rest.
    let part_end = begin + (*run).part_mm;
    let to = select(part_end, b, begin + 1.5 * (*run).part_mm > b || part_end <= begin);
#ifdef SHADING
    // One more sample: where a part of a thick stretch ends, else in the middle. A straight line between two samples puts a
    // surface beside where light rays meet it, and what lies behind that by a hair is dark: it would show as rings.
    let refined = frame.shading_weight > 0.0;
    let inner = to != b;
    let taken = seen_value_at(ray.o + select(0.5 * (begin + to), to, inner) * ray.d);
    let straight = mix((*walk).from_value, (*walk).value, select((to - begin) / (b - begin), 1.0, to == b));
    let value_to = select(straight, taken, inner && refined);
    let middle = select(0.5 * ((*walk).from_value + value_to), taken, !inner);
    var mean = vec4<f32>(0.0);
    if refined { mean = mean_by((*walk).from_value, middle, value_to); } else { mean = mean_over((*walk).from_value, value_to); }
#else
    let value_to = mix((*walk).from_value, (*walk).value, select((to - begin) / (b - begin), 1.0, to == b));
    let mean = mean_over((*walk).from_value, value_to);
#endif
    let depth = mean.w * (to - begin);
    // Too thick to be lit as a whole: taken again in parts.
    let thick = depth * min(UNSEEN_PART * *left, 1.0) > THICKEST_PART && (*run).part_mm == FAR;
    if thick {
        (*run).part_mm = (to - begin) / clamp(ceil(depth / LIT_DEPTH), 1.0, MAX_PARTS);
    } else {
        (*walk).from_t = to;
        (*walk).found = to < b;
        (*run).part_mm = select(FAR, (*run).part_mm, (*walk).found);
        (*walk).from_value = value_to;
        let alpha = 1.0 - exp(-depth);
        let emitted = *left * alpha * mean.rgb / max(mean.w, 1e-30);
        (*run).seen += *left * alpha;
        *left *= 1.0 - alpha;
        (*run).color += emitted;
#ifdef SHADING
        (*run).shaded += emitted * shading_factor(ray.o + 0.5 * (begin + to) * ray.d, ray.d);
#else
#ifdef MESH
        (*run).shaded += emitted;
#endif
#endif
        // Whether a part without extinction is come upon depends on what is skipped: a run must not.
        if depth > 0.0 {
            (*run).start = select((*run).start, begin, (*run).parts == 0u);
            (*run).end = to;
            (*run).depth += depth;
            (*run).parts += 1u;
        }
        (*run).closing = (*run).parts >= RUN_PARTS || (*run).seen >= FULL_RUN || *left < EYE_OVER;
    }
}

// Gathers parts of stretches until the run is complete or the ray ends, or for some turns.
fn gather(run: ptr<function, Run>, walk: ptr<function, Walk>, left: ptr<function, f32>, ray: Line) {
    var turns = 0u;
    loop {
        turns += 1u;
        if !(*run).closing {
            walk_on(walk, ray);
            // A run ends where the extinction does, and at the end of the ray.
            (*run).closing = (*run).parts > 0u && (!(*walk).found || (*walk).from_t != (*run).end);
            if (*walk).found && !(*run).closing { gather_part(run, walk, left, ray); }
            count_turn(walk);
        }
        let over = !((*walk).found || (*walk).walking) && (*run).parts == 0u;
        if (*run).closing || over || turns >= GATHER_TURNS { break; }
    }
}
#endif

// As long as it is for its variants: what is shared by them stands in the functions above.
@compute @workgroup_size(#{PICTURE_SIDE}, #{PICTURE_SIDE})
fn raycast(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let pixel = pixel_of(group, groups, local, 0u, frame.tiles_cast);
    if !pixel.inside { return; }
    let index = pixel.index;
    var ray = eye_ray(pixel.at, pixel.nearest_mm, pixel.farthest_mm);
#ifdef MESH
    // An eye ray ends at the first surface.
    var surface = surface_along(ray.o, ray.d, eye_depth(pixel.at));
    ray.end = min(ray.end, surface.z);
    ray.t_out = max(min(ray.t_out, surface.z), ray.t_in);
#endif
    var walk = start_walk(ray, TURNS_A_SAMPLE);
    var color = vec3<f32>(0.0);
    // Transmittance to the eye.
    var left = 1.0;
#ifdef LIGHT_FACTOR
    if frame.adds == 1u { color = picture[index].rgb; }
#endif
#ifdef RESUMABLE
    let resume = resumption.resume[index];
    if resume == FAR { return; }
    var lookups = 0u;
    var interrupted = false;
    if resume != -FAR {
        color = picture[index].rgb;
        left = picture[index].a;
        walk.k = resume;
    }
#endif
#ifdef SHADOWS
    var run = Run(0u, 0.0, 0.0, 0.0, 0.0, vec3<f32>(0.0), vec3<f32>(0.0), FAR, false);
    // The light at `lit_t`.
    var lit = 1.0;
    var lit_t = -FAR;
    loop {
#ifdef RESUMABLE
        if !walk.found && run.parts == 0u && lookups >= MOST_LOOKUPS && walk.walking {
            interrupted = true;
            break;
        }
#endif
        gather(&run, &walk, &left, ray);
        if run.closing {
#ifdef RESUMABLE
            lookups += 1u;
#endif
            // One lookup a turn: where the start of a run has no light yet, that is this turn's.
            let fresh = lit_t != run.start && run.seen > FAINT_RUN;
            count_work(LOOKUPS, 1u);
            let light_here = light_at(ray.o + select(run.end, run.start, fresh) * ray.d);
            if fresh {
                lit = light_here;
                lit_t = run.start;
            } else {
                lit = select(light_here, lit, lit_t == run.start);
#ifdef LIGHT_FACTOR
                let light = frame.light * mean_light(lit, light_here, max(run.depth, 1e-12));
#else
                let light = (1.0 - frame.ambient) * mean_light(lit, light_here, max(run.depth, 1e-12));
#endif
#ifdef SHADED
                color += frame.ambient * run.color + light * run.shaded;
                run.shaded = vec3<f32>(0.0);
#else
                color += (frame.ambient + light) * run.color;
#endif
                run.color = vec3<f32>(0.0);
                run.depth = 0.0;
                run.seen = 0.0;
                run.parts = 0u;
                run.closing = false;
                lit = light_here;
                lit_t = run.end;
            }
        }
        var over = !run.closing && run.parts == 0u && (left < EYE_OVER || !(walk.found || walk.walking));
#ifdef MESH
        // The surface behind is a run of its own, without a length.
        if over && surface.met && left >= EYE_OVER {
            surface.met = false;
            run.start = surface.z;
            run.end = surface.z;
            run.color = left * surface.color;
            run.shaded = left * surface.color * surface.cosine;
            run.parts = 1u;
            run.closing = true;
            left = 0.0;
            over = false;
        }
#endif
        if over { break; }
    }
#else
    loop {
        walk_on(&walk, ray);
        if walk.found {
            walk.found = false;
            let to = sample_depth(ray, walk.k);
#ifdef SHADING
            let middle = seen_value_at(ray.o + 0.5 * (walk.from_t + to) * ray.d);
            var mean = mean_over(walk.from_value, walk.value);
            if frame.shading_weight > 0.0 { mean = mean_by(walk.from_value, middle, walk.value); }
#else
            let mean = mean_over(walk.from_value, walk.value);
#endif
            let alpha = 1.0 - exp(-mean.w * (to - walk.from_t));
            var light = 1.0;
#ifdef SHADING
            light = shading_factor(ray.o + 0.5 * (walk.from_t + to) * ray.d, ray.d);
#endif
#ifdef LIGHT_FACTOR
            color += left * alpha * mean.rgb / max(mean.w, 1e-30) * (frame.ambient + frame.light * light);
#else
            color += left * alpha * mean.rgb / max(mean.w, 1e-30) * (frame.ambient + (1.0 - frame.ambient) * light);
#endif
            left *= 1.0 - alpha;
        }
        if left < EYE_OVER || !walk.walking { break; }
    }
#ifdef MESH
    if surface.met {
#ifdef LIGHT_FACTOR
        color += left * surface.color * (frame.ambient + frame.light * surface.cosine);
#else
        color += left * surface.color * (frame.ambient + (1.0 - frame.ambient) * surface.cosine);
#endif
        left = 0.0;
    }
#endif
#endif
    add_work();
    // Some adapters end loops that they find long, and say nothing.
#ifdef RESUMABLE
    if exhausted(walk) || (walk.walking && left >= EYE_OVER && !interrupted) { ran_out(); }
#else
    if exhausted(walk) || (walk.walking && left >= EYE_OVER) { ran_out(); }
#endif
#ifdef RESUMABLE
    if interrupted {
        picture[index] = vec4<f32>(color, left);
        resumption.resume[index] = walk.k;
        atomicAdd(&resumption.unfinished, 1u);
        return;
    }
    resumption.resume[index] = FAR;
#endif
    picture[index] = vec4<f32>(color + left * frame.background, 1.0 - left);
}
