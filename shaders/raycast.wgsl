// The ray caster: pre-integrated extinction along eye rays, brick skipping, early end, shadows through one lookup.

#import umbravox::field::{field, value_at, brick_distance_at, safe_inverse, box_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::transfer::{integral_at, mean_over}
#ifdef SHADOWS
#import umbravox::method::transmittance
#endif
#ifdef SHADING
#import umbravox::light::{LightSpace, light_point, light_ray}
#endif

struct Frame {
    // Grid-space centre of a plane across the view near the volume (keeps float32 rays exact for far eyes).
    plane_center: vec3<f32>,
    plane_distance_mm: f32,
    // Grid units per mm along the camera's axes.
    grid_forward: vec3<f32>,
    step_mm: f32,
    grid_right: vec3<f32>,
    ambient: f32,
    grid_up: vec3<f32>,
    // First row of this band of the picture.
    first_row: u32,
    background: vec3<f32>,
    rows: u32,
    // Half extents of the picture at unit distance: (W/H) tan(fov/2), tan(fov/2).
    half_extent: vec2<f32>,
    size: vec2<u32>,
    // World mm per grid unit (columns), for shading.
    world_x: vec3<f32>,
    // 1 where the shading counts, 0 where it is only computed (forced).
    shading_weight: f32,
    world_y: vec3<f32>,
    // First column of this part of the band.
    first_column: u32,
    world_z: vec3<f32>,
    padding_c: f32,
}

#ifdef LIVE
@group(2) @binding(0) var<storage, read> frame: Frame;
#else
@group(2) @binding(0) var<uniform> frame: Frame;
#endif
@group(2) @binding(1) var<storage, read_write> picture: array<vec4<f32>>;
#ifdef RESUMABLE
// A picture made in several dispatches, since one would loop longer than some adapters allow (software ones end every
// loop of an invocation after 65,536 turns in all).
struct Progress {
    // Pixels that are not finished.
    unfinished: atomic<u32>,
    // The sample to go on from, a pixel: -FAR before the first dispatch, FAR when the pixel is finished.
    resume: array<f32>,
}
@group(2) @binding(2) var<storage, read_write> progress: Progress;
// Shadow lookups a pixel and dispatch.
const LOOKUPS: u32 = 8u;
#endif
#ifdef SHADING
#ifndef SHADOWS
#ifdef LIVE
@group(1) @binding(0) var<storage, read> shading_light: LightSpace;
#else
@group(1) @binding(0) var<uniform> shading_light: LightSpace;
#endif
#else
#import umbravox::method::light as shading_light
#endif
#endif

// Transmittance below which the eye ray is over.
const EYE_OVER: f32 = 5e-4;
// Optical depth of the parts of a stretch that is thicker than `THICKEST_PART`.
const LIT_DEPTH: f32 = 0.75;
const THICKEST_PART: f32 = 1.0;
const MAX_PARTS: f32 = 16.0;
// A run of parts shares its lookups until it has so many parts or such optical depth.
const RUN_PARTS: u32 = 4u;
const FULL_RUN: f32 = 0.25;
// Optical depth of a run whose start may be lit as its end is.
const FAINT_RUN: f32 = 0.05;
const DARKEST: f32 = 1e-6;

#ifdef SHADING
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
    let l = -normalize(to_world * light_ray(shading_light, light_point(shading_light, g).texel).d);
    let diffuse = abs(dot(n, l));
#ifdef BLINN_PHONG
    let h = normalize(l - normalize(to_world * eye_direction));
    let factor = diffuse + 0.3 * pow(abs(dot(n, h)), 32.0);
#else
    let factor = diffuse;
#endif
    return select(1.0, mix(1.0, factor, frame.shading_weight), size > 0.0);
}
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

