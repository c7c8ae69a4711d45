//! Sources of voxels that are read in parts, for volumes that exceed host memory.
//!
//! A pass over all voxels reads slabs of slices. Random access reads chunks of [`CHUNK_CELLS`] cells a side, which are kept
//! in a cache of limited size. A chunk holds all voxels of its cells, so that neighbouring chunks share voxels.

use super::element::{Element, grid_bytes};
use super::voxels::{Voxel, Voxels};
use crate::error::{Error, Result};
use crate::files::memory_budget::peak_bytes;
use crate::with_voxels;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use std::fmt;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Ranges of voxel indices along x, y and z.
pub type IndexBox = [Range<usize>; 3];

/// Voxels of a volume that can be read in parts: a file, the chunks of a store, or a formula.
pub trait VoxelSource: Send + Sync + fmt::Debug {
    /// Returns the number of voxels along x, y and z.
    fn dims(&self) -> [usize; 3];

    /// Returns the number type of the voxels in memory, one of those of [`Voxels`].
    fn element(&self) -> Element;

    /// Returns the number of slices of a chunk along z: reading whole layers of chunks costs least.
    fn slices_at_once(&self) -> usize {
        1
    }

    /// Reads the voxels of a box.
    ///
    /// # Errors
    /// The voxels cannot be read.
    fn read(&self, part: &IndexBox) -> Result<Voxels>;
}

/// Number of cells along each side of a chunk in the cache; a power of 2.
pub(crate) const CHUNK_CELLS: usize = 64;
/// Part of the limit on host memory for the cache of chunks, and for a slab of slices.
const CACHE_PART: u64 = 4;
const SLAB_PART: u64 = 16;
/// Largest number of bytes of a slab; larger ones do not make a pass faster.
const MOST_SLAB_BYTES: u64 = 1 << 30;
/// Number of chunks that stay in the cache, whatever the limit: rays would read the same chunks over and over.
const LEAST_CHUNKS: u64 = 64;
/// Weight of a chunk in the cache: its size in bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChunkBytes;

impl Weighter<[usize; 3], Arc<Voxels>> for ChunkBytes {
    fn weight(&self, _: &[usize; 3], chunk: &Arc<Voxels>) -> u64 {
        chunk.bytes().len() as u64
    }
}

/// Cache of the chunks of a volume that were read last, by their place along x, y and z.
pub(crate) type ChunkCache = Cache<[usize; 3], Arc<Voxels>, ChunkBytes>;

/// Creates a cache of at most `cache_bytes` bytes for chunks of about `chunk_bytes` bytes.
pub(crate) fn chunk_cache(cache_bytes: u64, chunk_bytes: u64) -> ChunkCache {
    /// Number of shards of the cache, which threads lock one at a time, and of chunks that each should hold.
    const MOST_SHARDS: usize = 8;
    const CHUNKS_IN_SHARD: usize = 8;
    let chunks = (cache_bytes / chunk_bytes.max(1)) as usize + 1;
    let options = OptionsBuilder::new()
        .estimated_items_capacity(chunks)
        .weight_capacity(cache_bytes)
        .shards((chunks / CHUNKS_IN_SHARD).clamp(1, MOST_SHARDS))
        .build();
    let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
    match options {
        Ok(options) => Cache::with_options(options, ChunkBytes, hasher, lifecycle),
        Err(_) => Cache::with_weighter(chunks, cache_bytes, ChunkBytes),
    }
}

/// Voxels that are read from a source in parts, with a cache of the chunks that were read last.
#[derive(Debug)]
pub struct OutOfCoreVoxels {
    source: Box<dyn VoxelSource>,
    chunks: ChunkCache,
    /// Stored value that replaces numbers that are not finite.
    replacement: OnceLock<f64>,
    host_bytes: u64,
    /// First error of a read, also for callers that cannot return one.
    failure: OnceLock<Error>,
    read_bytes: AtomicU64,
    read_ns: AtomicU64,
}

/// Reading of a volume in parts so far.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ReadUsage {
    /// Limit on host memory for voxels, bytes.
    pub host_bytes: u64,
    /// Voxels in the cache, bytes.
    pub cached_bytes: u64,
    /// Voxels that were read, bytes; those that were read twice count twice.
    pub read_bytes: u64,
    /// Time of the reads, summed over all threads, ms.
    pub read_ms: f64,
    /// Largest memory of the process so far, bytes; `None` where the system does not report it.
    pub peak_bytes: Option<u64>,
}

impl OutOfCoreVoxels {
    /// Prepares reading from a source with a limit on host memory in bytes.
    pub fn new(source: Box<dyn VoxelSource>, host_bytes: u64) -> Self {
        let chunk_bytes = (CHUNK_CELLS as u64 + 1).pow(3) * source.element().memory_bytes();
        let chunks = chunk_cache((host_bytes / CACHE_PART).max(LEAST_CHUNKS * chunk_bytes), chunk_bytes);
        let failure = OnceLock::new();
        let (read_bytes, read_ns) = (AtomicU64::new(0), AtomicU64::new(0));
        Self { source, chunks, replacement: OnceLock::new(), host_bytes, failure, read_bytes, read_ns }
    }

    /// Sets the stored value that replaces numbers that are not finite from now on.
    pub(super) fn replace_non_finite_by(&self, stored: f64) {
        let _ = self.replacement.set(stored);
    }

