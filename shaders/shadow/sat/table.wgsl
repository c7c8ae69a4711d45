// Summed-area table of extinction: its cells, and the cuboids of a query.
#define_import_path umbravox::sat_table

struct SummedAreaTable {
    // Grid-space position of the table's first corner, and width of its cells in grid units (voxels).
    first: vec3<f32>,
    scale: f32,
    // Number of cells along each axis.
    counts: vec3<u32>,
    // Extinction (1/mm) of one step of the stored numbers, and the largest number of steps of a cell.
    extinction_step: f32,
    most_steps: f32,
    // Samples of extinction along each side of a cell.
    samples: u32,
    // Number of cuboids of a query, and thickness of each relative to the one before.
    boxes: u32,
    growth: f32,
    // Tangent of half the opening angle of the cone.
    half_tangent: f32,
    // Radius of a disc of light to which the cone widens, mm.
    light_radius_mm: f32,
    // Largest number of cells of a cuboid.
    most_cells: f32,
}

@group(1) @binding(1) var<uniform> table: SummedAreaTable;

// Moves the component of an axis to the last place; the others follow in cyclic order.
fn turned(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, axis == 1u), v.yzx, axis == 0u);
}

fn turned_counts(axis: u32) -> vec3<u32> {
    let n = table.counts;
    return select(select(n.xyz, n.zxy, axis == 1u), n.yzx, axis == 0u);
}

// Returns the distance in the array between neighbouring cells along each axis, turned.
fn turned_strides(axis: u32) -> vec3<u32> {
    let strides = vec3<u32>(1u, table.counts.x, table.counts.x * table.counts.y);
    return select(select(strides.xyz, strides.zxy, axis == 1u), strides.yzx, axis == 0u);
}
