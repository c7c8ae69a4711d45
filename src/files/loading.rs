//! How far the reading of a volume is, and how it is ended early.
//!
//! Whoever waits holds a [`Loading`] that the readers share: they say what they do and how much of it is done, and look
//! now and then whether to go on. One that was cancelled returns an error soon and keeps nothing.

use super::room::Room;
use crate::error::{Error, Result};
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is being done, in the order in which it happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReadingStage {
    /// Strands are read from their file, or grown.
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
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::ReadingStrands => "reading strands",
            Self::Reading => "reading",
            Self::Unpacking => "unpacking",
            Self::Building => "building",
            Self::Voxelising => "voxelising",
            Self::Checking => "checking values",
            Self::Counting => "counting values",
        }
    }

    /// What share of the whole is done when it begins and when it ends.
    fn span(self) -> [f64; 2] {
        match self {
            Self::ReadingStrands => [0.0, 0.25],
            Self::Reading | Self::Unpacking | Self::Building => [0.0, 0.85],
            Self::Voxelising => [0.25, 0.85],
            Self::Checking => [0.85, 0.9],
            Self::Counting => [0.9, 1.0],
        }
    }
}

/// How far a reading is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadingProgress {
    /// What is being done.
    pub stage: ReadingStage,
    /// Of the whole, 0 to 1; it never falls. [`crate::volume::Histogram::of_with`] is the last part.
    pub share: f64,
}

/// A reading that can be watched and ended from another thread.
#[derive(Debug, Default)]
pub struct Loading {
    progress: Mutex<ReadingProgress>,
    cancelled: AtomicBool,
    reducing: Mutex<Reducing>,
}

/// What a reader has done to its voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reduced {
    /// Voxels along each axis that there were.
    pub from: [usize; 3],
    /// Voxels of a block along each axis that became one.
    pub factors: [usize; 3],
}

/// How voxels are reduced while they are read.
#[derive(Debug, Default)]
struct Reducing {
    room: Option<Room>,
    done: Option<Reduced>,
}

impl Loading {
    /// How far it is.
    pub fn progress(&self) -> ReadingProgress {
        *self.lock()
    }

    /// Ends the reading soon; it then returns an error.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether it is to end.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Whether to go on; `source` is what was being read.
    ///
    /// # Errors
    /// It was cancelled.
    pub fn go_on(&self, source: &str) -> Result<()> {
        match self.is_cancelled() {
            true => Err(Error::runtime("cannot read volume", source, "it was cancelled")),
            false => Ok(()),
        }
    }

    /// Says what voxels are to fit into, for readers that can reduce them as they come; `None` has them read as they are.
    pub fn reduce_to(&self, room: Option<Room>) {
        *self.reducing.lock().unwrap_or_else(PoisonError::into_inner) = Reducing { room, done: None };
    }

    /// By which factors a grid is to be reduced while it is read, of voxels of so many bytes each: a reader that asks has to
    /// do it. `None`: it is to be read as it is.
    ///
    /// # Errors
    /// No factors make it fit; in words.
    pub fn factors_for(&self, dims: [usize; 3], voxel_bytes: u64) -> Result<Option<[usize; 3]>, String> {
        let mut reducing = self.reducing.lock().unwrap_or_else(PoisonError::into_inner);
        let factors = reducing.room.map(|room| room.factors(dims, voxel_bytes)).transpose()?;
        reducing.done = factors.map(|factors| Reduced { from: dims, factors });
        Ok(factors)
    }

    /// What a reader has reduced its voxels by, where one was asked to and asked how; said once.
    pub fn take_reduced(&self) -> Option<Reduced> {
        self.reducing.lock().unwrap_or_else(PoisonError::into_inner).done.take()
    }

    /// Says what is done from now on.
    pub fn begin(&self, stage: ReadingStage) {
        let mut now = self.lock();
        now.stage = stage;
        now.share = now.share.max(stage.span()[0]);
    }

    /// Begins a stage of `total` equal pieces, which several threads may do.
    pub fn pieces(&self, stage: ReadingStage, total: usize) -> Pieces<'_> {
        self.begin(stage);
        Pieces { loading: self, total: total as u64, done: AtomicU64::new(0) }
    }

    /// Says what share of the present stage is done.
    fn note(&self, share: f64) {
        let mut now = self.lock();
        let [from, to] = now.stage.span();
        now.share = now.share.max(from + (to - from) * share.clamp(0.0, 1.0));
    }

    fn lock(&self) -> MutexGuard<'_, ReadingProgress> {
        // Plain data, as good after a panic elsewhere as before.
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
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
    /// One piece more is done.
    pub fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.loading.note(done as f64 / self.total.max(1) as f64);
    }

    /// Whether the rest is not wanted any more.
    pub fn is_cancelled(&self) -> bool {
        self.loading.is_cancelled()
    }
}

/// A file that says how much of it has been read; reading fails once that was cancelled.
#[derive(Debug)]
pub struct Watched<'a, R> {
    input: R,
    loading: &'a Loading,
    at: u64,
    end: u64,
}

impl<'a, R> Watched<'a, R> {
    /// Of an input that is wanted up to byte `end`.
    pub fn new(input: R, end: u64, loading: &'a Loading) -> Self {
        Self { input, loading, at: 0, end }
    }

    /// Who watches.
    pub fn loading(&self) -> &'a Loading {
        self.loading
    }

    /// It is wanted only up to this byte.
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
