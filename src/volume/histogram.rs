//! How often each value occurs in a volume, plainly and weighted by the gradient.

use super::{Volume, Voxel, Voxels};
use crate::error::Result;
use crate::files::loading::{Loading, ReadingStage};
use crate::with_voxels;
use rayon::prelude::*;

/// Counts over equal bins of the value range.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Where the first bin begins and the last one ends: the volume's values, and half a stored step beyond them where
    /// values are stored as integers.
    pub range: [f64; 2],
    /// Voxels in each bin.
    pub counts: Vec<u64>,
    /// Sum of the gradient's magnitude (value units per mm, differences towards the next voxel along each axis) over the
    /// voxels in each bin: peaks are where materials meet.
    pub gradients: Vec<f64>,
}

impl Histogram {
    /// Counts a volume's values into at most `most` bins, watched and ended early through `loading`. Bins of stored integers
    /// hold equally many of them: others would show combs that are not in the volume.
    ///
    /// # Errors
    /// It was cancelled.
    pub fn of_with(volume: &Volume, most: usize, loading: &Loading) -> Result<Self> {
        let histogram = Self::count(volume, most, loading);
        loading.go_on(&volume.provenance.source)?;
        Ok(histogram)
    }

    /// Counts a volume's values into at most `most` bins, as [`Self::of_with`].
    pub fn of(volume: &Volume, most: usize) -> Self {
        Self::count(volume, most, &Loading::default())
    }

    fn count(volume: &Volume, most: usize, loading: &Loading) -> Self {
        let (range, bins) = bins_of(volume, most.max(1));
        let [nx, ny, nz] = volume.dims();
        let spacing = volume.spacing_mm();
        let scaling = volume.scaling();
        let per_value = bins as f64 / (range[1] - range[0]).max(f64::MIN_POSITIVE);
        let bin_of = |value: f64| (((value - range[0]) * per_value) as usize).min(bins - 1);
        let empty = || (vec![0_u64; bins], vec![0.0_f64; bins]);
        let pieces = loading.pieces(ReadingStage::Counting, nz);
        let (counts, gradients) = with_voxels!(volume.voxels(), array => {
            let values = array.as_slice().unwrap_or_default();
            (0..nz)
                .into_par_iter()
                .fold(empty, |(mut counts, mut gradients), z| {
                    if pieces.is_cancelled() {
                        return (counts, gradients);
                    }
                    for y in 0..ny {
                        let start = (z * ny + y) * nx;
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
        Self { range, counts, gradients }
    }
}

/// Range and number of the bins.
fn bins_of(volume: &Volume, most: usize) -> ([f64; 2], usize) {
    let [lo, hi] = volume.value_range();
    let step = volume.scaling().slope.abs();
    if matches!(volume.voxels(), Voxels::F32(_) | Voxels::F64(_)) || step == 0.0 {
        return ([lo, hi], most);
    }
    let stored = ((hi - lo) / step).round() + 1.0;
    let per_bin = (stored / most as f64).ceil();
    let bins = (stored / per_bin).ceil();
    let start = lo - 0.5 * step;
    ([start, start + bins * per_bin * step], bins as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::raw;
    use crate::phantom::Phantom;

    #[test]
    fn every_voxel_is_counted_once_and_edges_weigh_at_their_values() {
        let volume = Phantom::Step.build(16).unwrap();
        let histogram = Histogram::of(&volume, 64);
        assert_eq!(histogram.counts.iter().sum::<u64>(), 16 * 16 * 16);
        let [lo, hi] = volume.value_range();
        assert!(histogram.range[0] <= lo && histogram.range[1] >= hi);
        let ends = [histogram.counts.first(), histogram.counts.last()];
        assert!(ends.iter().all(|n| n.is_some_and(|n| *n > 0)), "the ends are in the outer bins");
        assert!(histogram.gradients.iter().sum::<f64>() > 0.0);
    }

    #[test]
    fn bins_of_integers_hold_equally_many_of_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("all.raw");
        std::fs::write(&path, (0..=255).collect::<Vec<u8>>()).unwrap();
        let layout: crate::formats::RawLayout = "16x16x1:u8".parse().unwrap();
        let volume = raw::read(&path, &layout.into()).unwrap();
        for most in [512, 256, 255, 100, 7, 1] {
            let histogram = Histogram::of(&volume, most);
            let (last, full) = histogram.counts.split_last().unwrap();
            assert!(histogram.counts.len() <= most);
            assert!(full.windows(2).all(|w| w[0] == w[1]), "{most}: {full:?}");
            assert!(*last > 0 && full.first().is_none_or(|n| last <= n), "{most}");
        }
    }

    #[test]
    fn one_value_alone_is_no_trouble() {
        let volume = Phantom::Slab.build(4).unwrap();
        let histogram = Histogram::of(&volume, 8);
        assert_eq!(histogram.counts.iter().sum::<u64>(), 64);
        assert!(histogram.gradients.iter().all(|g| g.is_finite()));
    }
}
