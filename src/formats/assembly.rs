//! Assembles a volume from blocks of voxels, such as DICOM slices or the pieces of a VTK image.

use crate::files::memory_budget::refuse_beyond_host;
use crate::volume::Voxels;
use crate::volume::element::grid_bytes;
use crate::with_voxels;
use ndarray::{Array3, s};

/// Voxel grid that is filled block by block while a volume file is read.
pub(super) struct Assembly {
    dims: [usize; 3],
    voxels: Option<Voxels>,
}

impl Assembly {
    /// Creates an empty voxel grid with `dims` voxels along x, y and z.
    pub(super) fn new(dims: [usize; 3]) -> Self {
        Self { dims, voxels: None }
    }

    /// Copies a block of voxels into the voxel grid of a volume; `from` is the grid index of the first voxel of the
    /// block.
    ///
    /// # Errors
    /// The block exceeds the grid, its element type differs from that of the first block, or the host has too little
    /// memory for the grid.
    pub(super) fn put(&mut self, block: Voxels, from: [usize; 3]) -> Result<(), String> {
        fn zeros<T: Clone + Default>(_: &Array3<T>, [nx, ny, nz]: [usize; 3]) -> Array3<T> {
            Array3::from_elem((nz, ny, nx), T::default())
        }
        fn assign<T: Copy>(
            whole: &mut Array3<T>,
            block: &Array3<T>,
            [x, y, z]: [usize; 3],
        ) -> Result<(), String> {
            let ((nz, ny, nx), (mz, my, mx)) = (block.dim(), whole.dim());
            let fits = |from: usize, n: usize, m: usize| from.checked_add(n).is_some_and(|end| end <= m);
            if !(fits(x, nx, mx) && fits(y, ny, my) && fits(z, nz, mz)) {
                return Err("a part of it is outside the image".into());
            }
            whole.slice_mut(s![z..z + nz, y..y + ny, x..x + nx]).assign(block);
            Ok(())
        }
        let [nx, ny, nz] = self.dims;
        if self.voxels.is_none() && with_voxels!(&block, a => a.dim() == (nz, ny, nx)) {
            self.voxels = Some(block);
            return Ok(());
        }
        let whole = match &mut self.voxels {
            Some(whole) => whole,
            none => {
                refuse_beyond_host(grid_bytes(self.dims, block.element().memory_bytes()))?;
                none.insert(with_voxels!(&block, a => zeros(a, self.dims).into()))
            }
        };
        macro_rules! assign_same_type {
            ($($kind:ident),*) => {
                match (whole, &block) {
                    $((Voxels::$kind(whole), Voxels::$kind(block)) => assign(whole, block, from),)*
                    _ => Err("its parts are of several types".into()),
                }
            };
        }
        assign_same_type!(U8, I16, U16, F32, F64)
    }

    /// Returns the voxels of the assembled volume, or `None` if no block was stored.
    pub(super) fn finish(self) -> Option<Voxels> {
        self.voxels
    }
}
