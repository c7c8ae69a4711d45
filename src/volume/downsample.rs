//! Downsamples a volume to means of voxel blocks, by integer factors along each axis.

use super::{ByteCount, Volume, Voxel, VoxelBlock, Voxels};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::memory_budget::reduced_dims;
use crate::with_voxel_type;
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Amount of downsampling of a volume: automatic, by a memory limit, or by given factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Downsample {
    /// Downsamples to a size that fits the textures of the GPU and the free memory.
    Auto,
    /// Downsamples to a limit of voxel memory on the host, bytes.
    Bytes(u64),
    /// Downsampling factors along i, j, k: the number of voxels that are averaged to one.
    Factors([usize; 3]),
}

/// Largest downsampling factor along an axis.
const MAX_FACTOR: usize = 1024;

impl FromStr for Downsample {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse =
            || format!("`{text}` is not auto, bytes like 2GiB, or factors like 2x2x1 (1 to {MAX_FACTOR})");
        if text == "auto" {
            return Ok(Self::Auto);
        }
        if let Ok(ByteCount(bytes)) = text.parse() {
            return Ok(Self::Bytes(bytes));
        }
        let factors: Option<Vec<usize>> = text.split('x').map(|n| n.trim().parse().ok()).collect();
        let factors: Option<[usize; 3]> = factors.and_then(|list| list.try_into().ok());
        let factors = factors.filter(|factors| factors.iter().all(|n| (1..=MAX_FACTOR).contains(n)));
        factors.map(Self::Factors).ok_or_else(refuse)
    }
}

impl fmt::Display for Downsample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => write!(f, "auto"),
            Self::Bytes(bytes) => write!(f, "{bytes}B"),
            Self::Factors([x, y, z]) => write!(f, "{x}x{y}x{z}"),
        }
    }
}

impl serde::Serialize for Downsample {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Downsampler that averages blocks of voxels while the rows of a volume arrive in order.
pub(super) struct BlockMeans<T> {
    dims: [usize; 3],
    factors: [usize; 3],
    /// Sum and number of the finite voxel values of each block in the current layer of blocks.
    sums: Vec<f64>,
    counts: Vec<u32>,
    rows: usize,
    values: Vec<T>,
}

impl<T: Voxel> BlockMeans<T> {
    /// Creates a downsampler with blocks of `factors` voxels; `None` without memory for one layer of blocks.
    pub(super) fn new(dims: [usize; 3], factors: [usize; 3]) -> Option<Self> {
        let [width, height, _] = reduced_dims(dims, factors);
        let layer = width.checked_mul(height)?;
        let (mut sums, mut counts) = (Vec::new(), Vec::new());
        sums.try_reserve_exact(layer).ok()?;
        counts.try_reserve_exact(layer).ok()?;
        sums.resize(layer, 0.0);
        counts.resize(layer, 0);
        Some(Self { dims, factors, sums, counts, rows: 0, values: Vec::new() })
    }

    /// Adds the next row of voxels to the means of the voxel blocks; `None` without memory for the means.
    pub(super) fn push_row(&mut self, row: &[T]) -> Option<()> {
        let ([_, ny, nz], [fx, fy, fz]) = (self.dims, self.factors);
        let (j, k) = (self.rows % ny, self.rows / ny);
        let width = row.len().div_ceil(fx);
        let place = j / fy * width..(j / fy + 1) * width;
        let cells = self.sums[place.clone()].iter_mut().zip(&mut self.counts[place]);
        for ((sum, count), values) in cells.zip(row.chunks(fx)) {
            for value in values.iter().map(|v| v.to_f64()).filter(|v| v.is_finite()) {
                *sum += value;
                *count += 1;
            }
        }
        self.rows += 1;
        if j + 1 == ny && ((k + 1) % fz == 0 || k + 1 == nz) {
            self.values.try_reserve(self.sums.len()).ok()?;
            // The mean of a block without finite values is NaN.
            let means =
                self.sums.iter().zip(&self.counts).map(|(sum, count)| T::nearest(sum / f64::from(*count)));
            self.values.extend(means);
            self.sums.fill(0.0);
            self.counts.fill(0);
        }
        Some(())
    }

