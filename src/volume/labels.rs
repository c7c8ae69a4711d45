//! Labels of a segmentation on a volume's grid: a place has the label of the nearest voxel.

use crate::files::memory_budget::refuse_beyond_host;
use rayon::prelude::*;

/// Different labels that a volume may have, 0 among them.
pub const MOST_LABELS: usize = 256;

/// Voxels that are looked through at a time.
const CHUNK: usize = 1 << 16;

/// Why voxels have no labels.
#[derive(Debug)]
pub(super) enum NoLabels {
    /// This value is none.
    NoLabel(f64),
    /// In words.
    Other(String),
}

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
    /// From what calls each of so many voxels, x fastest; asked twice, so that memory is taken for the places alone.
    ///
    /// # Errors
    /// See [`NoLabels`].
    pub(super) fn new(
        voxels: usize,
        label_at: impl Fn(usize) -> Result<u32, f64> + Sync,
        resampled: bool,
    ) -> Result<Self, NoLabels> {
        refuse_beyond_host(Some(voxels as u64)).map_err(NoLabels::Other)?;
        let distinct = |mut labels: Vec<u32>| {
            labels.sort_unstable();
            labels.dedup();
            labels
        };
        let chunks = || (0..voxels.div_ceil(CHUNK)).into_par_iter();
        let places = |chunk: usize| chunk * CHUNK..((chunk + 1) * CHUNK).min(voxels);
        let of_chunk = |chunk: usize| {
            let mut found: Vec<u32> = Vec::new();
            let mut last = None;
            for place in places(chunk) {
                let label = label_at(place).map_err(NoLabels::NoLabel)?;
                if last != Some(label) {
                    found.push(label);
                    last = Some(label);
                }
            }
            Ok(distinct(found))
        };
        let ids = chunks().map(of_chunk).try_reduce(Vec::new, |a, b| Ok(distinct([a, b].concat())))?;
        if ids.len() > MOST_LABELS {
            let why = format!("{} different labels, at most {MOST_LABELS} are told apart", ids.len());
            return Err(NoLabels::Other(why));
        }
        let mut ranks: Vec<u8> = Vec::new();
        let no_memory = |_| NoLabels::Other("not enough memory for the labels".into());
        ranks.try_reserve_exact(voxels).map_err(no_memory)?;
        let rank =
            |place: usize| label_at(place).map_or(0, |label| ids.partition_point(|id| *id < label) as u8);
        ranks.par_extend((0..voxels).into_par_iter().with_min_len(CHUNK).map(rank));
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
