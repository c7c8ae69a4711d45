//! Bounding volume hierarchy (BVH) over the triangles of a mesh, in float64, and its ray queries.
//!
//! Intersections use the signs of edge functions about the ray (Woop, Benthin and Wald 2013, *Watertight Ray/Triangle
//! Intersection*). The two triangles at an edge get consistent results, so no ray passes between them.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use bvh::flat_bvh::FlatNode as CrateNode;
use glam::DVec3;
use nalgebra::Point3;
use rayon::prelude::*;

/// Intersection of a ray with a triangle of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Depth of the intersection along the ray, mm.
    pub depth_mm: f64,
    /// Index of the intersected triangle of the mesh.
    pub triangle: usize,
}

/// Node of a flattened bounding volume hierarchy over the triangles of a mesh: a box or a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatNode {
    /// Bounding box of the node of a bounding volume hierarchy, world mm.
    pub bounds: [DVec3; 2],
    /// Index of the triangle of a leaf node in a bounding volume hierarchy. `None` for an inner node, whose children
    /// follow it in the list.
    pub triangle: Option<u32>,
    /// Index of the hierarchy node to visit next if the ray misses the bounding box, or after a triangle was tested.
    pub next: u32,
}

/// Bounding box of a triangle while the bounding volume hierarchy is built.
struct TriangleBox {
    bounds: Aabb<f64, 3>,
    node: usize,
}

impl Bounded<f64, 3> for TriangleBox {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.bounds
    }
}

impl BHShape<f64, 3> for TriangleBox {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn point(p: DVec3) -> Point3<f64> {
    Point3::new(p.x, p.y, p.z)
}

fn vector(p: &Point3<f64>) -> DVec3 {
    DVec3::new(p.x, p.y, p.z)
}

fn bounds([a, b, c]: &[DVec3; 3]) -> [DVec3; 2] {
    [a.min(*b).min(*c), a.max(*b).max(*c)]
}

/// Bounding volume hierarchy over triangles. It does not store the triangles, so callers pass them to each query.
pub(super) struct Tree(Bvh<f64, 3>);

/// Ray that is prepared for intersection tests with triangles: axes permuted so that z is its longest component, and
/// the shear that aligns it with z.
struct ShearedRay {
    origin: DVec3,
    inverse: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl ShearedRay {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let d = direction.to_array();
        let z = (0..3).max_by(|a, b| d[*a].abs().total_cmp(&d[*b].abs())).unwrap_or(2);
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = DVec3::new(d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]);
        Self { origin, inverse: direction.recip(), axes, shear }
    }

    /// Returns the depth at which the ray meets a triangle; `None` if it misses.
    fn depth(&self, triangle: &[DVec3; 3]) -> Option<f64> {
        let sheared = |p: &DVec3| {
            let p = (*p - self.origin).to_array();
            let [x, y, z] = self.axes.map(|axis| p[axis]);
            DVec3::new(x - self.shear.x * z, y - self.shear.y * z, z * self.shear.z)
        };
        let [a, b, c] = [&triangle[0], &triangle[1], &triangle[2]].map(sheared);
        let edges = DVec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        let sum = edges.element_sum();
        let one_side = edges.min_element() >= 0.0 || edges.max_element() <= 0.0;
        (one_side && sum != 0.0).then(|| edges.dot(DVec3::new(a.z, b.z, c.z)) / sum)
    }

    /// Whether the ray passes through a slightly enlarged bounding box between two depths.
    fn passes(&self, bounds: &Aabb<f64, 3>, [from, to]: [f64; 2]) -> bool {
        let near = (vector(&bounds.min) - self.origin) * self.inverse;
        let far = (vector(&bounds.max) - self.origin) * self.inverse;
        // NaN where the ray lies within a face; `max` and `min` ignore it.
        let enters = near.min(far).to_array().into_iter().fold(from, f64::max);
        let leaves = near.max(far).to_array().into_iter().fold(to, f64::min);
        enters <= leaves + 1e-12 * (enters.abs() + leaves.abs())
    }
}

impl Tree {
    pub(super) fn new(triangles: &[[DVec3; 3]]) -> Self {
        let shape = |t: &[DVec3; 3]| {
            let [lo, hi] = bounds(t).map(point);
            TriangleBox { bounds: Aabb::with_bounds(lo, hi), node: 0 }
        };
        let mut shapes: Vec<_> = triangles.par_iter().map(shape).collect();
        Self(Bvh::build(&mut shapes))
    }

