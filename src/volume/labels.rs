//! Labels of a segmentation on a volume's grid: a place has the label of the nearest voxel.

use super::Volume;
use crate::error::{Error, Result};
use crate::with_voxels;
use glam::DVec3;
use ndarray::Array3;
use rayon::prelude::*;
use std::sync::Arc;

/// Different labels that a volume may have, 0 among them.
pub const MOST_LABELS: usize = 256;
/// How far a stored label may lie from a whole number.
const WHOLE: f64 = 1e-3;

/// A label for every voxel of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// The labels that occur, ascending; at most [`MOST_LABELS`].
    ids: Vec<u32>,
    /// Of each voxel `[[k, j, i]]` the place of its label in `ids`.
    ranks: Array3<u8>,
    counts: Vec<usize>,
    /// Whether they come from a grid other than the volume's.
    pub resampled: bool,
}

impl Labels {
    /// The labels of a segmentation at the voxels of `volume`, by the nearest of its own voxels; 0 outside of it.
    ///
    /// # Errors
    /// A value that is no label (a whole number from 0 to 2^32 - 1), or more than [`MOST_LABELS`] of them.
    pub fn sampled(segmentation: &Volume, volume: &Volume) -> Result<Self> {
        let refuse = |why: String| Error::input("cannot use labels", &segmentation.provenance.source, why);
        let source = segmentation.dims();
        let [nx, ny, nz] = volume.dims();
        let to_source = segmentation.index_from_world() * volume.world_from_index();
        let resampled = source != [nx, ny, nz] || !is_identity(to_source, [nx, ny, nz]);
        let label_at = |place: usize| -> std::result::Result<u32, f64> {
            let index = DVec3::new((place % nx) as f64, (place / nx % ny) as f64, (place / (nx * ny)) as f64);
            let nearest = (to_source.transform_point3(index) + 0.5).floor();
            let inside =
                nearest.cmpge(DVec3::ZERO).all() && (0..3).all(|axis| nearest[axis] < source[axis] as f64);
            if !inside {
                return Ok(0);
            }
            let [i, j, k] = nearest.to_array().map(|c| c as usize);
            let value = segmentation.value(i, j, k);
            let whole = value.round();
            let fits = (value - whole).abs() <= WHOLE && (0.0..=f64::from(u32::MAX)).contains(&whole);
            if fits { Ok(whole as u32) } else { Err(value) }
        };
        let labels: Vec<u32> = (0..nx * ny * nz)
            .into_par_iter()
            .with_min_len(1 << 14)
            .map(label_at)
            .collect::<std::result::Result<_, f64>>()
            .map_err(|value| refuse(format!("{value} is no label: labels are whole numbers from 0 on")))?;
        let mut ids: Vec<u32> = labels
            .par_chunks(1 << 16)
            .map(|chunk| {
                let mut ids = chunk.to_vec();
                ids.sort_unstable();
                ids.dedup();
                ids
            })
            .reduce(Vec::new, |mut a, b| {
                a.extend(b);
                a.sort_unstable();
                a.dedup();
                a
            });
        ids.shrink_to_fit();
        if ids.len() > MOST_LABELS {
            return Err(refuse(format!(
                "{} different labels, at most {MOST_LABELS} are told apart",
                ids.len()
            )));
        }
        let rank = |label: &u32| ids.partition_point(|id| id < label) as u8;
        let ranks: Vec<u8> = labels.par_iter().with_min_len(1 << 14).map(rank).collect();
        let mut counts = vec![0; ids.len()];
        ranks.iter().for_each(|rank| counts[usize::from(*rank)] += 1);
        let ranks = Array3::from_shape_vec((nz, ny, nx), ranks).map_err(|e| refuse(e.to_string()))?;
        Ok(Self { ids, ranks, counts, resampled })
    }

    /// The labels that occur, ascending.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Of each voxel in memory order the place of its label in [`Self::ids`].
    pub fn ranks(&self) -> &[u8] {
        self.ranks.as_slice().unwrap_or_default()
    }

    /// Voxels of each label that occurs, in the order of [`Self::ids`].
    pub fn counts(&self) -> &[usize] {
        &self.counts
    }
}

/// Whether a map of indices moves no voxel of such a grid by as much as a thousandth.
fn is_identity(map: glam::DAffine3, dims: [usize; 3]) -> bool {
    (0..8).all(|corner| {
        let at = |axis: usize| if corner >> axis & 1 == 0 { 0.0 } else { dims[axis] as f64 };
        let index = DVec3::new(at(0), at(1), at(2));
        map.transform_point3(index).abs_diff_eq(index, 1e-3)
    })
}

impl Volume {
    /// What a segmentation calls its voxels, where there is one.
    pub fn labels(&self) -> Option<&Arc<Labels>> {
        self.labels.as_ref()
    }

    /// The same with labels for its voxels.
    ///
    /// # Errors
    /// Labels for another number of voxels.
    pub fn labelled(self, labels: Arc<Labels>) -> Result<Self> {
        let voxels = with_voxels!(self.voxels(), a => a.len());
        if labels.ranks().len() != voxels {
            let why = format!("{} labels for {voxels} voxels", labels.ranks().len());
            return Err(Error::input("cannot use labels", &self.provenance.source, why));
        }
        Ok(Self { labels: Some(labels), ..self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::DAffine3;

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
        // Twice as coarse, and one voxel off at one end: what lies outside is 0.
        let coarse =
            DAffine3::from_translation(DVec3::new(4.4, -2.0, 1.0)) * DAffine3::from_scale(DVec3::splat(2.0));
        let seg = Array3::from_shape_fn((2, 2, 2), |(k, j, i)| (1 + i + 2 * j + 4 * k) as u8);
        let labels = Labels::sampled(&volume(seg, coarse), &scan).unwrap();
        assert!(labels.resampled);
        let row: Vec<u32> = labels.ranks()[..5].iter().map(|r| labels.ids()[usize::from(*r)]).collect();
        assert_eq!(row, [0, 1, 1, 2, 2]);
    }

    #[test]
    fn what_is_no_label_is_refused() {
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
