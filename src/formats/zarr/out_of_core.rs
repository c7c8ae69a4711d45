//! Voxels of a Zarr array that are read in parts, with a cache of the decoded chunks.

use super::chunks::SubVolume;
use super::metadata::Array;
use crate::error::{Error, Result};
use crate::volume::{ChunkCache, Element, IndexBox, Voxel, VoxelSource, Voxels, chunk_cache};
use crate::with_voxels;
use ndarray::{ArrayViewMut3, s};
use rayon::prelude::*;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// Part of the limit on host memory for the cache of decoded chunks.
const CACHE_PART: u64 = 2;

/// Number of decoded chunks that stay in the cache, whatever the limit.
const LEAST_CHUNKS: u64 = 8;

/// Voxels of one frame of a Zarr array.
#[derive(Debug)]
pub(super) struct ZarrVoxels {
    /// Path of the store, for errors.
    path: PathBuf,
    array: Array,
    /// Index of the axes x, y and z in the shape of the array, and the fixed index along the others.
    space: [Option<usize>; 3],
    fixed: Vec<usize>,
    chunks: ChunkCache,
}

impl ZarrVoxels {
    /// Prepares reading a frame with a limit on host memory in bytes.
    ///
    /// # Errors
    /// The array claims far more data than its files can hold.
    pub fn new(path: PathBuf, frame: &SubVolume<'_>, host_bytes: u64) -> Result<Self, String> {
        frame.check_claims()?;
        let chunk_voxels = frame.chunk_sides().iter().product::<usize>() as u64;
        let chunk_bytes = chunk_voxels * frame.array.element.memory_bytes();
        let cache_bytes = (host_bytes / CACHE_PART).max(LEAST_CHUNKS.saturating_mul(chunk_bytes));
        Ok(Self {
            path,
            array: frame.array.clone(),
            space: frame.space,
            fixed: frame.fixed.clone(),
            chunks: chunk_cache(cache_bytes, chunk_bytes),
        })
    }

    fn frame(&self) -> SubVolume<'_> {
        SubVolume { array: &self.array, space: self.space, fixed: self.fixed.clone() }
    }

    /// Returns a decoded chunk.
    fn chunk(&self, chunk: [usize; 3], sides: [usize; 3]) -> Result<Arc<Voxels>, String> {
        let frame = self.frame();
        let dims = frame.dims();
        let part: IndexBox = std::array::from_fn(|axis| {
            let first = chunk[axis] * sides[axis];
            first..(first + sides[axis]).min(dims[axis])
        });
        if let Some(voxels) = self.chunks.get(&chunk) {
            return Ok(voxels);
        }
        let voxels = Arc::new(frame.read_chunk_box(&part)?);
        self.chunks.insert(chunk, Arc::clone(&voxels));
        Ok(voxels)
    }
}

impl VoxelSource for ZarrVoxels {
    fn dims(&self) -> [usize; 3] {
        self.frame().dims()
    }

    fn element(&self) -> Element {
        self.array.element.in_memory()
    }

    fn slices_at_once(&self) -> usize {
        self.frame().chunk_sides()[2]
    }

    fn read(&self, part: &IndexBox) -> Result<Voxels> {
        let sides = self.frame().chunk_sides();
        let mut voxels = Voxels::zeros(self.element(), part.each_ref().map(|range| range.len()));
        let layers = |axis: usize| part[axis].start / sides[axis]..part[axis].end.div_ceil(sides[axis]);
        let (xs, ys) = (layers(0), layers(1));
        let copied = with_voxels!(&mut voxels, out => {
            let mut slabs = Vec::new();
            let mut rest = out.view_mut();
            for z in layers(2) {
                let slices = overlap(&part[2], z, sides[2]);
                let (slab, after) = rest.split_at(ndarray::Axis(0), slices.len());
                slabs.push((z, slab));
                rest = after;
            }
            slabs.into_par_iter().try_for_each(|(z, mut slab)| {
                // A row at a time: all chunks of a slab may exceed the cache.
                for y in ys.clone() {
                    let row = xs.clone().into_par_iter().map(|x| self.chunk([x, y, z], sides));
                    for (x, chunk) in xs.clone().zip(row.collect::<Result<Vec<_>, _>>()?) {
                        copy(&chunk, [x, y, z], sides, part, &mut slab);
                    }
                }
                Ok::<(), String>(())
            })
        });
        let refuse = |why: String| Error::input("cannot read volume", self.path.display(), why);
        copied.map(|()| voxels).map_err(refuse)
    }
}

/// Returns the indices of a range that lie in a chunk, along one axis.
fn overlap(range: &Range<usize>, chunk: usize, side: usize) -> Range<usize> {
    range.start.max(chunk * side)..range.end.min((chunk + 1) * side)
}

/// Copies the voxels of a chunk into a slab of the box `part`, whose slices are those of the chunk.
fn copy<T: Voxel>(
    chunk: &Voxels,
    place: [usize; 3],
    sides: [usize; 3],
    part: &IndexBox,
    slab: &mut ArrayViewMut3<'_, T>,
) {
    let [x, y, z] = std::array::from_fn(|axis| overlap(&part[axis], place[axis], sides[axis]));
    let [nx, ny, _] = chunk.dims();
    let values = T::slice_of(chunk).unwrap_or_default();
    let columns = x.start - part[0].start..x.end - part[0].start;
    for (k, mut slice) in z.zip(slab.outer_iter_mut()) {
        for j in y.clone() {
            let first = ((k - place[2] * sides[2]) * ny + j - place[1] * sides[1]) * nx + x.start
                - place[0] * sides[0];
            let mut row = slice.slice_mut(s![j - part[1].start, columns.clone()]);
            row.iter_mut().zip(&values[first..]).for_each(|(out, value)| *out = *value);
        }
    }
}
