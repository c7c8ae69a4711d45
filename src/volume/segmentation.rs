//! Samples a segmentation at the voxels of another volume.

use super::{Labels, Volume, Voxel};
use crate::error::{Error, Result};
use crate::with_voxels;
use glam::{DAffine3, DVec3};

/// Largest distance of a segmentation value from an integer at which it still counts as a label.
const INTEGER_TOLERANCE: f64 = 1e-3;
/// Largest distance between corresponding voxels of two voxel grids that count as equal, in voxels.
const GRID_TOLERANCE: f64 = 1e-3;

impl Labels {
    /// Samples a segmentation at the voxels of `volume`. Each voxel takes the label of the nearest segmentation
    /// voxel, or 0 outside of the segmentation.
    ///
    /// # Errors
    /// A value is no label (an integer from 0 to 2^32 - 1), or there are more than [`MAX_LABELS`] labels.
    pub fn sampled(segmentation: &Volume, volume: &Volume) -> Result<Self> {
        let source = segmentation.dims();
        let [nx, ny, nz] = volume.dims();
        let to_source = segmentation.index_from_world() * volume.world_from_index();
        let resampled = source != [nx, ny, nz] || !is_identity(to_source, source);
        let voxels = nx * ny * nz;
        let same_grid = segmentation.resident().filter(|_| !resampled);
        let labels = if let Some(stored) = same_grid {
            let scaling = segmentation.scaling();
            with_voxels!(stored, a => {
                let stored = a.as_slice().unwrap_or_default();
                Self::new(voxels, |at| label(scaling.apply(stored[at].to_f64())), resampled)
            })
        } else {
            let nearest = |at: usize| {
                let index = DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64);
                let nearest = (to_source.transform_point3(index) + 0.5).floor();
                if !(0..3).all(|axis| (0.0..source[axis] as f64).contains(&nearest[axis])) {
                    return Ok(0);
                }
                let [i, j, k] = nearest.to_array().map(|c| c as usize);
                label(segmentation.value(i, j, k))
            };
            Self::new(voxels, nearest, resampled)
        };
        segmentation.check_reads()?;
        let mut labels =
            labels.map_err(|why| Error::input("cannot use labels", &segmentation.provenance.source, why))?;
        labels.segments.clone_from(&segmentation.provenance.segments);
        Ok(labels)
    }
}

/// Rounds a value of a segmentation volume to a label; returns the value as an error if it is none.
fn label(value: f64) -> std::result::Result<u32, f64> {
    let integer = value.round();
    let is_label =
        (value - integer).abs() <= INTEGER_TOLERANCE && (0.0..=f64::from(u32::MAX)).contains(&integer);
    if is_label { Ok(integer as u32) } else { Err(value) }
}

/// Whether an affine map of voxel indices leaves all corners of a voxel grid in place, within a small tolerance.
fn is_identity(map: DAffine3, dims: [usize; 3]) -> bool {
    (0..8).all(|corner| {
        let at = |axis: usize| if corner >> axis & 1 == 0 { 0.0 } else { dims[axis] as f64 };
        let index = DVec3::new(at(0), at(1), at(2));
        map.transform_point3(index).abs_diff_eq(index, GRID_TOLERANCE)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use ndarray::Array3;

    fn volume(voxels: impl Into<Voxels>, world_from_index: DAffine3) -> Volume {
        let provenance = Provenance::new("seg", "phantom", "test");
        Volume::new(voxels.into(), Scaling::IDENTITY, world_from_index, provenance).unwrap()
    }

    #[test]
    fn the_nearest_voxel_gives_the_label() {
        let grid = DAffine3::from_translation(DVec3::new(3.0, -2.0, 1.0));
        let scan = volume(Array3::<u8>::zeros((4, 3, 5)), grid);
        let seg = Array3::from_shape_fn((4, 3, 5), |(k, j, i)| ((i + j + k) % 3 * 100) as u16);
        let same = Labels::sampled(&volume(seg.clone(), grid), &scan).unwrap();
        assert_eq!((same.ids(), same.resampled), (&[0, 100, 200][..], false));
        let want: Vec<u8> = seg.iter().map(|v| (v / 100) as u8).collect();
        assert_eq!(same.ranks(), want);
        assert_eq!(same.counts().iter().sum::<usize>(), 60);
        // Twice the spacing and an offset: voxels outside the segmentation have label 0.
        let coarse =
            DAffine3::from_translation(DVec3::new(4.4, -2.0, 1.0)) * DAffine3::from_scale(DVec3::splat(2.0));
        let seg = Array3::from_shape_fn((2, 2, 2), |(k, j, i)| (1 + i + 2 * j + 4 * k) as u8);
        let labels = Labels::sampled(&volume(seg, coarse), &scan).unwrap();
        assert!(labels.resampled);
        let row: Vec<u32> = labels.ranks()[..5].iter().map(|r| labels.ids()[usize::from(*r)]).collect();
        assert_eq!(row, [0, 1, 1, 2, 2]);
    }

    #[test]
    fn invalid_labels_are_refused() {
        let scan = volume(Array3::<u8>::zeros((1, 1, 2)), DAffine3::IDENTITY);
        for (values, why) in [([0.0, 1.5], "1.5 is no label"), ([-1.0, 0.0], "-1 is no label")] {
            let seg = volume(Array3::from_shape_vec((1, 1, 2), values.to_vec()).unwrap(), DAffine3::IDENTITY);
            assert!(Labels::sampled(&seg, &scan).unwrap_err().why.contains(why));
        }
        let scan = volume(Array3::<u8>::zeros((1, 1, 300)), DAffine3::IDENTITY);
        let seg = volume(Array3::from_shape_fn((1, 1, 300), |(_, _, i)| i as u16), DAffine3::IDENTITY);
        assert!(Labels::sampled(&seg, &scan).unwrap_err().why.contains("at most 256"));
    }
}
