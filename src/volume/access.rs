//! Access to the voxels of a volume, in host memory or out of core.

use super::Volume;
use super::element::Element;
use super::source::{IndexBox, OutOfCoreVoxels};
use super::storage::{VoxelBlock, VoxelStorage};
use super::voxels::Voxels;
use crate::error::Result;
use std::ops::Range;
use std::sync::Arc;

impl Volume {
    /// Returns the voxels, or the source that they are read from.
    pub fn storage(&self) -> &VoxelStorage {
        &self.storage
    }

    /// Returns the voxels if they are in host memory; `None` for a volume that is read in parts.
    pub fn resident(&self) -> Option<&Voxels> {
        match &self.storage {
            VoxelStorage::Resident(voxels) => Some(voxels),
            VoxelStorage::OutOfCore(_) => None,
        }
    }

    /// Returns the source of a volume that is read in parts.
    pub fn out_of_core(&self) -> Option<&Arc<OutOfCoreVoxels>> {
        match &self.storage {
            VoxelStorage::Resident(_) => None,
            VoxelStorage::OutOfCore(parts) => Some(parts),
        }
    }

    /// Returns the number type of the voxels in memory.
    pub fn element(&self) -> Element {
        self.storage.element()
    }

    /// Returns a block that holds at least the voxels of a box; the whole volume if it is in host memory.
    ///
    /// # Errors
    /// The voxels cannot be read.
    pub fn block(&self, part: &IndexBox) -> Result<VoxelBlock<'_>> {
        self.storage.block(part)
    }

    /// Returns a block that holds at least the voxels of a box. If they cannot be read, its values are 0, and
    /// [`Self::check_reads`] returns the error.
    pub fn block_or_zeros(&self, part: &IndexBox) -> VoxelBlock<'_> {
        match &self.storage {
            VoxelStorage::Resident(voxels) => VoxelBlock::whole(voxels),
            VoxelStorage::OutOfCore(parts) => VoxelBlock::of_part(parts.read_or_zeros(part), part),
        }
    }

    /// Returns slabs of slices that cover the volume in order: the slices that each is for, and a block that holds them and
    /// at least the `before` slices before them. Each slab but the last has a multiple of `align` slices. A volume in host
    /// memory is one slab.
    pub fn slabs(
        &self,
        before: usize,
        align: usize,
    ) -> impl Iterator<Item = Result<(Range<usize>, VoxelBlock<'_>)>> {
        self.storage.slabs(before, align)
    }

    /// Returns an error if voxels could not be read where a result could not say so.
    ///
    /// # Errors
    /// The first error of such a read.
    pub fn check_reads(&self) -> Result<()> {
        self.out_of_core().and_then(|parts| parts.failure()).map_or(Ok(()), |error| Err(error.clone()))
    }
}