    /// Returns the number of voxels along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        self.source.dims()
    }

    /// Returns the number type of the voxels in memory.
    pub fn element(&self) -> Element {
        self.source.element()
    }

    /// Returns the limit on host memory for voxels, bytes.
    pub fn host_bytes(&self) -> u64 {
        self.host_bytes
    }

    /// Reads the voxels of a box.
    ///
    /// # Errors
    /// The voxels cannot be read.
    pub fn read(&self, part: &IndexBox) -> Result<Voxels> {
        let start = Instant::now();
        let mut voxels = self.source.read(part).inspect_err(|error| {
            if self.failure.set(error.clone()).is_ok() {
                tracing::error!("{error}");
            }
        })?;
        self.read_ns.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        self.read_bytes.fetch_add(voxels.bytes().len() as u64, Ordering::Relaxed);
        if let Some(stored) = self.replacement.get() {
            replace_non_finite(&mut voxels, *stored);
        }
        Ok(voxels)
    }

    /// Returns the largest number of slices of a slab, a multiple of `align`.
    pub(super) fn slab_slices(&self, align: usize) -> usize {
        let [nx, ny, _] = self.dims();
        let slice_bytes = grid_bytes([nx, ny, 1], self.element().memory_bytes()).unwrap_or(u64::MAX);
        let most = (self.host_bytes / SLAB_PART).min(MOST_SLAB_BYTES) / slice_bytes.max(1);
        let unit =
            |slices: usize| (most as usize / slices * slices > 0).then(|| most as usize / slices * slices);
        let together = self.source.slices_at_once().next_multiple_of(align);
        unit(together).or_else(|| unit(align)).unwrap_or(align)
    }

    /// Returns a chunk of the volume, from the cache or read. If it cannot be read, its values are 0, and
    /// [`Self::failure`] has the error.
    pub(crate) fn chunk(&self, chunk: [usize; 3]) -> Arc<Voxels> {
        let dims = self.dims();
        let part: IndexBox = std::array::from_fn(|axis| {
            let first = CHUNK_CELLS * chunk[axis];
            first..(first + CHUNK_CELLS + 1).min(dims[axis])
        });
        if let Some(voxels) = self.chunks.get(&chunk) {
            return voxels;
        }
        // Without a lock on the chunk: a source may read in parallel, and a thread that waits for others may be given a task
        // that needs the same chunk.
        let Ok(voxels) = self.read(&part).map(Arc::new) else { return Arc::new(self.zeros(&part)) };
        self.chunks.insert(chunk, Arc::clone(&voxels));
        voxels
    }

    /// Reads the voxels of a box. If they cannot be read, they are 0, and [`Self::failure`] has the error.
    pub(super) fn read_or_zeros(&self, part: &IndexBox) -> Voxels {
        self.read(part).unwrap_or_else(|_| self.zeros(part))
    }

    fn zeros(&self, part: &IndexBox) -> Voxels {
        Voxels::zeros(self.element(), part.each_ref().map(|range| range.len()))
    }

    /// Returns the first error of a read.
    pub fn failure(&self) -> Option<&Error> {
        self.failure.get()
    }

    /// Returns what was read so far.
    pub fn usage(&self) -> ReadUsage {
        ReadUsage {
            host_bytes: self.host_bytes,
            cached_bytes: self.chunks.weight(),
            read_bytes: self.read_bytes.load(Ordering::Relaxed),
            read_ms: self.read_ns.load(Ordering::Relaxed) as f64 * 1e-6,
            peak_bytes: peak_bytes(),
        }
    }

    /// Returns the value of one voxel, through the cache of chunks.
    pub(super) fn stored(&self, index: [usize; 3]) -> f64 {
        let chunk = index.map(|n| n / CHUNK_CELLS);
        let place = std::array::from_fn(|axis| index[axis] - CHUNK_CELLS * chunk[axis]);
        self.chunk(chunk).stored(place)
    }
}

/// Sets voxels that are NaN or infinite to the value `stored`; returns their number.
pub(super) fn replace_non_finite(voxels: &mut Voxels, stored: f64) -> usize {
    fn replace<'a, T: Voxel>(values: impl Iterator<Item = &'a mut T>, stored: f64) -> usize {
        let non_finite = values.filter(|v| !v.to_f64().is_finite());
        non_finite.map(|v| *v = T::from_f64(stored)).count()
    }
    if !matches!(voxels.element(), Element::F32 | Element::F64) {
        return 0;
    }
    with_voxels!(voxels, a => replace(a.iter_mut(), stored))
}

/// Part of the voxels of another source.
#[derive(Debug)]
pub(super) struct CroppedSource {
    pub parts: Arc<OutOfCoreVoxels>,
    pub part: IndexBox,
}

impl VoxelSource for CroppedSource {
    fn dims(&self) -> [usize; 3] {
        self.part.each_ref().map(|range| range.len())
    }

    fn element(&self) -> Element {
        self.parts.element()
    }

    fn slices_at_once(&self) -> usize {
        self.parts.source.slices_at_once()
    }

    fn read(&self, part: &IndexBox) -> Result<Voxels> {
        let shifted = std::array::from_fn(|axis| {
            let first = self.part[axis].start;
            first + part[axis].start..first + part[axis].end
        });
        self.parts.read(&shifted)
    }
}