    /// Adds the rows of a block of whole slices; `None` without memory for the means.
    fn push_block(&mut self, block: &VoxelBlock<'_>) -> Option<()> {
        let rows = T::slice_of(block.voxels())?.chunks_exact(self.dims[0]);
        rows.into_iter().try_for_each(|row| self.push_row(row))
    }

    /// Returns the downsampled voxels; `None` if rows are missing.
    pub(super) fn finish(self) -> Option<Array3<T>> {
        let [x, y, z] = reduced_dims(self.dims, self.factors);
        Array3::from_shape_vec((z, y, x), self.values).ok()
    }
}

impl Volume {
    /// Downsamples the volume to means of voxel blocks, rounded to the stored type. Incomplete blocks at the far ends
    /// are averaged too. The label of a block is that of the voxel in its middle.
    ///
    /// # Errors
    /// There is not enough memory for the downsampled voxels, or downsampling was cancelled.
    pub fn downsampled(&self, factors: [usize; 3], loading: &Loading) -> Result<Self> {
        let refuse = |why: &str| Error::runtime("cannot reduce volume", &self.provenance.source, why);
        let none = || refuse("not enough memory for the downsampled voxels");
        let dims = self.dims();
        let voxels = with_voxel_type!(self.element(), T => {
            let mut means = BlockMeans::<T>::new(dims, factors).ok_or_else(none)?;
            for slab in self.slabs(0, 1) {
                loading.go_on(&self.provenance.source)?;
                means.push_block(&slab?.1).ok_or_else(none)?;
            }
            Voxels::from(means.finish().ok_or_else(none)?)
        });
        let provenance = self.provenance.clone();
        let volume = Self::new_with(voxels, self.scaling, self.world_from_index, provenance, loading)?;
        let volume = volume.downsampled_from(factors, dims);
        let Some(labels) = self.labels() else { return Ok(volume) };
        let labels = labels.downsampled(dims, factors).map_err(|why| refuse(&why))?;
        volume.labelled(Arc::new(labels))
    }

    /// Adjusts the affine of a volume that was downsampled from a grid of `from` voxels, and adds a warning that it
    /// was downsampled.
    pub(crate) fn downsampled_from(mut self, factors: [usize; 3], from: [usize; 3]) -> Self {
        let [fx, fy, fz] = factors;
        let scale = DVec3::from_array(factors.map(|n| n as f64));
        let block_centre = 0.5 * (scale - 1.0);
        self.world_from_index *= DAffine3::from_translation(block_centre) * DAffine3::from_scale(scale);
        self.index_from_world = self.world_from_index.inverse();
        let ([nx, ny, nz], [x, y, z]) = (from, self.dims());
        let note = format!(
            "reduced by {fx}x{fy}x{fz} from {nx} x {ny} x {nz} to {x} x {y} x {z} voxels: means of blocks"
        );
        self.provenance.warnings.push(note);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Labels, Provenance, Scaling};

    #[test]
    fn texts() {
        for text in ["auto", "2x2x1", "1x1x1024", "2097152B"] {
            assert_eq!(text.parse::<Downsample>().unwrap().to_string(), text);
        }
        assert_eq!("2GiB".parse(), Ok(Downsample::Bytes(1 << 31)));
        assert_eq!("1.5 MB".parse(), Ok(Downsample::Bytes(1_500_000)));
        for bytes in [1u64, 999, 1001, 123_456_789_013, (1 << 52) + 1] {
            assert_eq!(Downsample::Bytes(bytes).to_string().parse(), Ok(Downsample::Bytes(bytes)));
        }
        for bad in
            ["", "2", "2x2", "0x1x1", "2x2x2x2", "1025x1x1", "GiB", "-1GiB", "0kB", "nanMiB", "2x2x1.5"]
        {
            assert!(bad.parse::<Downsample>().is_err(), "{bad}");
        }
    }

