// The lattice of a light volume: nodes `scale` voxels apart along each axis of the grid, over the box of the active bricks.
#define_import_path umbravox::lattice

#import umbravox::field::field

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

// Nodes beyond the box of the active bricks stand for its sides: rays beside it would meet nothing.
fn node_place(node: vec3<u32>) -> vec3<f32> {
    return clamp(lattice.first + lattice.scale * vec3<f32>(node), field.active_lo, field.active_hi);
}

// Lattice coordinates of a grid-space point: between two nodes by where they stand.
fn lattice_coordinates(g: vec3<f32>) -> vec3<f32> {
    let most = vec3<f32>(lattice.counts) - 2.0;
    let low = clamp(floor((g - lattice.first) / lattice.scale), vec3<f32>(0.0), most);
    let behind = node_place(vec3<u32>(low));
    let ahead = node_place(vec3<u32>(low) + 1u);
    return low + clamp((g - behind) / max(ahead - behind, vec3<f32>(1e-6)), vec3<f32>(0.0), vec3<f32>(1.0));
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
