// Opaque triangles in grid space, and rays through the tree of boxes over them.
//
// The tree is a list that is gone through without a stack: what is in a box follows it, and every node says where to go on
// where its box is missed, and after a triangle. Rays meet triangles by signs of edge functions about the ray (Woop, Benthin
// and Wald 2013): both triangles of an edge decide alike, so that no ray slips through between them.
#define_import_path umbravox::mesh

#import umbravox::field::FAR
#import umbravox::watch::ran_out
#import umbravox::work::{count_work, LOADS}

struct Node {
    lo: vec3<f32>,
    // The triangle's number, or NO_TRIANGLE for a box.
    triangle: u32,
    hi: vec3<f32>,
    next: u32,
}

struct Triangle {
    // Corners in grid space; beside them the unit normal in world space.
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    // Linear RGB.
    color: vec4<f32>,
}

const NO_TRIANGLE: u32 = #{NO_TRIANGLE};

@group(3) @binding(0) var<storage, read> mesh_nodes: array<Node>;
@group(3) @binding(1) var<storage, read> mesh_triangles: array<Triangle>;

struct MeshHit {
    // Depth along the ray, mm; FAR where nothing is met.
    z: f32,
    triangle: u32,
}

// Unit normal in world space, by the order of the corners.
fn mesh_normal(triangle: u32) -> vec3<f32> {
    let t = mesh_triangles[triangle];
    return vec3<f32>(t.a.w, t.b.w, t.c.w);
}

// Linear RGB of a triangle.
fn mesh_color(triangle: u32) -> vec3<f32> {
    return mesh_triangles[triangle].color.rgb;
}

// Along the axes of a ray, the one that it goes along most being the third.
fn along_ray(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, axis == 1u), v.yzx, axis == 0u);
}

// Twice the area of the triangle of the origin, p and q, by sign: edge(q, p) is -edge(p, q) to the bit, since both come to
// one order. A compiler may fuse one product of the difference, and so round p before q otherwise than q before p.
fn edge(p: vec2<f32>, q: vec2<f32>) -> f32 {
    let turned = p.x > q.x || (p.x == q.x && p.y > q.y);
    let a = select(p, q, turned);
    let b = select(q, p, turned);
    let area = a.x * b.y - a.y * b.x;
    return select(area, -area, turned);
}

// The nearest triangle on o + z d between two depths; `any`: whichever comes first in the list.
fn mesh_hit(o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32, any_will_do: bool) -> MeshHit {
    let size = abs(d);
    let axis = select(select(2u, 1u, size.y >= size.z), 0u, size.x >= size.y && size.x >= size.z);
    let turned = along_ray(d, axis);
    let shear = vec3<f32>(turned.xy, 1.0) / turned.z;
    // Finite where the ray does not move along an axis.
    let inv_d = 1.0 / select(d, vec3<f32>(1e-20), size < vec3<f32>(1e-20));
    var found = MeshHit(FAR, NO_TRIANGLE);
    var to = z_to;
    let nodes = arrayLength(&mesh_nodes);
    var at = 0u;
    loop {
        let node = mesh_nodes[min(at, nodes - 1u)];
        count_work(LOADS, 1u);
        let near = (node.lo - o) * inv_d;
        let far = (node.hi - o) * inv_d;
        let first = min(near, far);
        let last = max(near, far);
        let enters = max(max(first.x, first.y), max(first.z, z_from));
        let leaves = min(min(last.x, last.y), min(last.z, to));
        let missed = enters > leaves;
        let is_box = node.triangle == NO_TRIANGLE;
        if !is_box && !missed {
            let t = mesh_triangles[node.triangle];
            let p = along_ray(t.a.xyz - o, axis);
            let q = along_ray(t.b.xyz - o, axis);
            let r = along_ray(t.c.xyz - o, axis);
            let a = p.xy - shear.xy * p.z;
            let b = q.xy - shear.xy * q.z;
            let c = r.xy - shear.xy * r.z;
            let edges = vec3<f32>(edge(c, b), edge(a, c), edge(b, a));
            let sum = edges.x + edges.y + edges.z;
            let one_side = all(edges >= vec3<f32>(0.0)) || all(edges <= vec3<f32>(0.0));
            let z = dot(edges, vec3<f32>(p.z, q.z, r.z)) * shear.z / select(sum, 1.0, sum == 0.0);
            if one_side && sum != 0.0 && z > z_from && z < to {
                found = MeshHit(z, node.triangle);
                to = z;
            }
        }
        at = select(node.next, at + 1u, is_box && !missed);
        if at >= nodes || (any_will_do && found.triangle != NO_TRIANGLE) { break; }
    }
    // Some adapters end loops that they find long, and say nothing.
    if at < nodes && !(any_will_do && found.triangle != NO_TRIANGLE) { ran_out(); }
    return found;
}