    /// Calls `take` for each triangle that a ray meets. `take` returns the depth beyond which later hits are ignored,
    /// or `None` to stop.
    pub(super) fn visit(
        &self,
        triangles: &[[DVec3; 3]],
        [origin, direction]: [DVec3; 2],
        [from, mut to]: [f64; 2],
        mut take: impl FnMut(Hit) -> Option<f64>,
    ) {
        let ray = ShearedRay::new(origin, direction);
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            match self.0.nodes.get(node) {
                Some(BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. }) => {
                    let children = [(child_l_index, child_l_aabb), (child_r_index, child_r_aabb)];
                    let passed = children.into_iter().filter(|(_, bounds)| ray.passes(bounds, [from, to]));
                    open.extend(passed.map(|(index, _)| *index));
                }
                Some(&BvhNode::Leaf { shape_index: triangle, .. }) => {
                    let depth = ray.depth(&triangles[triangle]).filter(|z| *z > from && *z < to);
                    let Some(depth_mm) = depth else { continue };
                    match take(Hit { depth_mm, triangle }) {
                        Some(nearer) => to = nearer,
                        None => return,
                    }
                }
                None => {}
            }
        }
    }

    /// Flattens the bounding volume hierarchy to a list for stackless traversal in shaders.
    pub(super) fn flat(&self, triangles: &[[DVec3; 3]]) -> Vec<FlatNode> {
        let node = |CrateNode { aabb, entry_index, exit_index, shape_index }: CrateNode<f64, 3>| {
            // The crate's leaves have no boxes.
            let triangle = (entry_index == u32::MAX).then_some(shape_index);
            let of_box = [vector(&aabb.min), vector(&aabb.max)];
            let bounds = triangle.map_or(of_box, |t| bounds(&triangles[t as usize]));
            FlatNode { bounds, triangle, next: exit_index }
        };
        self.0.flatten().into_iter().map(node).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mesh, MeshPart, files};
    use super::*;

    /// Builds a triangulated sphere from a grid of `2 n` by `n` quads.
    pub(super) fn sphere(center: DVec3, radius: f64, n: usize) -> Vec<[DVec3; 3]> {
        // Equal corners have equal numbers, so that the surface is closed.
        let at = |i: usize, j: usize| {
            let [phi, theta] = [i % (2 * n), j].map(|k| std::f64::consts::PI * k as f64 / n as f64);
            let ring = if j.is_multiple_of(n) { 0.0 } else { theta.sin() };
            center + radius * DVec3::new(ring * phi.cos(), ring * phi.sin(), theta.cos())
        };
        let quads = (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j)));
        quads
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, d, c], [a, c, b]]
            })
            .collect()
    }

    fn part(triangles: Vec<[DVec3; 3]>, grey: f64) -> MeshPart {
        MeshPart { source: "test".into(), color: [grey; 3], triangles }
    }

    fn mesh(triangles: Vec<[DVec3; 3]>) -> Mesh {
        Mesh::new(vec![part(triangles, 1.0)]).unwrap()
    }

    #[test]
    fn rays_meet_the_same_triangles_with_and_without_the_tree() {
        let triangles = sphere(DVec3::new(3.0, -2.0, 1.0), 5.0, 24);
        let mesh = mesh(triangles);
        let flat = mesh.flat_tree();
        for i in 0..2000u32 {
            let share = |rate: f64| 2.0 * (f64::from(i) * rate).fract() - 1.0;
            let origin = 9.0 * DVec3::new(share(0.618_034), share(0.754_878), share(0.569_840));
            let direction = DVec3::new(share(0.324_718), share(0.410_245), share(0.220_744)).normalize();
            let ray = ShearedRay::new(origin, direction);
            let all = mesh.triangles().iter().enumerate().filter_map(|(triangle, corners)| {
                let depth_mm = ray.depth(corners).filter(|z| *z > 0.0)?;
                Some(Hit { depth_mm, triangle })
            });
            let nearest = all.min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
            let found = mesh.first_hit(origin, direction, [0.0, f64::INFINITY]);
            assert_eq!(found.map(|h| h.depth_mm), nearest.map(|h| h.depth_mm));
            assert_eq!(mesh.is_hit(origin, direction, [0.0, f64::INFINITY]), nearest.is_some());
            // The list is traversed as in shaders.
            let mut at = 0;
            let mut met = false;
            while let Some(node) = flat.get(at) {
                at = match node.triangle {
                    Some(t) => {
                        met |= ray.depth(&mesh.triangles()[t as usize]).is_some_and(|z| z > 0.0);
                        node.next as usize
                    }
                    None => {
                        let bounds = Aabb::with_bounds(point(node.bounds[0]), point(node.bounds[1]));
                        if ray.passes(&bounds, [0.0, f64::INFINITY]) { at + 1 } else { node.next as usize }
                    }
                };
            }
            assert_eq!(met, nearest.is_some());
        }
    }

    /// Every ray from inside a closed mesh hits it, also through corners and along edges.
    #[test]
    fn rays_hit_a_closed_mesh_at_edges_and_corners() {
        let mesh = mesh(sphere(DVec3::ZERO, 5.0, 12));
        let corners = mesh.triangles().iter().flatten().copied();
        let middles = mesh.triangles().iter().map(|[a, b, _]| 0.5 * (*a + *b));
        for target in corners.chain(middles) {
            for origin in [DVec3::ZERO, DVec3::new(0.1, 0.2, -0.3)] {
                let direction = (target - origin).normalize();
                let hit = mesh.first_hit(origin, direction, [0.0, f64::INFINITY]).expect("it is closed");
                assert!((origin + hit.depth_mm * direction).distance(target) < 1e-9);
            }
        }
    }

    #[test]
    fn a_single_triangle_and_many_on_one_place_have_trees() {
        let one = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for copies in [1, 2, 1000] {
            let mesh = mesh(vec![one; copies]);
            let hit = mesh.first_hit(DVec3::new(0.2, 0.2, 3.0), DVec3::NEG_Z, [0.0, 10.0]).unwrap();
            assert_eq!(hit.depth_mm, 3.0);
            assert!(mesh.first_hit(DVec3::new(0.2, 0.2, 3.0), DVec3::NEG_Z, [0.0, 3.0]).is_none());
            assert_eq!(mesh.flat_tree().iter().filter(|n| n.triangle.is_some()).count(), copies);
        }
        assert!(Mesh::new(vec![part(vec![[DVec3::ZERO; 3]], 1.0)]).is_err());
        let two = Mesh::new(vec![part(vec![one; 3], 1.0), part(vec![one, [DVec3::Z; 3]], 0.5)]).unwrap();
        assert_eq!([2, 3].map(|t| two.color(t)[0]), [1.0, 0.5]);
        assert_eq!((two.triangles().len(), two.left_out()), (4, 1));
        assert!(files::MESH_EXTENSIONS.contains(&"stl"));
    }
}
