//! Value ranges (minimum and maximum) of bricks of cells of a volume, for lossless empty-space skipping.
//!
//! Cells are numbered `c = floor(p + 1)` along each axis for index positions `p` in `[-0.5, n - 0.5]`, so `c` is in
//! `0..=n`; cell `c` interpolates voxels `c - 1` and `c`, clamped to the grid. Brick `b` holds cells
//! `BRICK_CELLS * b ..= BRICK_CELLS * b + BRICK_CELLS - 1` and so voxels `BRICK_CELLS * b - 1 ..=
//! BRICK_CELLS * b + BRICK_CELLS - 1`: neighbouring bricks share the voxels that both interpolate, and every
//! interpolated value of a brick lies between its minimum and maximum.

use super::labels::Labels;
use super::voxels::{Scaling, Voxel, Voxels};
use crate::with_voxels;
use glam::DAffine3;
use rayon::prelude::*;

/// Number of grid cells along each side of a brick, the unit of empty-space skipping.
pub const BRICK_CELLS: usize = 4;

/// Value ranges of all bricks of a volume, x fastest, for empty-space skipping.
#[derive(Debug, Clone, PartialEq)]
pub struct Bricks {
    /// Number of bricks (blocks of grid cells) along each axis: `ceil((n + 1) / BRICK_CELLS)` for `n` voxels.
    pub counts: [usize; 3],
    /// Smallest physical value in each brick (block of grid cells) of the volume.
    pub min: Vec<f64>,
    /// Largest physical value in each brick (block of grid cells) of the volume.
    pub max: Vec<f64>,
    /// Segmentation labels in each brick (block of grid cells), if the volume has labels.
    pub labels: Option<BrickLabels>,
    /// Affine from voxel indices of the volume to world coordinates (RAS+, mm).
    pub world_from_index: DAffine3,
}

/// Segmentation labels that occur in each brick (block of grid cells) of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct BrickLabels {
    /// Sorted segmentation labels of the volume, see [`super::Labels::ids`].
    pub ids: Vec<u32>,
    /// Set of the segmentation labels in each brick; a label is stored as its index in the sorted list `ids`.
    pub sets: Vec<RankSet>,
}

/// Set of segmentation labels, as a bit set of label indices below 256.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RankSet([u64; 4]);

impl RankSet {
    /// Adds a label to the set of labels, by the index of the label.
    pub fn insert(&mut self, rank: usize) {
        self.0[rank / 64 % 4] |= 1 << (rank % 64);
    }

    /// Whether a label is in the set, by its index.
    pub fn has(&self, rank: usize) -> bool {
        self.0[rank / 64 % 4] & (1 << (rank % 64)) != 0
    }

    /// Returns the only label of several sets, by its index; `None` if they have none or several.
    pub fn only(sets: impl Iterator<Item = Self>) -> Option<usize> {
        let all = sets.fold(Self::default(), |all, set| Self(std::array::from_fn(|i| all.0[i] | set.0[i])));
        let word = all.0.iter().position(|word| *word != 0)?;
        let rank = 64 * word + all.0[word].trailing_zeros() as usize;
        let mut one = Self::default();
        one.insert(rank);
        (one == all).then_some(rank)
    }

    /// Whether two sets of labels have a label in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).any(|(a, b)| a & b != 0)
    }
}

/// Returns the range of voxels that the grid cells of brick `b` interpolate, along an axis of `n` voxels.
fn voxel_span(b: usize, n: usize) -> std::ops::Range<usize> {
    (BRICK_CELLS * b).saturating_sub(1).min(n - 1)..(BRICK_CELLS * (b + 1)).min(n)
}

impl Bricks {
    /// Returns the number of bricks (blocks of grid cells) along each axis for a volume of `dims` voxels.
    pub fn counts_for(dims: [usize; 3]) -> [usize; 3] {
        dims.map(|n| (n + 1).div_ceil(BRICK_CELLS))
    }

