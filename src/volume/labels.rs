//! Segmentation labels of the voxels of a volume.

use crate::files::memory_budget::{reduced_dims, refuse_beyond_host};
use rayon::prelude::*;

/// Largest number of different segmentation labels of a volume, including label 0.
pub const MAX_LABELS: usize = 256;

/// Number of voxels that one parallel task processes when labels are collected.
const CHUNK: usize = 1 << 16;

/// Segment of a segmentation file: a label with a name and a colour.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Segment {
    /// Label of the segment's voxels.
    pub label: u32,
    /// Name of the segment, such as `liver`.
    pub name: String,
    /// Colour of the segment, sRGB from 0 to 1; `None` if the file has none.
    pub color: Option<[f32; 3]>,
}

/// Segmentation label of every voxel of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// Segmentation labels that occur in the volume, ascending; at most [`MAX_LABELS`].
    ids: Vec<u32>,
    /// Segmentation label of each voxel as an index into `ids`, x fastest.
    ranks: Vec<u8>,
    counts: Vec<usize>,
    /// Named segments of the segmentation file; empty if it has no names.
    pub segments: Vec<Segment>,
    /// Whether the segmentation was resampled, because its grid differs from that of the volume.
    pub resampled: bool,
}

impl Labels {
    /// Collects the segmentation labels of all voxels, x fastest. It calls `label_at` twice per voxel to need only
    /// one byte of memory for each.
    pub(super) fn new(
        voxels: usize,
        label_at: impl Fn(usize) -> Result<u32, f64> + Sync,
        resampled: bool,
    ) -> Result<Self, String> {
        refuse_beyond_host(Some(voxels as u64))?;
        let distinct = |mut labels: Vec<u32>| {
            labels.sort_unstable();
            labels.dedup();
            labels
        };
        let labels_of_chunk = |chunk: usize| {
            let mut labels: Vec<u32> = Vec::new();
            for at in chunk * CHUNK..((chunk + 1) * CHUNK).min(voxels) {
                let label = label_at(at)?;
                if labels.last() != Some(&label) {
                    labels.push(label);
                }
            }
            Ok(distinct(labels))
        };
        let ids = (0..voxels.div_ceil(CHUNK))
            .into_par_iter()
            .map(labels_of_chunk)
            .try_reduce(Vec::new, |a, b| Ok(distinct([a, b].concat())))
            .map_err(|value: f64| format!("{value} is no label: labels are integers from 0 on"))?;
        if ids.len() > MAX_LABELS {
            return Err(format!("{} different labels, at most {MAX_LABELS} are supported", ids.len()));
        }
        let mut ranks: Vec<u8> = Vec::new();
        ranks.try_reserve_exact(voxels).map_err(|_| "not enough memory for the labels")?;
        let rank = |at: usize| label_at(at).map_or(0, |label| ids.partition_point(|id| *id < label) as u8);
        ranks.par_extend((0..voxels).into_par_iter().with_min_len(CHUNK).map(rank));
        let mut counts = vec![0; ids.len()];
        ranks.iter().for_each(|rank| counts[usize::from(*rank)] += 1);
        Ok(Self { ids, ranks, counts, segments: Vec::new(), resampled })
    }

    /// Returns the labels of the middle voxels of blocks of `factors` voxels, in a volume of `dims` voxels.
    pub(super) fn downsampled(&self, dims: [usize; 3], factors: [usize; 3]) -> Result<Self, String> {
        let [nx, ny, _] = dims;
        let [width, height, depth] = reduced_dims(dims, factors);
        let label_at = |at: usize| {
            let block = [at % width, at / width % height, at / (width * height)];
            let middle = |a: usize| (block[a] * factors[a] + factors[a] / 2).min(dims[a] - 1);
            let [i, j, k] = [0, 1, 2].map(middle);
            Ok(self.ids[usize::from(self.ranks[(k * ny + j) * nx + i])])
        };
        let labels = Self::new(width * height * depth, label_at, self.resampled)?;
        Ok(Self { segments: self.segments.clone(), ..labels })
    }

    /// Returns the segmentation labels that occur in the volume, ascending.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Returns the segmentation label of each voxel as an index into [`Self::ids`], x fastest.
    pub fn ranks(&self) -> &[u8] {
        &self.ranks
    }

    /// Returns the named segment of a segmentation label.
    pub fn segment(&self, label: u32) -> Option<&Segment> {
        self.segments.iter().find(|segment| segment.label == label)
    }

    /// Returns the number of voxels of each segmentation label of [`Self::ids`].
    pub fn counts(&self) -> &[usize] {
        &self.counts
    }
}
