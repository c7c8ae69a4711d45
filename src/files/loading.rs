//! Reports the progress of reading a volume, and cancels the reading on request.
//!
//! The waiting thread shares a [`Loading`] with the readers. They report their stage and the finished fraction, and
//! regularly check whether the reading was cancelled. A cancelled reading soon returns an error.

use super::memory_budget::{MemoryBudget, grid_bytes};
use crate::error::{Error, Result};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Stage of reading a volume, in the order in which the stages happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReadingStage {
    /// Stage that reads strands (curves such as hair or fibres) from their file, or generates them.
    ReadingStrands,
    /// Stage that reads an uncompressed volume file.
    #[default]
    Reading,
    /// Stage that reads and decompresses a compressed volume file.
    Unpacking,
    /// Stage that computes a built-in volume (phantom).
    Building,
    /// Stage that converts strands to voxels.
    Voxelising,
    /// Stage that finds the range of the voxel values.
    Checking,
    /// Stage that computes the histogram of the voxel values.
    Counting,
}

impl ReadingStage {
    /// Name of a stage of reading a volume, shown to the user.
    pub fn name(self) -> &'static str {
        self.name_and_span().0
    }

    /// Name of a stage of reading a volume, and its start and end as fractions of the whole reading.
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

/// Progress of reading a volume.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadingProgress {
    /// Current stage of reading the volume.
    pub stage: ReadingStage,
    /// Finished fraction of reading a volume, 0 to 1; it never decreases. The histogram of the voxel values
    /// ([`crate::volume::Histogram::of_with`]) is computed last.
    pub share: f64,
}

/// Handle to the reading of a volume, with which another thread can watch and cancel it.
#[derive(Debug, Default)]
pub struct Loading {
    state: Mutex<State>,
    cancelled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    progress: ReadingProgress,
    budget: Option<MemoryBudget>,
    host: HostLimit,
    reduced: Option<Reduced>,
}

/// Limit on host memory for the voxels of a volume.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct HostLimit {
    /// Number of bytes; volumes with more voxels are read in parts. `None` reads no volume in parts.
    pub bytes: Option<u64>,
    /// Folder for the voxels of compressed files that exceed the limit; `None` refuses them.
    pub scratch: Option<PathBuf>,
}

/// Downsampling that a reader has applied to the voxels of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reduced {
    /// Number of voxels along x, y and z before downsampling.
    pub from: [usize; 3],
    /// Downsampling factors along x, y and z: size in voxels of the block that became one voxel.
    pub factors: [usize; 3],
}

impl Loading {
    /// Returns the current progress of reading the volume.
    pub fn progress(&self) -> ReadingProgress {
        self.lock().progress
    }

    /// Requests that the reading of the volume is cancelled; it then soon returns an error.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Returns whether the reading of the volume was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Returns an error if the reading of the volume was cancelled; `source` is the file or name that the error
    /// message states.
    ///
    /// # Errors
    /// The reading was cancelled.
    pub fn go_on(&self, source: &str) -> Result<()> {
        match self.is_cancelled() {
            true => Err(Error::runtime("cannot read volume", source, "it was cancelled")),
            false => Ok(()),
        }
    }

    /// Sets the memory budget for readers that can downsample voxels while they read; `None` keeps all voxels.
    pub fn reduce_to(&self, budget: Option<MemoryBudget>) {
        let mut state = self.lock();
        (state.budget, state.reduced) = (budget, None);
    }

    /// Returns the factors by which the calling reader must downsample a volume while it reads; `None` keeps all
    /// voxels.
    ///
    /// # Errors
    /// No factors make the volume fit the memory budget.
    pub fn factors_for(&self, dims: [usize; 3], voxel_bytes: u64) -> Result<Option<[usize; 3]>, String> {
        let mut state = self.lock();
        let factors = state.budget.map(|budget| budget.factors(dims, voxel_bytes)).transpose()?;
        state.reduced = factors.map(|factors| Reduced { from: dims, factors });
        Ok(factors)
    }

    /// Sets the limit on host memory for voxels.
    pub fn limit_host(&self, limit: HostLimit) {
        self.lock().host = limit;
    }

    /// Returns the limit on host memory, in bytes, for a reader that must read a volume in parts; `None` if all of its
    /// voxels fit.
    pub fn out_of_core_limit(&self, dims: [usize; 3], voxel_bytes: u64) -> Option<u64> {
        let limit = self.lock().host.bytes?;
        let fits = grid_bytes(dims, voxel_bytes).is_some_and(|bytes| bytes <= limit);
        (!fits).then_some(limit)
    }

    /// Whether readers that can downsample while they read shall do so.
    pub fn is_reducing(&self) -> bool {
        self.lock().budget.is_some()
    }

    /// Returns the folder for the voxels of compressed files that exceed host memory.
    pub fn scratch(&self) -> Option<PathBuf> {
        self.lock().host.scratch.clone()
    }

    /// Returns the downsampling that a reader has applied, if any, and clears it; the next call returns `None`.
    pub fn take_reduced(&self) -> Option<Reduced> {
        self.lock().reduced.take()
    }

    /// Reports that a stage of reading the volume begins.
    pub fn begin(&self, stage: ReadingStage) {
        let progress = &mut self.lock().progress;
        progress.stage = stage;
        progress.share = progress.share.max(stage.name_and_span().1[0]);
    }

    /// Begins a stage of reading a volume with `total` equal pieces of work. Returns their progress counter, which
    /// several threads may share.
    pub fn pieces(&self, stage: ReadingStage, total: usize) -> Pieces<'_> {
        self.begin(stage);
        Pieces { loading: self, total: total as u64, done: AtomicU64::new(0) }
    }

    /// Reports the finished fraction of the current stage of reading a volume.
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

/// Progress counter of one stage of reading a volume; it counts the finished pieces of work, all of equal size.
#[derive(Debug)]
pub struct Pieces<'a> {
    loading: &'a Loading,
    total: u64,
    done: AtomicU64,
}

impl Pieces<'_> {
    /// Counts one more finished piece of work in the current stage of reading a volume.
    pub fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.loading.note(done as f64 / self.total.max(1) as f64);
    }

    /// Returns whether the reading of the volume was cancelled, so that threads can stop their work.
    pub fn is_cancelled(&self) -> bool {
        self.loading.is_cancelled()
    }
}

/// Wrapper of an input stream that reports its position as reading progress, and fails after a cancellation.
#[derive(Debug)]
pub struct Watched<'a, R> {
    input: R,
    loading: &'a Loading,
    at: u64,
    end: u64,
}

impl<'a, R> Watched<'a, R> {
    /// Wraps an input stream that is read up to byte `end`, to report progress and allow cancellation.
    pub fn new(input: R, end: u64, loading: &'a Loading) -> Self {
        Self { input, loading, at: 0, end }
    }

    /// Returns the [`Loading`] to which this input stream reports its progress.
    pub fn loading(&self) -> &'a Loading {
        self.loading
    }

    /// Changes the byte position that counts as the end of the input stream in its progress report.
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
