//! Statistics of all voxels of a volume: range of the values, and range of each brick.

use super::bricks::{BRICK_CELLS, Bricks};
use super::storage::{VoxelBlock, VoxelStorage};
use super::voxels::{Scaling, Voxel};
use crate::error::Result;
use crate::files::loading::{Loading, Pieces, ReadingStage};
use crate::with_voxels;
use glam::DAffine3;
use rayon::prelude::*;
use std::ops::Range;

/// Number of voxels that one parallel task processes.
const CHUNK: usize = 1 << 16;

/// Statistics of all voxels of a volume.
pub(super) struct Statistics {
    /// Smallest and largest finite stored value.
    low_high: [f64; 2],
    /// Number of voxels that are NaN or infinite.
    pub non_finite: usize,
    /// Value ranges of all bricks, for voxels that are read in parts: another pass would read them again.
    pub bricks: Option<Bricks>,
}

impl Statistics {
    /// Computes the statistics of voxels. They are meaningless if `loading` was cancelled.
    pub fn of(
        storage: &VoxelStorage,
        scaling: Scaling,
        world_from_index: DAffine3,
        loading: &Loading,
    ) -> Result<Self> {
        let dims = storage.dims();
        let in_parts = matches!(storage, VoxelStorage::OutOfCore(_));
        let mut bricks = in_parts.then(|| Bricks::new(storage.element(), dims, scaling, world_from_index));
        let stage = if in_parts { ReadingStage::Reading } else { ReadingStage::Checking };
        let pieces = loading.pieces(stage, dims[2]);
        let (mut low_high, mut finite) = (EMPTY, 0);
        for slab in storage.slabs(1, BRICK_CELLS) {
            let (slices, block) = slab?;
            let (range, count) = of_slices(&block, slices.clone(), &pieces);
            (low_high, finite) = (join(low_high, range), finite + count);
            if let Some(bricks) = &mut bricks {
                bricks.add(&block, slices.clone(), slices.end == dims[2]);
            }
            if pieces.is_cancelled() {
                break;
            }
        }
        let non_finite = dims.iter().product::<usize>().saturating_sub(finite);
        Ok(Self { low_high, non_finite, bricks })
    }

    /// Returns the smallest and largest finite stored value; `None` without a finite value.
    pub fn range(&self) -> Option<[f64; 2]> {
        let [low, high] = self.low_high;
        (low <= high).then_some([low, high])
    }
}

const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

fn join(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Returns range and number of the finite values in some slices of a block.
fn of_slices(block: &VoxelBlock<'_>, slices: Range<usize>, pieces: &Pieces<'_>) -> ([f64; 2], usize) {
    fn of<T: Voxel>(values: &[T]) -> ([f64; 2], usize) {
        let finite = values.iter().map(|v| v.to_f64()).filter(|v| v.is_finite());
        finite.fold((EMPTY, 0), |([lo, hi], count), v| {
            ([if v < lo { v } else { lo }, if v > hi { v } else { hi }], count + 1)
        })
    }
    let none = || (EMPTY, 0);
    let both = |(a, m): ([f64; 2], usize), (b, n)| (join(a, b), m + n);
    let [nx, ny, _] = block.voxels().dims();
    with_voxels!(block.voxels(), array => {
        let values = array.as_slice().unwrap_or_default();
        let of_slice = |k: usize| {
            if pieces.is_cancelled() {
                return none();
            }
            pieces.done();
            let first = block.place([0, 0, k]);
            values[first..][..nx * ny].par_chunks(CHUNK).map(of).reduce(none, both)
        };
        slices.into_par_iter().map(of_slice).reduce(none, both)
    })
}
