// The lattice of a light volume: nodes `scale` voxels apart along each axis of the grid, over the box of the active bricks.
#define_import_path umbravox::lattice

#import umbravox::field::field
#import umbravox::light::{light, light_point, light_ray}

struct Lattice {
    // Grid-space place of the first node, and grid units from one to the next.
    first: vec3<f32>,
    scale: f32,
    // Nodes along each axis, two at least.
    counts: vec3<u32>,
    // Optical depth that is kept at most.
    most_depth: f32,
}

@group(1) @binding(1) var<uniform> lattice: Lattice;

// From a grid-space point to the light.
struct TowardLight {
    // Grid units per mm.
    d: vec3<f32>,
    // How far it is, mm.
    mm: f32,
}

fn toward_light(g: vec3<f32>) -> TowardLight {
    let p = light_point(g);
    return TowardLight(-light_ray(p.texel).d, p.z + light.light_distance);
}

// Nodes beyond the box of the active bricks stand for its sides: rays beside it would meet nothing.
fn node_place(node: vec3<u32>) -> vec3<f32> {
    return clamp(lattice.first + lattice.scale * vec3<f32>(node), field.active_lo, field.active_hi);
}

// What is kept of an optical depth: itself (in 8 bits a share of the most), or the transmittance.
fn kept(optical_depth: f32) -> f32 {
#ifdef KEEPS_DEPTH
    let depth = min(optical_depth, lattice.most_depth);
#ifdef BITS_8
    return depth / lattice.most_depth;
#else
    return depth;
#endif
#else
    return exp(-optical_depth);
#endif
}

// Transmittance by what a filter makes of what is kept.
fn transmittance_of(filtered: f32) -> f32 {
#ifdef KEEPS_DEPTH
#ifdef BITS_8
    return exp(-filtered * lattice.most_depth);
#else
    return exp(-filtered);
#endif
#else
    return filtered;
#endif
}
