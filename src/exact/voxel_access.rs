//! Access to the voxels of a volume for the exact reference: in host memory, or by chunks that are read when they are needed.

use crate::volume::{CHUNK_CELLS, OutOfCoreVoxels, Voxel, Voxels};
use ndarray::Array3;
use std::marker::PhantomData;
use std::sync::Arc;

/// Returns the voxels of a volume as a slice in memory order.
pub(super) fn contiguous<V>(voxels: &Array3<V>) -> &[V] {
    voxels.as_slice().expect("a Volume refuses voxels that are not contiguous")
}

/// Access to voxels of one number type.
pub(super) trait VoxelAccess {
    /// Number type of the voxels.
    type Voxel: Voxel;

    /// Returns the voxels at the corners of a cell, `corner[x + 2 y + 4 z]`. Cells run from -1 to `n - 1` on each axis.
    /// `offset` has the places in memory order of the lower and the upper voxels, a summand for each axis.
    fn corners(&mut self, cell: [i64; 3], offset: &[[usize; 2]; 3]) -> [Self::Voxel; 8];
}

/// Voxels in host memory, x fastest.
pub(super) struct Resident<'a, V>(pub &'a [V]);

impl<V: Voxel> VoxelAccess for Resident<'_, V> {
    type Voxel = V;

    #[inline(always)]
    fn corners(&mut self, _: [i64; 3], at: &[[usize; 2]; 3]) -> [V; 8] {
        std::array::from_fn(|c| self.0[at[0][c & 1] + at[1][c >> 1 & 1] + at[2][c >> 2]])
    }
}

/// Voxels that are read in parts; it keeps the chunk of the last cell.
pub(super) struct Chunked<'a, V> {
    parts: &'a OutOfCoreVoxels,
    dims: [usize; 3],
    chunk: [usize; 3],
    /// Voxels of the chunk, and their number along each axis.
    voxels: Option<(Arc<Voxels>, [usize; 3])>,
    number_type: PhantomData<V>,
}

impl<'a, V: Voxel> Chunked<'a, V> {
    pub fn new(parts: &'a OutOfCoreVoxels) -> Self {
        let dims = parts.dims();
        Self { parts, dims, chunk: [0; 3], voxels: None, number_type: PhantomData }
    }
}

impl<V: Voxel> VoxelAccess for Chunked<'_, V> {
    type Voxel = V;

    #[inline]
    fn corners(&mut self, cell: [i64; 3], _: &[[usize; 2]; 3]) -> [V; 8] {
        let chunk = cell.map(|c| c.max(0) as usize / CHUNK_CELLS);
        if self.voxels.is_none() || chunk != self.chunk {
            let voxels = self.parts.chunk(chunk);
            let sides = voxels.dims();
            (self.chunk, self.voxels) = (chunk, Some((voxels, sides)));
        }
        let Some((voxels, [nx, ny, _])) = &self.voxels else { return [V::from_f64(0.0); 8] };
        let values = V::slice_of(voxels).unwrap_or_default();
        let at: [[usize; 2]; 3] = std::array::from_fn(|axis| {
            let last = self.dims[axis] as i64 - 1;
            [cell[axis], cell[axis] + 1].map(|c| c.clamp(0, last) as usize - CHUNK_CELLS * chunk[axis])
        });
        std::array::from_fn(|c| values[at[0][c & 1] + nx * (at[1][c >> 1 & 1] + ny * at[2][c >> 2])])
    }
}

/// Runs `$body` with `$access` as the access to the voxels of a volume, in the number type of the volume.
macro_rules! with_access {
    ($volume:expr, $access:ident => $body:expr) => {
        match $volume.storage() {
            $crate::volume::VoxelStorage::Resident(voxels) => $crate::with_voxels!(voxels, array => {
                let $access = &mut $crate::exact::voxel_access::Resident($crate::exact::voxel_access::contiguous(array));
                $body
            }),
            $crate::volume::VoxelStorage::OutOfCore(parts) => $crate::with_voxel_type!(parts.element(), V => {
                let $access = &mut $crate::exact::voxel_access::Chunked::<V>::new(parts);
                $body
            }),
        }
    };
}
pub(super) use with_access;
