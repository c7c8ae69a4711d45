//! Progress and cancellation of the reading of a volume.
//!
//! The thread that waits shares a [`Loading`] with the readers. They report what they do and how much of it is done, and check
//! now and then whether the reading was cancelled. A cancelled reading returns an error soon.

use super::memory_budget::MemoryBudget;
use crate::error::{Error, Result};
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Stages of a reading, in the order in which they happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReadingStage {
    /// Strands are read from their file, or generated.
    ReadingStrands,
    /// A file is read.
    #[default]
    Reading,
    /// A compressed file is read.
    Unpacking,
    /// A built-in volume is computed.
    Building,
    /// Strands become voxels.
    Voxelising,
    /// The range of the values is found.
    Checking,
    /// The histogram is made.
    Counting,
}

impl ReadingStage {
    /// Name shown to the user.
    pub fn name(self) -> &'static str {
        self.name_and_span().0
    }

    /// Name, and the shares of the whole reading at which the stage begins and ends.
    fn name_and_span(self) -> (&'static str, [f64; 2]) {
        match self {
            Self::ReadingStrands => ("reading strands", [0.0, 0.25]),
            Self::Reading => ("reading", [0.0, 0.85]),
            Self::Unpacking => ("unpacking", [0.0, 0.85]),
            Self::Building => ("building", [0.0, 0.85]),
            Self::Voxelising => ("voxelising", [0.25, 0.85]),
            Self::Checking => ("checking values", [0.85, 0.9]),
            Self::Counting => ("counting values", [0.9, 1.0]),
        }
    }
}

/// Progress of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadingProgress {
    /// Present stage.
    pub stage: ReadingStage,
    /// Share of the whole, 0 to 1; it never falls. [`crate::volume::Histogram::of_with`] is the last part.
    pub share: f64,
}

/// Reading that another thread can watch and cancel.
#[derive(Debug, Default)]
pub struct Loading {
    state: Mutex<State>,
    cancelled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    progress: ReadingProgress,
    budget: Option<MemoryBudget>,
    reduced: Option<Reduced>,
}

/// Reduction that a reader has applied to its voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reduced {
    /// Voxels along each axis before.
    pub from: [usize; 3],
    /// Voxels of a block along each axis that became one.
    pub factors: [usize; 3],
}

impl Loading {
    /// Progress so far.
    pub fn progress(&self) -> ReadingProgress {
        self.lock().progress
    }

    /// Ends the reading soon; it then returns an error.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the reading was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Refuses to continue after a cancellation; `source` is the file or name for the message.
    ///
    /// # Errors
    /// The reading was cancelled.
    pub fn go_on(&self, source: &str) -> Result<()> {
        match self.is_cancelled() {
            true => Err(Error::runtime("cannot read volume", source, "it was cancelled")),
            false => Ok(()),
        }
    }

    /// Sets the budget for readers that can reduce voxels as they arrive; `None` keeps all voxels.
    pub fn reduce_to(&self, budget: Option<MemoryBudget>) {
        let mut state = self.lock();
        (state.budget, state.reduced) = (budget, None);
    }

    /// Factors by which the calling reader must reduce a grid while it reads; `None` keeps all voxels.
    ///
    /// # Errors
    /// No factors make the grid fit the budget.
    pub fn factors_for(&self, dims: [usize; 3], voxel_bytes: u64) -> Result<Option<[usize; 3]>, String> {
        let mut state = self.lock();
        let factors = state.budget.map(|budget| budget.factors(dims, voxel_bytes)).transpose()?;
        state.reduced = factors.map(|factors| Reduced { from: dims, factors });
        Ok(factors)
    }

    /// Takes the reduction that a reader has applied, if any; the next call returns `None`.
    pub fn take_reduced(&self) -> Option<Reduced> {
        self.lock().reduced.take()
    }

    /// Begins a stage.
    pub fn begin(&self, stage: ReadingStage) {
        let progress = &mut self.lock().progress;
        progress.stage = stage;
        progress.share = progress.share.max(stage.name_and_span().1[0]);
    }

    /// Begins a stage of `total` equal pieces, which several threads may do.
    pub fn pieces(&self, stage: ReadingStage, total: usize) -> Pieces<'_> {
        self.begin(stage);
        Pieces { loading: self, total: total as u64, done: AtomicU64::new(0) }
    }

    /// Reports the share of the present stage that is done.
    fn note(&self, share: f64) {
        let progress = &mut self.lock().progress;
        let [from, to] = progress.stage.name_and_span().1;
        progress.share = progress.share.max(from + (to - from) * share.clamp(0.0, 1.0));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Plain data, valid after a panic elsewhere.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Equal pieces of a stage.
#[derive(Debug)]
pub struct Pieces<'a> {
    loading: &'a Loading,
    total: u64,
    done: AtomicU64,
}

impl Pieces<'_> {
    /// Counts one more piece as done.
    pub fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.loading.note(done as f64 / self.total.max(1) as f64);
    }

    /// Whether the reading was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.loading.is_cancelled()
    }
}

/// Reader that reports its position as progress, and fails once the reading was cancelled.
#[derive(Debug)]
pub struct Watched<'a, R> {
    input: R,
    loading: &'a Loading,
    at: u64,
    end: u64,
}

impl<'a, R> Watched<'a, R> {
    /// Watches an input that is read up to byte `end`.
    pub fn new(input: R, end: u64, loading: &'a Loading) -> Self {
        Self { input, loading, at: 0, end }
    }

    /// The reading to which progress is reported.
    pub fn loading(&self) -> &'a Loading {
        self.loading
    }

    /// Changes the byte up to which the input is read.
    pub fn ends_at(&mut self, end: u64) {
        self.end = end;
    }
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.loading.is_cancelled() {
            return Err(io::Error::other("it was cancelled"));
        }
        let got = self.input.read(buffer)?;
        self.at += got as u64;
        self.loading.note(self.at as f64 / self.end.max(1) as f64);
        Ok(got)
    }
}

impl<R: Seek> Seek for Watched<'_, R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.input.seek(to)?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_never_falls() {
        let loading = Loading::default();
        loading.begin(ReadingStage::Reading);
        loading.note(0.5);
        assert_eq!(loading.progress(), ReadingProgress { stage: ReadingStage::Reading, share: 0.425 });
        loading.note(0.1);
        assert_eq!(loading.progress().share, 0.425);
        let pieces = loading.pieces(ReadingStage::Counting, 4);
        assert_eq!(loading.progress(), ReadingProgress { stage: ReadingStage::Counting, share: 0.9 });
        (0..4).for_each(|_| pieces.done());
        assert_eq!(loading.progress().share, 1.0);
        loading.begin(ReadingStage::Checking);
        assert_eq!(loading.progress().share, 1.0);
    }

    #[test]
    fn a_cancelled_file_is_read_no_further() {
        let loading = Loading::default();
        let mut file = Watched::new(io::repeat(1), 8, &loading);
        let mut buffer = [0; 4];
        assert_eq!(file.read(&mut buffer).unwrap(), 4);
        assert_eq!(loading.progress().share, 0.425);
        loading.cancel();
        assert!(file.read(&mut buffer).is_err());
        assert!(loading.go_on("a.nii").unwrap_err().to_string().contains("a.nii"));
    }
}
