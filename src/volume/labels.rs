//! Labels of a segmentation on a volume's grid: a place has the label of the nearest voxel.

use rayon::prelude::*;

/// Different labels that a volume may have, 0 among them.
pub const MOST_LABELS: usize = 256;

/// A label for every voxel of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// The labels that occur, ascending; at most [`MOST_LABELS`].
    ids: Vec<u32>,
    /// Of each voxel in memory order the place of its label in `ids`.
    ranks: Vec<u8>,
    counts: Vec<usize>,
    /// Whether they come from a grid other than the volume's.
    pub resampled: bool,
}

impl Labels {
    /// From the label of each voxel, x fastest.
    ///
    /// # Errors
    /// More than [`MOST_LABELS`] different ones.
    pub(super) fn new(labels: &[u32], resampled: bool) -> Result<Self, String> {
        let distinct = |mut labels: Vec<u32>| {
            labels.sort_unstable();
            labels.dedup();
            labels
        };
        let of_chunks = labels.par_chunks(1 << 16).map(|chunk| distinct(chunk.to_vec()));
        let ids = of_chunks.reduce(Vec::new, |a, b| distinct([a, b].concat()));
        if ids.len() > MOST_LABELS {
            return Err(format!("{} different labels, at most {MOST_LABELS} are told apart", ids.len()));
        }
        let rank = |label: &u32| ids.partition_point(|id| id < label) as u8;
        let ranks: Vec<u8> = labels.par_iter().with_min_len(1 << 14).map(rank).collect();
        let mut counts = vec![0; ids.len()];
        ranks.iter().for_each(|rank| counts[usize::from(*rank)] += 1);
        Ok(Self { ids, ranks, counts, resampled })
    }

    /// The labels that occur, ascending.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Of each voxel in memory order the place of its label in [`Self::ids`].
    pub fn ranks(&self) -> &[u8] {
        &self.ranks
    }

    /// Voxels of each label that occurs, in the order of [`Self::ids`].
    pub fn counts(&self) -> &[usize] {
        &self.counts
    }
}
