//! Lattice of a light volume (grid of light values): positions of its nodes, and the blocks or slices of nodes that a
//! build computes at a time.

use crate::field::{ActiveBricks, BuildContext, grid_from_world};
use crate::scene::Light;
use crate::volume::BRICK_CELLS;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec3};

/// Width in nodes of the cubic blocks of a light volume that one GPU workgroup computes (`build=gather`).
pub const BLOCK: u32 = 4;
/// Number of bits for each axis in the packed coordinates of a block of light volume nodes.
const BLOCK_BITS: u32 = 10;

/// Lattice of the nodes of a light volume, `scale` voxels apart along each axis. It covers the bounding box of all
/// bricks (blocks of voxels) with extinction, and has at least two nodes along each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Position of the light volume's first node in grid space, in which voxels have whole coordinates from 1.
    pub first: DVec3,
    /// Distance between neighbouring nodes of the light volume, in grid units (voxels).
    pub scale: f64,
    /// Number of light volume nodes along each axis.
    pub counts: UVec3,
    /// Lattice coordinates of the least and greatest corner of the box of active bricks. Nodes outside the box are
    /// moved to its sides.
    pub bounds: [DVec3; 2],
}

/// Uniform buffer for one slice that a sweep through a light volume computes; mirrors struct `SweepStep` in
/// `shaders/shadow/lightvolume/sweep.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct SweepStep {
    pub axis: u32,
    pub slice: u32,
    pub down: u32,
    pub opening: u32,
    pub whole: u32,
}

impl Lattice {
    /// Creates the node lattice of a light volume over the bounding box of all bricks (blocks of voxels) with
    /// extinction. The first node lies on a voxel.
    pub fn around(active: &ActiveBricks, dims: [usize; 3], scale: f64) -> Self {
        // Grid space numbers the voxels from 1.
        let [lo, hi] = active.index_box(dims).unwrap_or_default().map(|index| index + 1.0);
        let first = lo.floor();
        let bounds = [lo, hi].map(|corner| (corner - first) / scale);
        let counts = bounds[1].ceil().as_uvec3() + UVec3::ONE;
        Self { first, scale, counts: counts.max(UVec3::splat(2)), bounds }
    }

    /// Returns the number of nodes of the light volume.
    pub fn nodes(&self) -> u64 {
        self.counts.to_array().iter().map(|n| u64::from(*n)).product()
    }

    /// Returns the packed coordinates of the blocks of light volume nodes at or next to bricks (blocks of voxels)
    /// with extinction, as `shaders/shadow/lightvolume/gather.wgsl` reads them.
    pub fn blocks(&self, active: &ActiveBricks) -> Vec<u32> {
        let counts = (self.counts + (BLOCK - 1)) / BLOCK;
        let mut wanted = vec![false; counts.to_array().iter().map(|n| *n as usize).product()];
        let block = |grid: DVec3| {
            let node = (grid - self.first) / self.scale;
            (node.max(DVec3::ZERO).as_uvec3().min(self.counts - 1)) / BLOCK
        };
        for (number, _) in active.distance.iter().enumerate().filter(|(_, distance)| **distance == 0) {
            let [x, y, _] = active.counts;
            let brick = [number % x, number / x % y, number / (x * y)];
            let lo = DVec3::from(brick.map(|b| (b * BRICK_CELLS) as f64));
            // Trilinear filtering reads the nodes on either side.
            let from = block(lo - self.scale);
            let to = block(lo + BRICK_CELLS as f64 + self.scale);
            for z in from.z..=to.z {
                for y in from.y..=to.y {
                    let row = ((z * counts.y + y) * counts.x) as usize;
                    wanted[row + from.x as usize..=row + to.x as usize].fill(true);
                }
            }
        }
        let name = |number: u32| {
            let [x, y, z] = [number % counts.x, number / counts.x % counts.y, number / (counts.x * counts.y)];
            x | y << BLOCK_BITS | z << (2 * BLOCK_BITS)
        };
        (0..).zip(&wanted).filter(|(_, wanted)| **wanted).map(|(number, _)| name(number)).collect()
    }

