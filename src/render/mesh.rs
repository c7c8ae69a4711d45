//! Triangle mesh on the graphics device: its triangles and their bounding volume hierarchy, in grid space.

use crate::error::Result;
use crate::field::grid_from_world;
use crate::gpu::{Constant, Gpu, Group, ShaderVariant, Slot, StorageBuffer};
use crate::mesh::{Mesh, SURFACE_GAP};
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3};
use std::sync::{Arc, Mutex, PoisonError};

/// Marker in a node of a mesh's bounding volume hierarchy without a triangle, in place of the triangle's index.
const NO_TRIANGLE: u32 = u32::MAX;
/// Margin around the boxes of a mesh's bounding volume hierarchy, for the float32 errors of rays. It is relative to
/// the largest coordinate: 2^-19.
const ROUNDING: f64 = 1.0 / 524_288.0;

/// Node of a mesh's bounding volume hierarchy on the device: `Node` of `shaders/render/mesh/tree.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Node {
    lo: [f32; 3],
    triangle: u32,
    hi: [f32; 3],
    next: u32,
}

/// Triangle of a mesh on the device: `Triangle` of `shaders/render/mesh/tree.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Triangle {
    a: [f32; 4],
    b: [f32; 4],
    c: [f32; 4],
    color: [f32; 4],
}

/// Cache of the bind group of the last mesh, with the grid of the volume in whose coordinates the mesh is stored.
#[derive(Default)]
pub(super) struct MeshCache(Mutex<Option<(Arc<Mesh>, DAffine3, Group)>>);

impl MeshCache {
    /// Returns bind group 3, which holds the triangles of a mesh in the grid space of a volume (voxel index plus
    /// one).
    ///
    /// # Errors
    /// The adapter cannot bind so many triangles.
    pub fn group(&self, gpu: &Gpu, mesh: &Arc<Mesh>, volume: &Volume) -> Result<Group> {
        let grid_from_world = grid_from_world(volume);
        let mut cached = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*cached {
            Some((known, grid, group)) if known == mesh && *grid == grid_from_world => Ok(group.clone()),
            _ => {
                let made = mesh_group(gpu, mesh, &grid_from_world)?;
                *cached = Some((Arc::clone(mesh), grid_from_world, made.clone()));
                Ok(made)
            }
        }
    }
}

/// Uploads a triangle mesh, and creates bind group 3 for it.
fn mesh_group(gpu: &Gpu, mesh: &Mesh, grid_from_world: &DAffine3) -> Result<Group> {
    let corner = |p: DVec3, normal: f64| {
        grid_from_world.transform_point3(p).as_vec3().extend(normal as f32).to_array()
    };
    let triangle = |(number, corners): (usize, &[DVec3; 3])| {
        let [a, b, c] = *corners;
        let normal = mesh.normal(number);
        let [red, green, blue] = mesh.color(number).map(|c| c as f32);
        Triangle {
            a: corner(a, normal.x),
            b: corner(b, normal.y),
            c: corner(c, normal.z),
            color: [red, green, blue, 1.0],
        }
    };
    let triangles: Vec<_> = mesh.triangles().iter().enumerate().map(triangle).collect();
    let bounds_of = |corners: [DVec3; 8]| {
        let largest = corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let slack = DVec3::splat(ROUNDING * largest.max(1.0));
        let [lo, hi] = corners
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], p| [lo.min(*p), hi.max(*p)]);
        [lo - slack, hi + slack]
    };
    let node = |node: crate::mesh::FlatNode| {
        let corners = box_corners(node.bounds);
        let [lo, hi] = bounds_of(corners.map(|p| grid_from_world.transform_point3(p)));
        Node {
            lo: lo.as_vec3().to_array(),
            triangle: node.triangle.unwrap_or(NO_TRIANGLE),
            hi: hi.as_vec3().to_array(),
            next: node.next,
        }
    };
    let nodes: Vec<_> = mesh.flat_tree().into_iter().map(node).collect();
    let nodes = StorageBuffer::from_slice(gpu, "mesh tree", &nodes)?;
    let triangles = StorageBuffer::from_slice(gpu, "mesh triangles", &triangles)?;
    let slots = [(0, &nodes), (1, &triangles)];
    Ok(Group::new(gpu, "mesh", &slots.map(|(at, buffer)| (at, Slot::read(buffer.as_entire_binding())))))
}

pub(super) fn box_corners([lo, hi]: [DVec3; 2]) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let side = |bit: usize, axis: usize| if i & bit == 0 { lo[axis] } else { hi[axis] };
        DVec3::new(side(1, 0), side(2, 1), side(4, 2))
    })
}

/// Adds the intersection of rays with a triangle mesh to the shader that casts eye rays.
pub(super) fn with_mesh(shader: ShaderVariant, shadows: bool) -> ShaderVariant {
    let constants =
        [Constant::unsigned("NO_TRIANGLE", NO_TRIANGLE), Constant::float("SURFACE_GAP", SURFACE_GAP as f32)];
    let shader = shader.modules(&["render/mesh/tree.wgsl", "render/mesh/surface.wgsl"]).constants(&constants);
    shader.modules(if shadows { &["render/mesh/light.wgsl"] } else { &[] }).defs(["MESH", "SHADED"])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn trees_have_one_layout() {
        let shader = crate::render::shaders(None).into_iter().find(|s| s.defs.contains(&"MESH")).unwrap();
        assert_layout!(&shader, "Node", Node: lo, triangle, hi, next);
        assert_layout!(&shader, "Triangle", Triangle: a, b, c, color);
    }
}
