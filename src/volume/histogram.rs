//! Histogram of the voxel values of a volume, with and without gradient weights.

use super::{Element, Volume, Voxel, VoxelBlock};
use crate::error::Result;
use crate::files::loading::{Loading, Pieces, ReadingStage};
use crate::with_voxels;
use rayon::prelude::*;
use std::ops::Range;

/// Histogram of the voxel values of a volume, with bins of equal width over the value range.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Start of the first histogram bin and end of the last. For integer voxels, the range extends at least half a
    /// stored step beyond the smallest and largest value.
    pub range: [f64; 2],
    /// Number of voxels in each histogram bin.
    pub counts: Vec<u64>,
    /// Sum of the gradient magnitudes of the voxels in each histogram bin (value units per mm, forward differences).
    pub gradients: Vec<f64>,
}

impl Histogram {
    /// Computes the histogram of a volume with at most `max_bins` bins, with progress and cancellation through
    /// `loading`.
    ///
    /// Each bin spans the same number of stored integers, which avoids comb artefacts.
    ///
    /// # Errors
    /// Counting was cancelled.
    pub fn of_with(volume: &Volume, max_bins: usize, loading: &Loading) -> Result<Self> {
        let (range, bins) = bins_of(volume, max_bins.max(1));
        let mut histogram = Self { range, counts: vec![0; bins], gradients: vec![0.0; bins] };
        let nz = volume.dims()[2];
        let pieces = loading.pieces(ReadingStage::Counting, nz);
        for slab in volume.slabs(1, 1) {
            let (slices, block) = slab?;
            // A slice is counted with the next one: the last of a slab is left to the next slab.
            let end = if slices.end == nz { nz } else { slices.end - 1 };
            histogram.add(volume, &block, slices.start.saturating_sub(1)..end, &pieces);
            loading.go_on(&volume.provenance.source)?;
        }
        loading.go_on(&volume.provenance.source)?;
        Ok(histogram)
    }

    /// Computes the histogram of a volume with at most `max_bins` bins.
    ///
    /// # Errors
    /// Voxels that are read in parts cannot be read.
    pub fn of(volume: &Volume, max_bins: usize) -> Result<Self> {
        Self::of_with(volume, max_bins, &Loading::default())
    }

    /// Adds the voxels of some slices. The block also holds the next slice, except for the last of the volume.
    fn add(&mut self, volume: &Volume, block: &VoxelBlock<'_>, slices: Range<usize>, pieces: &Pieces<'_>) {
        let (range, bins) = (self.range, self.counts.len());
        let [nx, ny, nz] = volume.dims();
        let spacing = volume.spacing_mm();
        let scaling = volume.scaling();
        let per_value = bins as f64 / (range[1] - range[0]).max(f64::MIN_POSITIVE);
        let bin_of = |value: f64| (((value - range[0]) * per_value) as usize).min(bins - 1);
        let empty = || (vec![0_u64; bins], vec![0.0_f64; bins]);
        let (counts, gradients) = with_voxels!(block.voxels(), array => {
            let values = array.as_slice().unwrap_or_default();
            slices
                .into_par_iter()
                .fold(empty, |(mut counts, mut gradients), z| {
                    if pieces.is_cancelled() {
                        return (counts, gradients);
                    }
                    for y in 0..ny {
                        let start = block.place([0, y, z]);
                        for x in 0..nx {
                            let here = values[start + x].to_f64();
                            let difference = |step: usize, is_last: bool, mm: f64| {
                                let next = if is_last { here } else { values[start + x + step].to_f64() };
                                (next - here) / mm
                            };
                            let dx = difference(1, x + 1 == nx, spacing[0]);
                            let dy = difference(nx, y + 1 == ny, spacing[1]);
                            let dz = difference(nx * ny, z + 1 == nz, spacing[2]);
                            let bin = bin_of(scaling.apply(here));
                            counts[bin] += 1;
                            gradients[bin] += scaling.slope.abs() * (dx * dx + dy * dy + dz * dz).sqrt();
                        }
                    }
                    pieces.done();
                    (counts, gradients)
                })
                .reduce(empty, |(mut counts, mut gradients), (c, g)| {
                    counts.iter_mut().zip(c).for_each(|(a, b)| *a += b);
                    gradients.iter_mut().zip(g).for_each(|(a, b)| *a += b);
                    (counts, gradients)
                })
        });
        self.counts.iter_mut().zip(counts).for_each(|(a, b)| *a += b);
        self.gradients.iter_mut().zip(gradients).for_each(|(a, b)| *a += b);
    }
}

/// Returns the value range that the histogram covers, and the number of its bins.
fn bins_of(volume: &Volume, max_bins: usize) -> ([f64; 2], usize) {
    let [lo, hi] = volume.value_range();
    let step = volume.scaling().slope.abs();
    if matches!(volume.element(), Element::F32 | Element::F64) || step == 0.0 {
        return ([lo, hi], max_bins);
    }
    let stored = ((hi - lo) / step).round() + 1.0;
    let per_bin = (stored / max_bins as f64).ceil();
    let bins = (stored / per_bin).ceil();
    let start = lo - 0.5 * step;
    ([start, start + bins * per_bin * step], bins as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::DAffine3;
    use ndarray::Array3;

    fn volume(voxels: impl Into<Voxels>) -> Volume {
        let provenance = Provenance::new("test", "test", "test");
        Volume::new(voxels.into(), Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap()
    }

    #[test]
    fn every_voxel_is_counted_once() {
        let volume = volume(Array3::from_shape_fn((16, 16, 16), |(_, _, i)| if i < 8 { 0i16 } else { 1000 }));
        let histogram = Histogram::of(&volume, 64).unwrap();
        assert_eq!(histogram.counts.iter().sum::<u64>(), 16 * 16 * 16);
        let [lo, hi] = volume.value_range();
        assert!(histogram.range[0] <= lo && histogram.range[1] >= hi);
        let ends = [histogram.counts.first(), histogram.counts.last()];
        assert!(ends.iter().all(|n| n.is_some_and(|n| *n > 0)), "the outer bins hold the ends of the range");
        assert!(histogram.gradients.iter().sum::<f64>() > 0.0);
    }

    #[test]
    fn bins_span_equal_numbers_of_integers() {
        let volume = volume(Array3::from_shape_fn((1, 16, 16), |(_, j, i)| (16 * j + i) as u8));
        for max_bins in [512, 256, 255, 100, 7, 1] {
            let histogram = Histogram::of(&volume, max_bins).unwrap();
            let (last, full) = histogram.counts.split_last().unwrap();
            assert!(histogram.counts.len() <= max_bins);
            assert!(full.windows(2).all(|w| w[0] == w[1]), "{max_bins}: {full:?}");
            assert!(*last > 0 && full.first().is_none_or(|n| last <= n), "{max_bins}");
        }
    }

    #[test]
    fn few_voxels_give_finite_gradients() {
        let volume = volume(Array3::from_elem((4, 4, 4), 7.0f32));
        let histogram = Histogram::of(&volume, 8).unwrap();
        assert_eq!(histogram.counts.iter().sum::<u64>(), 64);
        assert!(histogram.gradients.iter().all(|g| g.is_finite()));
    }
}