#ifdef SKIP_BRICKS
fn brick_at(g: vec3<f32>) -> vec3<i32> {
    return clamp(vec3<i32>(floor(g)), vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
}
#endif

@compute @workgroup_size(8, 8)
fn raycast(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x + frame.first_column;
    if column >= frame.size.x || id.y >= frame.rows { return; }
    let pixel = vec2<f32>(vec2<u32>(column, id.y + frame.first_row));
    let ndc = (2.0 * (pixel + 0.5) / vec2<f32>(frame.size) - 1.0) * vec2<f32>(1.0, -1.0) * frame.half_extent;
    let across = ndc.x * frame.grid_right + ndc.y * frame.grid_up;
    let slant = sqrt(1.0 + dot(ndc, ndc));
    // Depth along the ray in mm, 0 where it crosses the plane.
    let o = frame.plane_center + frame.plane_distance_mm * across;
    let d = (frame.grid_forward + across) / slant;
    let inv_d = safe_inverse(d);
    let domain = box_span(o, inv_d, d, vec3<f32>(0.5), vec3<f32>(field.size) + 0.5);
    let t_in = max(domain.x, -frame.plane_distance_mm * slant);
    let t_out = domain.y;
    let index = id.y * frame.size.x + column;
    var color = vec3<f32>(0.0);
    // Transmittance to the eye.
    var left = 1.0;
#ifdef RESUMABLE
    let resume = progress.resume[index];
    if resume == FAR { return; }
    var lookups = 0u;
    var interrupted = false;
    if resume != -FAR {
        color = picture[index].rgb;
        left = picture[index].a;
    }
#endif
#ifdef SKIP_BRICKS
    let occupied = box_span(o, inv_d, d, field.active_lo, field.active_hi);
    let start = max(occupied.x, t_in);
    let end = min(occupied.y, t_out);
    let forward = d > vec3<f32>(0.0);
    let moves = abs(d) >= vec3<f32>(1e-20);
#else
    let start = t_in;
    let end = t_out;
#endif
    // Samples sit on the lattice t = k step, whatever is skipped, and on the ends of the domain.
    let h = frame.step_mm;
    var k = floor(start / h);
    var walking = start < end;
    // The last sample and its value; `valid`: there is one.
    var b = t_in;
    var value_b = 0.0;
    var valid = false;
#ifdef SKIP_BRICKS
    // The last sample that was leapt over comes next, since the stretch behind it has extinction.
    var stepped_back = false;
    var leapt = false;
    // The last sample lies in an inactive brick.
    var leaving = false;
#endif
    // The part of the stretch that is not gathered yet starts at u.
    var u = 0.0;
    var value_u = 0.0;
    var found = false;
#ifdef SHADOWS
    // Length of a stretch's parts where it is too thick to be lit as a whole.
    var part_mm = FAR;
    // The run of gathered parts that waits for its light: its ends, optical depth and colour.
    var run = 0u;
    var run_start = 0.0;
    var run_end = 0.0;
    var run_depth = 0.0;
    var run_color = vec3<f32>(0.0);
#ifdef SHADING
    var run_shaded = vec3<f32>(0.0);
#endif
    var closing = false;
    // The light at `lit_t`.
    var lit = 1.0;
    var lit_t = -FAR;
#endif
#ifdef RESUMABLE
    if resume != -FAR {
        k = resume;
#ifdef SKIP_BRICKS
        stepped_back = true;
#endif
    }
#endif
    // An inner loop walks to the next stretch with extinction, the one around it gathers one part of a stretch a turn, and
    // the outer one looks the light up once for a run of parts: what is expensive stands in the program once, and lanes
    // of a subgroup wait for each other only there.
    loop {
#ifdef RESUMABLE
        if !found && run == 0u && lookups >= LOOKUPS && walking {
            interrupted = true;
            break;
        }
#endif
#ifdef SHADOWS
        loop {
            if closing { break; }
            loop {
                if found || !walking { break; }
                let t = clamp(k * h, t_in, t_out);
                let g = o + t * d;
#ifdef SKIP_BRICKS
                let brick = brick_at(g);
                let distance = brick_distance_at(brick);
                if distance > 0 && (leaving || !valid) && !stepped_back {
                    // Past the last sample inside the cube of empty bricks. A stretch between two inactive bricks is empty
                    // as well: they touch, and so share a value.
                    let reach = distance - 1;
                    let face = select((brick - reach) * BRICK_CELLS, (brick + reach + 1) * BRICK_CELLS, forward);
                    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - o) * inv_d, moves);
                    let exit = min(exits.x, min(exits.y, exits.z));
                    // Rounding may put the last face before the end for ever; the sample itself has passed it.
                    walking = max(exit, t) < end;
                    k = max(floor(exit / h), k) + 1.0;
                    leapt = true;
                    valid = false;
                    continue;
                }
                if leapt {
                    leapt = false;
                    stepped_back = true;
                    k -= 1.0;
                    continue;
                }
#endif
                let value = value_at(g);
                if valid && min(value_b, value) < field.last_value && max(value_b, value) > field.first_value {
                    found = true;
                    u = b;
                    value_u = value_b;
                }
                b = t;
                value_b = value;
                walking = t < end;
                k += 1.0;
#ifdef SKIP_BRICKS
                // A sample in an inactive brick may still start a stretch into the next, active one.
                leaving = distance > 0 && !stepped_back;
                stepped_back = false;
#endif
                valid = true;
            }
            // A run ends where the extinction does, and at the end of the ray.
            closing = run > 0u && (!found || u != run_end);
            if closing || !found { break; }
            let to = select(u + part_mm, b, u + 1.5 * part_mm > b);
            let value_to = mix(value_u, value_b, select((to - u) / (b - u), 1.0, to == b));
            let mean = mean_over(value_u, value_to, integral_at(value_u), integral_at(value_to));
            let depth = mean.w * (to - u);
            if depth > THICKEST_PART && part_mm == FAR {
                part_mm = (to - u) / clamp(ceil(depth / LIT_DEPTH), 1.0, MAX_PARTS);
                continue;
            }
            let begin = u;
            u = to;
            found = to < b;
            part_mm = select(FAR, part_mm, found);
            value_u = value_to;
            let alpha = 1.0 - exp(-depth);
            let emitted = left * alpha * mean.rgb / max(mean.w, 1e-30);
            left *= 1.0 - alpha;
            run_color += emitted;
#ifdef SHADING
            run_shaded += emitted * shading_factor(o + 0.5 * (begin + to) * d, d);
#endif
            // Whether a part without extinction is come upon depends on what is skipped: a run must not.
            if depth > 0.0 {
                run_start = select(run_start, begin, run == 0u);
                run_end = to;
                run_depth += depth;
                run += 1u;
            }
            closing = run >= RUN_PARTS || run_depth >= FULL_RUN || left < EYE_OVER;
        }
        if !closing { break; }
        // One lookup a turn: where the start of a run has no light yet, that is this turn's.
        let fresh = lit_t != run_start && run_depth > FAINT_RUN;
#ifdef RESUMABLE
        lookups += 1u;
#endif
        let light_here = transmittance(o + select(run_end, run_start, fresh) * d);
        if fresh {
            lit = light_here;
            lit_t = run_start;
            continue;
        }
        lit = select(light_here, lit, lit_t == run_start);
        let light = (1.0 - frame.ambient) * mean_light(lit, light_here, max(run_depth, 1e-12));
#ifdef SHADING
        color += frame.ambient * run_color + light * run_shaded;
        run_shaded = vec3<f32>(0.0);
#else
        color += (frame.ambient + light) * run_color;
#endif
        run_color = vec3<f32>(0.0);
        run_depth = 0.0;
        run = 0u;
        closing = false;
        lit = light_here;
        lit_t = run_end;
#else
        loop {
            if found || !walking { break; }
            let t = clamp(k * h, t_in, t_out);
            let g = o + t * d;
#ifdef SKIP_BRICKS
            let brick = brick_at(g);
            let distance = brick_distance_at(brick);
            if distance > 0 && (leaving || !valid) && !stepped_back {
                // Past the last sample inside the cube of empty bricks. A stretch between two inactive bricks is empty
                // as well: they touch, and so share a value.
                let reach = distance - 1;
                let face = select((brick - reach) * BRICK_CELLS, (brick + reach + 1) * BRICK_CELLS, forward);
                let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - o) * inv_d, moves);
                let exit = min(exits.x, min(exits.y, exits.z));
                // Rounding may put the last face before the end for ever; the sample itself has passed it.
                walking = max(exit, t) < end;
                k = max(floor(exit / h), k) + 1.0;
                leapt = true;
                valid = false;
                continue;
            }
            if leapt {
                leapt = false;
                stepped_back = true;
                k -= 1.0;
                continue;
            }