    /// Computes the value range of every brick of a volume. Compares stored values, and converts only the smallest
    /// and largest to physical values.
    pub(super) fn build(
        voxels: &Voxels,
        scaling: Scaling,
        labels: Option<&Labels>,
        world_from_index: DAffine3,
    ) -> Self {
        let [nz, ny, nx] = with_voxels!(voxels, a => a.dim()).into();
        let dims = [nx, ny, nz];
        let bricks = with_voxels!(voxels, a => build(a.as_slice().unwrap_or_default(), dims, scaling));
        let labels = labels
            .map(|labels| BrickLabels { ids: labels.ids().to_vec(), sets: rank_sets(labels.ranks(), dims) });
        Self { labels, world_from_index, ..bricks }
    }

    /// Returns the total number of bricks (blocks of grid cells) of the volume.
    pub fn len(&self) -> usize {
        self.min.len()
    }

    /// Whether the volume has no bricks (blocks of grid cells), which is never true.
    pub fn is_empty(&self) -> bool {
        self.min.is_empty()
    }

    /// Whether the value range of at least one brick overlaps the interval `[low, high]`.
    pub fn have_values(&self, low: f64, high: f64) -> bool {
        self.min.iter().zip(&self.max).any(|(&min, &max)| min <= high && max >= low)
    }
}

fn build<T: Voxel>(values: &[T], dims: [usize; 3], scaling: Scaling) -> Bricks {
    let counts = Bricks::counts_for(dims);
    let [nx, ny, nz] = dims;
    let mut min = vec![0.0; counts.iter().product()];
    let mut max = min.clone();
    min.par_chunks_mut(counts[0]).zip(max.par_chunks_mut(counts[0])).enumerate().for_each_init(
        // Range over the y and z of a row of bricks, for each x.
        || (Vec::with_capacity(nx), Vec::with_capacity(nx)),
        |(low, high), (row, (min, max))| {
            let (by, bz) = (row % counts[1], row / counts[1]);
            let mut first = true;
            for z in voxel_span(bz, nz) {
                for y in voxel_span(by, ny) {
                    let row = &values[(z * ny + y) * nx..][..nx];
                    if first {
                        low.clear();
                        low.extend_from_slice(row);
                        high.clear();
                        high.extend_from_slice(row);
                        first = false;
                    } else {
                        for ((lo, hi), &v) in low.iter_mut().zip(high.iter_mut()).zip(row) {
                            *lo = if v < *lo { v } else { *lo };
                            *hi = if v > *hi { v } else { *hi };
                        }
                    }
                }
            }
            for (bx, (min, max)) in min.iter_mut().zip(max).enumerate() {
                let span = voxel_span(bx, nx);
                let lo = low[span.clone()].iter().fold(low[span.start], |a, &v| if v < a { v } else { a });
                let hi = high[span.clone()].iter().fold(high[span.start], |a, &v| if v > a { v } else { a });
                let [a, b] = [lo, hi].map(|v| scaling.apply(v.to_f64()));
                (*min, *max) = (a.min(b), a.max(b));
            }
        },
    );
    Bricks { counts, min, max, labels: None, world_from_index: DAffine3::IDENTITY }
}

/// Collects the set of segmentation labels in each brick of a volume.
fn rank_sets(ranks: &[u8], dims: [usize; 3]) -> Vec<RankSet> {
    let counts = Bricks::counts_for(dims);
    let [nx, ny, nz] = dims;
    let set_of = |brick: usize| {
        let [x, y, z] = [brick % counts[0], brick / counts[0] % counts[1], brick / (counts[0] * counts[1])];
        let mut set = RankSet::default();
        for k in voxel_span(z, nz) {
            for j in voxel_span(y, ny) {
                let row = (k * ny + j) * nx;
                voxel_span(x, nx).for_each(|i| set.insert(usize::from(ranks[row + i])));
            }
        }
        set
    };
    (0..counts.iter().product()).into_par_iter().with_min_len(256).map(set_of).collect()
}
