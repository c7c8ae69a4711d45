//! Crops a volume to a box of voxel indices.

use super::source::CroppedSource;
use super::{Volume, VoxelStorage, Voxels};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::with_voxels;
use glam::{DAffine3, DVec3};
use ndarray::{Array3, s};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Crop box `x0:x1,y0:y1,z0:z1` in voxel indices, both ends inclusive. A missing index means the first or last voxel
/// of the volume.
///
/// The cropped volume is independent: its field is clamped at its own edges and ends half a voxel beyond them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Crop {
    /// First and last voxel index of the crop box along i, j, k.
    pub ranges: [[Option<usize>; 2]; 3],
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse =
            || format!("`{text}` is not x0:x1,y0:y1,z0:z1 (voxel indices from 0; parts may be empty)");
        let parts: Vec<&str> = text.split(',').collect();
        let parts: [&str; 3] = parts.try_into().map_err(|_| refuse())?;
        let end = |text: &str| match text.trim() {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| refuse()),
        };
        let mut ranges = [[None; 2]; 3];
        for (range, part) in ranges.iter_mut().zip(parts) {
            let (from, to) = match part.split_once(':') {
                Some((from, to)) => (end(from)?, end(to)?),
                None if part.trim().is_empty() => (None, None),
                None => return Err(refuse()),
            };
            if from.zip(to).is_some_and(|(from, to)| from > to) {
                return Err(format!("`{part}` ends before it begins"));
            }
            *range = [from, to];
        }
        Ok(Self { ranges })
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |end: Option<usize>| end.map(|n| n.to_string()).unwrap_or_default();
        let [x, y, z] = self.ranges.map(|[from, to]| format!("{}:{}", end(from), end(to)));
        write!(f, "{x},{y},{z}")
    }
}

impl serde::Serialize for Crop {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Volume {
    /// Crops the volume to a box; the voxels keep their world positions.
    ///
    /// # Errors
    /// The crop box exceeds the volume, or no finite value remains.
    pub fn cropped(self, crop: Crop, loading: &Loading) -> Result<Self> {
        let dims = self.dims();
        let mut ranges = [[0; 2]; 3];
        for (axis, range) in crop.ranges.iter().enumerate() {
            let last = dims[axis] - 1;
            ranges[axis] = [range[0].unwrap_or(0), range[1].unwrap_or(last)];
            if ranges[axis].iter().any(|&n| n > last) {
                let why = format!("{} runs from 0 to {last}, and {crop} goes beyond", ["x", "y", "z"][axis]);
                return Err(Error::input("cannot crop volume", "--crop", why));
            }
        }
        if ranges.iter().zip(dims).all(|([from, to], n)| *from == 0 && *to == n - 1) {
            return Ok(self);
        }
        let [[x0, x1], [y0, y1], [z0, z1]] = ranges;
        fn part<T: Clone>(array: &Array3<T>, [x, y, z]: [[usize; 2]; 3]) -> Array3<T> {
            array.slice(s![z[0]..=z[1], y[0]..=y[1], x[0]..=x[1]]).as_standard_layout().into_owned()
        }
        let storage = match &self.storage {
            VoxelStorage::Resident(voxels) => {
                let part: Voxels = with_voxels!(voxels, a => part(a, [[x0, x1], [y0, y1], [z0, z1]]).into());
                part.into()
            }
            VoxelStorage::OutOfCore(parts) => {
                let (parts, host_bytes) = (Arc::clone(parts), parts.host_bytes());
                let part = [x0..x1 + 1, y0..y1 + 1, z0..z1 + 1];
                VoxelStorage::limited(CroppedSource { parts, part }, host_bytes)?
            }
        };
        let first = DVec3::new(x0 as f64, y0 as f64, z0 as f64);
        let world_from_index = self.world_from_index * DAffine3::from_translation(first);
        Self::from_storage(storage, self.scaling, world_from_index, self.provenance, loading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling};

    #[test]
    fn texts() {
        for (text, same) in [("1:2,3:4,5:6", "1:2,3:4,5:6"), (":2,,5:", ":2,:,5:"), (",,", ":,:,:")] {
            assert_eq!(text.parse::<Crop>().unwrap().to_string(), same);
        }
        for bad in ["", "1:2", "1:2,3:4,5:6,7:8", "a:2,,", "3:1,,", "-1:2,,", "1,,"] {
            assert!(bad.parse::<Crop>().is_err(), "{bad}");
        }
    }

    #[test]
    fn voxels_keep_their_world_positions() {
        let values = Array3::from_shape_fn((20, 20, 20), |(k, j, i)| (400 * k + 20 * j + i) as u16);
        let affine = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 2.0, 3.0),
            glam::DQuat::from_rotation_y(0.3),
            DVec3::new(-7.0, 8.0, 9.0),
        );
        let provenance = Provenance::new("test", "test", "uint16");
        let whole = Volume::new(values.into(), Scaling::IDENTITY, affine, provenance).unwrap();
        let part = whole.clone().cropped("3:9,:5,17:".parse().unwrap(), &Loading::default()).unwrap();
        assert_eq!(part.dims(), [7, 6, 3]);
        for (i, j, k) in [(0, 0, 0), (6, 5, 2), (3, 1, 1)] {
            assert_eq!(part.value(i, j, k), whole.value(i + 3, j, k + 17));
            let at = |v: &Volume, i: usize, j: usize, k: usize| {
                v.world_from_index().transform_point3(DVec3::new(i as f64, j as f64, k as f64))
            };
            assert!((at(&part, i, j, k) - at(&whole, i + 3, j, k + 17)).length() < 1e-12);
        }
        let beyond = whole.cropped("0:20,,".parse().unwrap(), &Loading::default()).unwrap_err();
        assert!(beyond.why.contains("from 0 to 19"), "{beyond}");
    }
}
