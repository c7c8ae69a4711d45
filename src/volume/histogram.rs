//! How often each value occurs in a volume, plainly and weighted by the gradient.

use super::{Volume, Voxel};
use crate::error::Result;
use crate::loading::{Loading, Stage};
use crate::with_voxels;
use rayon::prelude::*;

/// Counts over equal bins of the value range.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Smallest and largest value of the volume.
    pub range: [f64; 2],
    /// Voxels in each bin.
    pub counts: Vec<u64>,
    /// Sum of the gradient's magnitude (value units per mm, differences towards the next voxel along each axis) over the
    /// voxels in each bin: peaks are where materials meet.
    pub gradients: Vec<f64>,
}

impl Histogram {
    /// Counts a volume's values into `bins` bins, watched and ended early through `loading`.
    ///
    /// # Errors
    /// It was cancelled.
    pub fn of_with(volume: &Volume, bins: usize, loading: &Loading) -> Result<Self> {
        let histogram = Self::count(volume, bins, loading);
        loading.go_on(&volume.provenance.source)?;
        Ok(histogram)
    }

    /// Counts a volume's values into `bins` bins.
    pub fn of(volume: &Volume, bins: usize) -> Self {
        Self::count(volume, bins, &Loading::default())
    }

    fn count(volume: &Volume, bins: usize, loading: &Loading) -> Self {
        let bins = bins.max(1);
        let range = volume.value_range();
        let [nx, ny, nz] = volume.dims();
        let spacing = volume.spacing_mm();
        let scaling = volume.scaling();
        let per_value = bins as f64 / (range[1] - range[0]).max(f64::MIN_POSITIVE);
        let bin_of = |value: f64| (((value - range[0]) * per_value) as usize).min(bins - 1);
        let empty = || (vec![0_u64; bins], vec![0.0_f64; bins]);
        let pieces = loading.pieces(Stage::Counting, nz);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{VolumeSpec, load};

    #[test]
    fn every_voxel_is_counted_once_and_edges_weigh_at_their_values() {
        let volume = load(&VolumeSpec::new("phantom:step:16")).unwrap();
        let histogram = Histogram::of(&volume, 64);
        assert_eq!(histogram.counts.iter().sum::<u64>(), 16 * 16 * 16);
        assert_eq!(histogram.range, volume.value_range());
        assert!(histogram.counts[0] > 0 && histogram.counts[63] > 0, "the ends are in the outer bins");
        assert!(histogram.gradients.iter().sum::<f64>() > 0.0);
    }

    #[test]
    fn one_value_alone_is_no_trouble() {
        let volume = load(&VolumeSpec::new("phantom:slab:4")).unwrap();
        let histogram = Histogram::of(&volume, 8);
        assert_eq!(histogram.counts.iter().sum::<u64>(), 64);
        assert!(histogram.gradients.iter().all(|g| g.is_finite()));
    }
}