    #[test]
    fn blocks_keep_their_means_and_positions() {
        let values = Array3::from_shape_fn((5, 4, 7), |(k, j, i)| (100 * k + 10 * j + i) as f32);
        let affine =
            DAffine3::from_cols_array(&[0.5, 0.25, 0.0, -1.0, 2.0, 0.0, 0.0, 0.5, 3.0, 7.0, -8.0, 9.0]);
        let provenance = Provenance::new("test", "test", "float32");
        let scaling = Scaling { slope: 2.0, intercept: 1.0 };
        let whole = Volume::new(Voxels::F32(values), scaling, affine, provenance).unwrap();
        let part = whole.downsampled([2, 1, 3], &Loading::default()).unwrap();
        assert_eq!(part.dims(), [4, 4, 2]);
        for (k, j, i) in [(0, 0, 0), (0, 3, 2), (1, 2, 3)] {
            let (mut sum, mut count, mut place) = (0.0, 0.0, DVec3::ZERO);
            for (z, x) in
                (3 * k..(3 * k + 3).min(5)).flat_map(|z| (2 * i..(2 * i + 2).min(7)).map(move |x| (z, x)))
            {
                sum += whole.value(x, j, z);
                count += 1.0;
            }
            assert!((part.value(i, j, k) - sum / count).abs() < 1e-4, "{i} {j} {k}");
            for (z, x) in (3 * k..3 * k + 3).flat_map(|z| (2 * i..2 * i + 2).map(move |x| (z, x))) {
                place += affine.transform_point3(DVec3::new(x as f64, j as f64, z as f64)) / 6.0;
            }
            let at = part.world_from_index().transform_point3(DVec3::new(i as f64, j as f64, k as f64));
            assert!((at - place).length() < 1e-12);
            assert!((part.index_from_world().transform_point3(place).x - i as f64).abs() < 1e-12);
        }
        assert!(part.provenance.warnings[0].contains("reduced by 2x1x3 from 7 x 4 x 5 to 4 x 4 x 2"));
    }

    #[test]
    fn blocks_have_the_label_of_their_middle() {
        let dims = [5, 4, 3];
        let label_at = |at: usize| Ok((at % 5 + 10 * (at / 5 % 4) + 100 * (at / 20)) as u32);
        let labels = Labels::new(dims.iter().product(), label_at, false).unwrap();
        let voxels = Voxels::U8(Array3::zeros((3, 4, 5)));
        let provenance = Provenance::new("test", "test", "test");
        let whole = Volume::new(voxels, Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap();
        let whole = whole.labelled(Arc::new(labels)).unwrap();
        let part = whole.downsampled([3, 2, 2], &Loading::default()).unwrap();
        let labels = part.labels().unwrap();
        let found: Vec<u32> = labels.ranks().iter().map(|rank| labels.ids()[usize::from(*rank)]).collect();
        // Incomplete blocks have the label of their last voxel.
        assert_eq!(found, [111, 114, 131, 134, 211, 214, 231, 234]);
    }

    #[test]
    fn integers_are_rounded_and_non_finite_values_skipped() {
        let reduced = |voxels: Voxels| {
            let provenance = Provenance::new("test", "test", "test");
            let volume = Volume::new(voxels, Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap();
            let volume = volume.downsampled([2, 1, 1], &Loading::default()).unwrap();
            [volume.value(0, 0, 0), volume.value(1, 0, 0)]
        };
        let row = |a: [i16; 4]| Voxels::I16(Array3::from_shape_vec((1, 1, 4), a.to_vec()).unwrap());
        assert_eq!(reduced(row([-3, -4, 7, 9])), [-4.0, 8.0]);
        let mut means = BlockMeans::<f32>::new([4, 1, 1], [2, 1, 1]).unwrap();
        means.push_row(&[f32::NAN, 3.0, f32::NAN, f32::INFINITY]).unwrap();
        let means = means.finish().unwrap();
        assert!(means[[0, 0, 0]] == 3.0 && means[[0, 0, 1]].is_nan());
    }
}