    /// Returns the slices of every sweep through the light volume, ordered away from the light. A light at infinity
    /// has one sweep, along the axis along which it mainly travels. A point light has one for each side of a cube
    /// around it that faces nodes.
    pub fn steps(&self, context: &BuildContext<'_>) -> Vec<SweepStep> {
        let grid_from_world = grid_from_world(context.volume);
        let counts = self.counts.to_array();
        match context.light {
            Light::Directional { toward } => {
                let toward = (grid_from_world.matrix3 * toward.normalize()).to_array();
                let axis = (0..3).max_by(|a, b| toward[*a].abs().total_cmp(&toward[*b].abs())).unwrap_or(2);
                sweep(axis, toward[axis] > 0.0, 0..counts[axis], true)
            }
            Light::Point { position } => {
                let light = (grid_from_world.transform_point3(position) - self.first) / self.scale;
                let sides = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
                sides.flat_map(|(axis, down)| self.side(light, axis, down)).collect()
            }
        }
    }

    /// Returns the slices of one sweep through the light volume, away from a point light, in the positive or (`down`)
    /// negative direction of an axis. The list is empty if no node lies closer to that axis than to the others.
    fn side(&self, light: DVec3, axis: usize, down: bool) -> Vec<SweepStep> {
        let [low, high] = self.bounds.map(|corner| corner.to_array());
        let light = light.to_array();
        // The device rounds the position of the light.
        let slack = 1e-3;
        let reach = if down { light[axis] - low[axis] } else { high[axis] - light[axis] };
        let aside = |other: usize| (low[other] - light[other]).max(light[other] - high[other]).max(0.0);
        if reach < -slack || (0..3).any(|other| other != axis && aside(other) > reach + slack) {
            return Vec::new();
        }
        let place = |slice: u32| f64::from(slice).clamp(low[axis], high[axis]);
        let is_ahead = |slice: &u32| match down {
            true => place(*slice) <= light[axis] + slack,
            false => place(*slice) >= light[axis] - slack,
        };
        sweep(axis, down, (0..self.counts.to_array()[axis]).filter(is_ahead), false)
    }
}

/// Returns the slices of a light volume along an axis, ordered away from the light.
fn sweep(axis: usize, down: bool, slices: impl Iterator<Item = u32>, whole: bool) -> Vec<SweepStep> {
    let step = |(i, slice): (u32, u32)| SweepStep {
        axis: axis as u32,
        slice,
        down: u32::from(down),
        opening: u32::from(i == 0),
        whole: u32::from(whole),
    };
    let mut order: Vec<u32> = slices.collect();
    if down {
        order.reverse();
    }
    (0..).zip(order).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(counts: [u32; 3]) -> Lattice {
        let bounds = [DVec3::ZERO, (UVec3::from(counts) - 1).as_dvec3()];
        Lattice { first: DVec3::ZERO, scale: 1.0, counts: counts.into(), bounds }
    }

    #[test]
    fn sides_that_face_nodes_are_swept() {
        let lattice = lattice([10, 20, 30]);
        let slices = |light: [f64; 3], axis, down| {
            lattice.side(light.into(), axis, down).iter().map(|s| s.slice).collect::<Vec<_>>()
        };
        // A light far away along x needs one sweep, from its side.
        assert_eq!(slices([-100.0, 10.0, 15.0], 0, false), (0..10).collect::<Vec<_>>());
        for (axis, down) in [(0, true), (1, false), (1, true), (2, false), (2, true)] {
            assert_eq!(slices([-100.0, 10.0, 15.0], axis, down), [0; 0], "{axis} {down}");
        }
        // A light inside the lattice needs sweeps to all sides, without a gap between them.
        assert_eq!(slices([4.5, 10.0, 15.0], 0, false), [5, 6, 7, 8, 9]);
        assert_eq!(slices([4.5, 10.0, 15.0], 0, true), [4, 3, 2, 1, 0]);
        assert_eq!(slices([4.5, 10.0, 15.0], 2, true).first(), Some(&15));
        assert_eq!(slices([4.5, 10.0, 15.0], 2, false).first(), Some(&15));
    }

    #[test]
    fn slices_are_swept_from_where_their_nodes_are_moved_to() {
        // The box ends at 3.2, so that the nodes of slice 4 lie there.
        let lattice = Lattice { bounds: [DVec3::splat(0.4), DVec3::splat(3.2)], ..lattice([5; 3]) };
        let slices = |light: f64, down| {
            lattice.side([light, 2.0, 2.0].into(), 0, down).iter().map(|s| s.slice).collect::<Vec<_>>()
        };
        assert_eq!(slices(3.5, true), [4, 3, 2, 1, 0]);
        assert_eq!(slices(3.5, false), [0; 0]);
        assert_eq!(slices(0.2, false), [0, 1, 2, 3, 4]);
        assert_eq!(slices(0.2, true), [0; 0]);
    }
}
