//! Blocks of volume cells without extinction, which rays of the exact reference skip.

use super::law::Laws;
use super::voxel_access::contiguous;
use crate::volume::{Volume, Voxel, VoxelBlock};
use crate::with_voxels;
use rayon::prelude::*;
use std::ops::Range;

/// Base-2 logarithm of the number of volume cells along the edge of a block.
const SHIFT: u32 = 3;

/// Returns the index of the block that contains a volume cell, on one axis. Cells run from -1 (before the first voxel
/// centre) to `n - 1`.
#[inline]
pub(super) fn block_of(cell: i64) -> i64 {
    (cell + 1) >> SHIFT
}

/// Returns the indices of the first and last volume cell in a block, on one axis.
#[inline]
pub(super) fn cells_of(block: i64) -> [i64; 2] {
    [(block << SHIFT) - 1, ((block + 1) << SHIFT) - 2]
}

/// Segmentation labels of the voxels, with the index of the transfer function of each label.
#[derive(Clone, Copy)]
pub(super) struct Labelled<'a> {
    /// Index of each voxel's segmentation label in the list of all labels.
    pub ranks: &'a [u8],
    /// Index of the transfer function of each segmentation label; `None` if the label has no extinction.
    pub functions: &'a [Option<usize>],
}

/// Flags that tell for each block of volume cells whether it may have extinction.
#[derive(Debug, Clone)]
pub(super) struct Blocks {
    counts: [usize; 3],
    active: Vec<bool>,
}

impl Blocks {
    /// Finds the blocks of a volume's cells that may have extinction. Blocks whose voxels cannot be read count as empty;
    /// [`Volume::check_reads`] returns the error.
    pub fn new(volume: &Volume, laws: &[Laws], labels: Option<Labelled<'_>>) -> Self {
        let dims = volume.dims();
        let counts = dims.map(|n| block_of(n as i64 - 1) as usize + 1);
        let mut active = vec![false; counts.iter().product()];
        for (slices, block) in volume.slabs(1, 1 << SHIFT).flatten() {
            let end = if slices.end == dims[2] { counts[2] } else { slices.end >> SHIFT };
            let layer = counts[0] * counts[1];
            let first = layer * (slices.start >> SHIFT);
            let activity = with_voxels!(block.voxels(), array => {
                activity(volume, (&block, contiguous(array)), laws, labels, first..layer * end)
            });
            active[first..layer * end].copy_from_slice(&activity);
        }
        Self { counts, active }
    }

    /// Whether a block of volume cells may have extinction.
    #[inline]
    pub fn is_active(&self, [x, y, z]: [i64; 3]) -> bool {
        self.active[x as usize + self.counts[0] * (y as usize + self.counts[1] * z as usize)]
    }
}

/// Returns for some blocks of volume cells whether they may have extinction, from a block of voxels.
fn activity<V: Voxel>(
    volume: &Volume,
    (block, voxels): (&VoxelBlock<'_>, &[V]),
    laws: &[Laws],
    labels: Option<Labelled<'_>>,
    blocks: Range<usize>,
) -> Vec<bool> {
    let (dims, scaling) = (volume.dims(), volume.scaling());
    let counts = dims.map(|n| block_of(n as i64 - 1) as usize + 1);
    // Voxels that a block's cells interpolate: one more than cells, within the volume.
    let reach = |axis: usize, block: usize| {
        let [first, last] = cells_of(block as i64);
        let end = dims[axis] - 1;
        (first.max(0) as usize).min(end)..=(last as usize + 1).min(end)
    };
    let is_active = |index: usize| {
        let at = [index % counts[0], index / counts[0] % counts[1], index / (counts[0] * counts[1])];
        let [x, y, z] = std::array::from_fn(|axis| reach(axis, at[axis]));
        let first = voxels[block.place([*x.start(), *y.start(), *z.start()])];
        let (mut min, mut max) = (first, first);
        // Transfer functions of the block's voxels, one bit each.
        let mut used = u64::from(labels.is_none());
        for k in z {
            for j in y.clone() {
                for &v in &voxels[block.place([*x.start(), j, k])..=block.place([*x.end(), j, k])] {
                    min = if v < min { v } else { min };
                    max = if v > max { v } else { max };
                }
                if let Some(Labelled { ranks, functions }) = labels {
                    let row = dims[0] * (j + dims[1] * k);
                    let ranks = ranks[row + x.start()..=row + x.end()].iter();
                    let functions = ranks.filter_map(|rank| functions[usize::from(*rank)]);
                    used |= functions.fold(0, |bits, function| bits | 1 << (function % 64));
                }
            }
        }
        let (a, b) = (scaling.apply(min.to_f64()), scaling.apply(max.to_f64()));
        let has_extinction = |laws: &Laws| laws.active(a.min(b), a.max(b)).is_some();
        laws.iter().enumerate().any(|(i, laws)| used >> (i % 64) & 1 == 1 && has_extinction(laws))
    };
    blocks.into_par_iter().with_min_len(64).map(is_active).collect()
}
