// Opaque triangles in grid space, and the traversal of a bounding volume hierarchy over them.
//
// The hierarchy is a list that needs no stack: the content of a box follows it, and every node names the next node
// for rays that miss its box, and after a triangle. Triangles are tested by the signs of edge functions about the ray
// (Woop, Benthin and Wald 2013): both triangles of an edge decide alike, so that no ray passes between them.
#define_import_path umbravox::mesh

#import umbravox::field::FAR
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_work, LOADS}

struct Node {
    lo: vec3<f32>,
    // Index of the node's triangle, or NO_TRIANGLE for a box.
    triangle: u32,
    hi: vec3<f32>,
    next: u32,
}

struct Triangle {
    // Corners of the triangle in grid space (xyz), and its unit normal in world space (the w components).
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    // Colour of the triangle, linear RGB.
    color: vec4<f32>,
}

const NO_TRIANGLE: u32 = #{NO_TRIANGLE};

@group(3) @binding(0) var<storage, read> mesh_nodes: array<Node>;
@group(3) @binding(1) var<storage, read> mesh_triangles: array<Triangle>;

struct MeshHit {
    // Depth of the hit along the ray, mm; FAR for no hit.
    z: f32,
    triangle: u32,
}

// Returns the unit normal of a triangle in world space; the order of the corners gives its sign.
fn mesh_normal(triangle: u32) -> vec3<f32> {
    let t = mesh_triangles[triangle];
    return vec3<f32>(t.a.w, t.b.w, t.c.w);
}

// Returns the linear RGB colour of a triangle.
fn mesh_color(triangle: u32) -> vec3<f32> {
    return mesh_triangles[triangle].color.rgb;
}

// Permutes the axes so that `axis`, along which the ray advances most, becomes the third.
fn along_ray(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, axis == 1u), v.yzx, axis == 0u);
}

// Returns twice the signed area of the triangle of the origin, p and q. Both points are ordered first, so that
// edge(q, p) is -edge(p, q) to the bit also if the compiler fuses one product of the difference.
fn edge(p: vec2<f32>, q: vec2<f32>) -> f32 {
    let turned = p.x > q.x || (p.x == q.x && p.y > q.y);
    let a = select(p, q, turned);
    let b = select(q, p, turned);
    let area = a.x * b.y - a.y * b.x;
    return select(area, -area, turned);
}

// Returns the nearest triangle on the ray o + z d between two depths; with `any_hit`, the first hit in the list.
fn mesh_hit(o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32, any_hit: bool) -> MeshHit {
    let size = abs(d);
    let axis = select(select(2u, 1u, size.y >= size.z), 0u, size.x >= size.y && size.x >= size.z);
    let turned = along_ray(d, axis);
    let shear = vec3<f32>(turned.xy, 1.0) / turned.z;
    // Finite where the ray does not move along an axis.
    let inv_d = 1.0 / select(d, vec3<f32>(1e-20), size < vec3<f32>(1e-20));
    var hit = MeshHit(FAR, NO_TRIANGLE);
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
                hit = MeshHit(z, node.triangle);
                to = z;
            }
        }
        at = select(node.next, at + 1u, is_box && !missed);
        if at >= nodes || (any_hit && hit.triangle != NO_TRIANGLE) { break; }
    }
    if at < nodes && !(any_hit && hit.triangle != NO_TRIANGLE) { report_iteration_limit(); }
    return hit;
}
