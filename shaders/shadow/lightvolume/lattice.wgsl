// Lattice of a light volume: nodes `scale` voxels apart along each axis of the grid, over the box of the active
// bricks.
#define_import_path umbravox::lattice

#import umbravox::field::field

struct Lattice {
    // Grid-space position of the first node, and grid units from one node to the next.
    first: vec3<f32>,
    scale: f32,
    // Number of lattice nodes along each axis, at least two.
    counts: vec3<u32>,
    // Largest optical depth that a node stores.
    max_depth: f32,
}

@group(1) @binding(1) var<uniform> lattice: Lattice;

// Returns the grid-space position of a lattice node. Nodes outside the box of the active bricks are moved to its
// sides, since rays outside it meet no extinction.
fn node_position(node: vec3<u32>) -> vec3<f32> {
    return clamp(lattice.first + lattice.scale * vec3<f32>(node), field.active_lo, field.active_hi);
}

// Returns the lattice coordinates of a grid-space point, linear between the positions of two nodes.
fn lattice_coordinates(g: vec3<f32>) -> vec3<f32> {
    let most = vec3<f32>(lattice.counts) - 2.0;
    let low = clamp(floor((g - lattice.first) / lattice.scale), vec3<f32>(0.0), most);
    let behind = node_position(vec3<u32>(low));
    let ahead = node_position(vec3<u32>(low) + 1u);
    return low + clamp((g - behind) / max(ahead - behind, vec3<f32>(1e-6)), vec3<f32>(0.0), vec3<f32>(1.0));
}

// Returns the value that a node stores for an optical depth: the depth itself (in 8 bits, a fraction of the largest),
// or the transmittance.
fn stored_light(optical_depth: f32) -> f32 {
#ifdef STORES_DEPTH
    let depth = min(optical_depth, lattice.max_depth);
#ifdef BITS_8
    return depth / lattice.max_depth;
#else
    return depth;
#endif
#else
    return exp(-optical_depth);
#endif
}

// Returns the transmittance for a filtered value of the light volume.
fn transmittance_of(filtered: f32) -> f32 {
#ifdef STORES_DEPTH
#ifdef BITS_8
    return exp(-filtered * lattice.max_depth);
#else
    return exp(-filtered);
#endif
#else
    return filtered;
#endif
}
