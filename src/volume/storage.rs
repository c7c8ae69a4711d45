//! Storage of the voxels of a volume: in host memory, or read in parts from a source.

use super::element::{Element, grid_bytes};
use super::source::{IndexBox, OutOfCoreVoxels, VoxelSource, replace_non_finite};
use super::voxels::Voxels;
use crate::error::Result;
use crate::with_voxels;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Voxels of a volume: in host memory, or read in parts from a source.
#[derive(Debug, Clone)]
pub enum VoxelStorage {
    /// All voxels, in host memory.
    Resident(Voxels),
    /// Source of the voxels, which are read in parts.
    OutOfCore(Arc<OutOfCoreVoxels>),
}

impl From<Voxels> for VoxelStorage {
    fn from(voxels: Voxels) -> Self {
        Self::Resident(voxels)
    }
}

impl VoxelStorage {
    /// Takes voxels that are read in parts, with a limit on host memory in bytes.
    pub fn out_of_core(source: impl VoxelSource + 'static, host_bytes: u64) -> Self {
        Self::OutOfCore(Arc::new(OutOfCoreVoxels::new(Box::new(source), host_bytes)))
    }

    /// Takes voxels from a source with a limit on host memory in bytes: all of them if they fit, else in parts.
    ///
    /// # Errors
    /// The voxels cannot be read.
    pub fn limited(source: impl VoxelSource + 'static, host_bytes: u64) -> Result<Self> {
        let dims = source.dims();
        let bytes = grid_bytes(dims, source.element().memory_bytes());
        match bytes.is_some_and(|bytes| bytes <= host_bytes) {
            true => source.read(&dims.map(|n| 0..n)).map(Self::Resident),
            false => Ok(Self::out_of_core(source, host_bytes)),
        }
    }

    /// Returns the number of voxels along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        match self {
            Self::Resident(voxels) => voxels.dims(),
            Self::OutOfCore(parts) => parts.dims(),
        }
    }

    /// Returns the number type of the voxels in memory.
    pub fn element(&self) -> Element {
        match self {
            Self::Resident(voxels) => voxels.element(),
            Self::OutOfCore(parts) => parts.element(),
        }
    }

    /// Whether voxels in host memory are not contiguous with x fastest.
    pub(super) fn is_scattered(&self) -> bool {
        matches!(self, Self::Resident(voxels) if with_voxels!(voxels, a => !a.is_standard_layout()))
    }

    /// Sets voxels that are NaN or infinite to the value `stored`.
    pub(super) fn replace_non_finite(&mut self, stored: f64) {
        match self {
            Self::Resident(voxels) => {
                replace_non_finite(voxels, stored);
            }
            Self::OutOfCore(parts) => parts.replace_non_finite_by(stored),
        }
    }

    /// Returns a block that holds the voxels of a box.
    pub(super) fn block(&self, part: &IndexBox) -> Result<VoxelBlock<'_>> {
        Ok(match self {
            Self::Resident(voxels) => VoxelBlock::whole(voxels),
            Self::OutOfCore(parts) => VoxelBlock::of_part(parts.read(part)?, part),
        })
    }

    /// Returns slabs of slices that cover the volume in order, see [`super::Volume::slabs`].
    pub(super) fn slabs(
        &self,
        before: usize,
        align: usize,
    ) -> impl Iterator<Item = Result<(Range<usize>, VoxelBlock<'_>)>> {
        let [nx, ny, nz] = self.dims();
        let step = match self {
            Self::Resident(_) => nz,
            Self::OutOfCore(parts) => parts.slab_slices(align),
        };
        (0..nz).step_by(step.max(1)).map(move |first| {
            let slices = first..(first + step).min(nz);
            let part = [0..nx, 0..ny, first.saturating_sub(before)..slices.end];
            Ok((slices, self.block(&part)?))
        })
    }
}

/// Block of voxels of a volume.
#[derive(Debug)]
pub struct VoxelBlock<'a> {
    voxels: Cow<'a, Voxels>,
    /// Index in the volume of the first voxel of the block, along x, y and z.
    first: [usize; 3],
}

impl<'a> VoxelBlock<'a> {
    pub(super) fn whole(voxels: &'a Voxels) -> Self {
        Self { voxels: Cow::Borrowed(voxels), first: [0; 3] }
    }

    pub(super) fn of_part(voxels: Voxels, part: &IndexBox) -> Self {
        Self { voxels: Cow::Owned(voxels), first: part.each_ref().map(|range| range.start) }
    }

    /// Returns the voxels of the block.
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Returns the index in the volume of the first voxel of the block, along x, y and z.
    pub fn first(&self) -> [usize; 3] {
        self.first
    }

    /// Returns the stored value of the voxel with this index in the volume.
    pub fn stored(&self, index: [usize; 3]) -> f64 {
        self.voxels.stored(std::array::from_fn(|axis| index[axis] - self.first[axis]))
    }

    /// Returns the place in the block's memory of the voxel with this index in the volume.
    pub fn place(&self, [i, j, k]: [usize; 3]) -> usize {
        let ([nx, ny, _], [x, y, z]) = (self.voxels.dims(), self.first);
        ((k - z) * ny + (j - y)) * nx + (i - x)
    }
}
