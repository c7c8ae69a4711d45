//! Value ranges (minimum and maximum) of bricks of cells of a volume, for lossless empty-space skipping.
//!
//! Cells are numbered `c = floor(p + 1)` along each axis for index positions `p` in `[-0.5, n - 0.5]`, so `c` is in
//! `0..=n`; cell `c` interpolates voxels `c - 1` and `c`, clamped to the grid. Brick `b` holds cells
//! `BRICK_CELLS * b ..= BRICK_CELLS * b + BRICK_CELLS - 1` and so voxels `BRICK_CELLS * b - 1 ..=
//! BRICK_CELLS * b + BRICK_CELLS - 1`: neighbouring bricks share the voxels that both interpolate, and every
//! interpolated value of a brick lies between its minimum and maximum.

use super::element::Element;
use super::labels::Labels;
use super::storage::VoxelBlock;
use super::voxels::{Scaling, Voxel, Voxels};
use crate::with_voxels;
use glam::DAffine3;
use rayon::prelude::*;
use std::ops::Range;

/// Number of grid cells along each side of a brick, the unit of empty-space skipping.
pub const BRICK_CELLS: usize = 4;

/// Value ranges of all bricks of a volume, x fastest, for empty-space skipping.
#[derive(Debug, Clone, PartialEq)]
pub struct Bricks {
    /// Number of bricks (blocks of grid cells) along each axis: `ceil((n + 1) / BRICK_CELLS)` for `n` voxels.
    pub counts: [usize; 3],
    /// Smallest and largest stored value in each brick. Both have the volume's type, which takes least memory.
    low: Voxels,
    high: Voxels,
    scaling: Scaling,
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

    /// Creates the bricks of a volume of `dims` voxels, with ranges that [`Self::add`] sets.
    pub(super) fn new(
        element: Element,
        dims: [usize; 3],
        scaling: Scaling,
        world_from_index: DAffine3,
    ) -> Self {
        let counts = Self::counts_for(dims);
        let zeros = || Voxels::zeros(element, counts);
        Self { counts, low: zeros(), high: zeros(), scaling, labels: None, world_from_index }
    }

    /// Creates bricks from the smallest and largest value of each, x fastest; `None` unless there are as many as `counts`
    /// says.
    pub fn from_ranges(counts: [usize; 3], ranges: &[[f64; 2]], world_from_index: DAffine3) -> Option<Self> {
        let [x, y, z] = counts;
        let [low, high] = [0, 1].map(|end| {
            ndarray::Array3::from_shape_vec((z, y, x), ranges.iter().map(|range| range[end]).collect())
        });
        let (low, high) = (low.ok()?.into(), high.ok()?.into());
        Some(Self { counts, low, high, scaling: Scaling::IDENTITY, labels: None, world_from_index })
    }

    /// Sets the ranges of the bricks that begin in these slices. The block holds the slices and the one before them. Slices
    /// start at a multiple of [`BRICK_CELLS`].
    pub(super) fn add(&mut self, block: &VoxelBlock<'_>, slices: Range<usize>, is_last: bool) {
        let end = if is_last { self.counts[2] } else { slices.end / BRICK_CELLS };
        let layers = slices.start / BRICK_CELLS..end;
        let Self { low, high, .. } = self;
        with_voxels!(low, low => {
            let (low, high) = (low.as_slice_mut(), Voxel::slice_mut_of(high));
            if let (Some(low), Some(high), Some(values)) = (low, high, Voxel::slice_of(block.voxels())) {
                add_layers(values, block, layers, [low, high]);
            }
        });
    }

    /// Adds the segmentation labels of the voxels.
    #[must_use]
    pub(super) fn with_labels(self, labels: Option<&Labels>, dims: [usize; 3]) -> Self {
        let labels = labels
            .map(|labels| BrickLabels { ids: labels.ids().to_vec(), sets: rank_sets(labels.ranks(), dims) });
        Self { labels, ..self }
    }

    /// Returns the total number of bricks (blocks of grid cells) of the volume.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Whether the volume has no bricks (blocks of grid cells), which is never true.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the smallest and largest physical value in a brick.
    pub fn range(&self, brick: usize) -> [f64; 2] {
        let mut found = [0.0; 2];
        self.for_ranges(brick..brick + 1, |range| found = range);
        found
    }

    /// Calls `visit` with the smallest and largest physical value of each of some bricks, in order.
    pub fn for_ranges(&self, bricks: Range<usize>, mut visit: impl FnMut([f64; 2])) {
        fn visit_all<T: Voxel>(low: &[T], high: &[T], scaling: Scaling, visit: &mut impl FnMut([f64; 2])) {
            for (low, high) in low.iter().zip(high) {
                let [a, b] = [low, high].map(|v| scaling.apply(v.to_f64()));
                visit([a.min(b), a.max(b)]);
            }
        }
        with_voxels!(&self.low, low => {
            if let (Some(low), Some(high)) = (low.as_slice(), Voxel::slice_of(&self.high)) {
                visit_all(&low[bricks.clone()], &high[bricks], self.scaling, &mut visit);
            }
        });
    }

    /// Returns the smallest and largest physical value of every brick, x fastest.
    pub fn all_ranges(&self) -> Vec<[f64; 2]> {
        let mut ranges = Vec::with_capacity(self.len());
        self.for_ranges(0..self.len(), |range| ranges.push(range));
        ranges
    }

    /// Returns the bytes of the smallest and of the largest stored values of all bricks.
    pub fn range_bytes(&self) -> [&[u8]; 2] {
        [self.low.bytes(), self.high.bytes()]
    }

    /// Whether the value range of at least one brick overlaps the interval `[low, high]`.
    pub fn have_values(&self, low: f64, high: f64) -> bool {
        (0..self.len()).map(|brick| self.range(brick)).any(|[min, max]| min <= high && max >= low)
    }
}

/// Computes smallest and largest stored value of the bricks in some layers, from a block of voxels with whole slices.
fn add_layers<T: Voxel>(
    values: &[T],
    block: &VoxelBlock<'_>,
    layers: Range<usize>,
    [low_of, high_of]: [&mut [T]; 2],
) {
    let [nx, ny, slices] = block.voxels().dims();
    let nz = block.first()[2] + slices;
    let counts = Bricks::counts_for([nx, ny, nz]);
    let layer = counts[0] * counts[1];
    let of_layers = layers.start * layer..layers.end * layer;
    let [low_of, high_of] = [low_of, high_of].map(|all| &mut all[of_layers.clone()]);
    low_of.par_chunks_mut(counts[0]).zip(high_of.par_chunks_mut(counts[0])).enumerate().for_each_init(
        // Range over the y and z of a row of bricks, for each x.
        || (Vec::with_capacity(nx), Vec::with_capacity(nx)),
        |(low, high), (row, (low_of, high_of))| {
            let (by, bz) = (row % counts[1], layers.start + row / counts[1]);
            let mut first = true;
            for z in voxel_span(bz, nz) {
                for y in voxel_span(by, ny) {
                    let row = &values[block.place([0, y, z])..][..nx];
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
            for (bx, (low_of, high_of)) in low_of.iter_mut().zip(high_of).enumerate() {
                let span = voxel_span(bx, nx);
                *low_of = low[span.clone()].iter().fold(low[span.start], |a, &v| if v < a { v } else { a });
                *high_of =
                    high[span.clone()].iter().fold(high[span.start], |a, &v| if v > a { v } else { a });
            }
        },
    );
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