#endif
            let value = value_at(g);
            if valid && min(value_b, value) < field.last_value && max(value_b, value) > field.first_value {
                found = true;
                u = b;
                value_u = value_b;
            }
            b = t;
            value_b = value;
            walking = t < end;
            k += 1.0;
#ifdef SKIP_BRICKS
            // A sample in an inactive brick may still start a stretch into the next, active one.
            leaving = distance > 0 && !stepped_back;
            stepped_back = false;
#endif
            valid = true;
        }
        if !found { break; }
        found = false;
        let mean = mean_over(value_u, value_b, integral_at(value_u), integral_at(value_b));
        let depth = mean.w * (b - u);
        let alpha = 1.0 - exp(-depth);
        var light = 1.0;
#ifdef SHADING
        light = shading_factor(o + 0.5 * (u + b) * d, d);
#endif
        color += left * alpha * mean.rgb / max(mean.w, 1e-30) * (frame.ambient + (1.0 - frame.ambient) * light);
        left *= 1.0 - alpha;
#endif
        if left < EYE_OVER { break; }
    }
#ifdef RESUMABLE
    if interrupted {
        picture[index] = vec4<f32>(color, left);
        progress.resume[index] = k - 1.0;
        atomicAdd(&progress.unfinished, 1u);
        return;
    }
    progress.resume[index] = FAR;
#endif
    picture[index] = vec4<f32>(color + left * frame.background, 1.0 - left);
}
