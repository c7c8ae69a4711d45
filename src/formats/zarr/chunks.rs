//! Reads the voxels of a volume from the chunks of a Zarr array.

use super::compression::{CHECKSUM_BYTES, bad, verified};
use super::metadata::{Array, Layout, Shards};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::element::grid_bytes;
use crate::volume::read::with_element;
use crate::volume::{IndexBox, Voxel, Voxels};
use ndarray::{Array3, ArrayViewMutD, Axis, Dimension, IxDyn, ShapeBuilder, Slice};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// Limits of the search for files in a Zarr store: largest folder depth and largest number of counted files.
const MAX_DEPTH: usize = 32;
const MAX_FILES: usize = 8_000_000;

/// Largest accepted ratio of the volume size to the size of the Zarr files, and a volume size that is always
/// accepted. Missing chunks have the fill value.
const MAX_RATIO: u64 = 1 << 14;
const SMALL_BYTES: u64 = 64 << 20;
/// Largest accepted ratio of the number of chunk files that a Zarr volume claims to the number of files that exist.
const MAX_ABSENT: u64 = 1 << 12;
/// Largest accepted ratio of the size of a Zarr chunk to the size of the volume, and a chunk size that is always
/// accepted. A chunk may hold other frames too.
const MAX_CHUNK_RATIO: u64 = 64;
const SMALL_CHUNK_BYTES: u64 = 16 << 20;
/// Number of array elements that are decoded at a time from a Zarr chunk.
const PIECE: usize = 1 << 14;
/// Value that marks a missing chunk in the index of a Zarr shard.
const ABSENT: u64 = u64::MAX;

/// 3-D volume within a Zarr array of more axes: its spatial axes, and fixed indices along the others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SubVolume<'a> {
    pub(super) array: &'a Array,
    /// Index of the axes x, y and z in the shape of the Zarr array; a planar array has no z.
    pub(super) space: [Option<usize>; 3],
    /// Fixed index along each non-spatial axis of the Zarr array; 0 along the spatial axes.
    pub(super) fixed: Vec<usize>,
}

impl SubVolume<'_> {
    /// Returns the number of voxels of the 3-D volume within a Zarr array, along x, y and z.
    pub(super) fn dims(&self) -> [usize; 3] {
        self.space.map(|axis| axis.map_or(1, |axis| self.array.shape[axis]))
    }

    /// Returns the size in host memory of the voxels of a volume within a Zarr array, bytes; `None` on overflow.
    pub(super) fn memory_bytes(&self) -> Option<u64> {
        grid_bytes(self.dims(), self.array.element.memory_bytes())
    }

    /// Returns the number of Zarr chunk files that the volume spans along x, y and z.
    fn files(&self) -> [usize; 3] {
        let sizes = self.array.file_shape();
        self.space.map(|axis| axis.map_or(1, |axis| self.array.shape[axis].div_ceil(sizes[axis])))
    }

    /// Converts the index of a chunk file along x, y and z to its index along all axes of the Zarr array.
    fn place(&self, at: [usize; 3]) -> Vec<usize> {
        let mut place: Vec<usize> =
            self.fixed.iter().zip(self.array.file_shape()).map(|(n, size)| n / size).collect();
        for (axis, n) in self.space.iter().zip(at) {
            if let Some(axis) = axis {
                place[*axis] = n;
            }
        }
        place
    }

    /// Lists the chunk files that exist in a Zarr store for one volume, x fastest.
    ///
    /// # Errors
    /// The Zarr array claims far more data than its files can hold.
    pub(super) fn present(&self) -> Result<Vec<PathBuf>, String> {
        self.check_claims()?;
        let [nx, ny, nz] = self.files();
        let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        let files = places.map(|at| self.array.file_of(&self.place(at)));
        Ok(files.filter(|file| file.is_file()).collect())
    }

    /// Returns an error if a Zarr array claims more data than its files can hold. The check comes before any memory
    /// is allocated.
    pub(super) fn check_claims(&self) -> Result<(), String> {
        let Array { element, layout, .. } = self.array;
        let product = |sizes: &[usize]| {
            sizes.iter().try_fold(element.bytes() as u64, |bytes, n| bytes.checked_mul(*n as u64))
        };
        let bytes = self.memory_bytes().ok_or("more voxels than can be counted are claimed")?;
        let chunk = product(&layout.shape).zip(product(self.array.file_shape())).map(|(chunk, _)| chunk);
        let most_chunk = bytes.saturating_mul(MAX_CHUNK_RATIO).max(SMALL_CHUNK_BYTES);
        if chunk.is_none_or(|chunk| chunk > most_chunk) {
            return Err("its chunks are far larger than the volume".into());
        }
        let stored = WalkDir::new(&self.array.folder).max_depth(MAX_DEPTH).into_iter().flatten();
        let stored = stored.filter(|entry| entry.file_type().is_file()).take(MAX_FILES);
        let (found_files, found_bytes) = stored.fold((0u64, 0u64), |(files, bytes), entry| {
            (files + 1, bytes + entry.metadata().map_or(0, |about| about.len()))
        });
        let files = self.files().iter().fold(1u64, |files, n| files.saturating_mul(*n as u64));
        let most = found_bytes.saturating_mul(MAX_RATIO).max(SMALL_BYTES);
        if bytes > most || files > (found_files + 1).saturating_mul(MAX_ABSENT) {
            return Err(format!(
                "{bytes} bytes in {files} files are claimed, and there are {found_bytes} in {found_files}"
            ));
        }
        Ok(())
    }

    /// Reads the voxels of the volume from the chunks of a Zarr array.
    ///
    /// # Errors
    /// A chunk cannot be read, or the Zarr array claims far more data than its files can hold.
    pub(super) fn read(&self, loading: &Loading) -> Result<Voxels, String> {
        self.check_claims()?;
        let Array { element, layout, fill, .. } = self.array;
        with_element!(*element, layout.byte_order, convert => self.gather(loading, *fill, convert))
    }

    /// Returns the number of voxels of a chunk along x, y and z.
    pub(super) fn chunk_sides(&self) -> [usize; 3] {
        self.space.map(|axis| axis.map_or(1, |axis| self.array.layout.shape[axis]))
    }

    /// Reads a box of voxels that lies in one chunk.
    ///
    /// # Errors
    /// The chunk cannot be read.
    pub(super) fn read_chunk_box(&self, part: &IndexBox) -> Result<Voxels, String> {
        let Array { element, layout, .. } = self.array;
        with_element!(*element, layout.byte_order, convert => self.gather_box(part, convert))
    }

    fn gather_box<T: Voxel, const N: usize>(
        &self,
        part: &IndexBox,
        convert: impl Fn([u8; N]) -> T,
    ) -> Result<Array3<T>, String> {
        let sides = part.each_ref().map(|range| range.len());
        let mut values = vec![T::from_f64(self.array.fill); sides.iter().product()];
        let first = part.each_ref().map(|range| range.start);
        let slab = &mut self.slab(&mut values, first, sides)?;
        let file_sides = self.array.file_shape();
        let place = self.place(std::array::from_fn(|along| {
            self.space[along].map_or(0, |axis| first[along] / file_sides[axis])
        }));
        self.read_named(&place, slab, &convert)?;
        let [nx, ny, nz] = sides;
        Array3::from_shape_vec((nz, ny, nx), values).map_err(|e| e.to_string())
    }

    /// Reads a chunk or shard file into a slab; an error names the file.
    fn read_named<T: Copy, const N: usize>(
        &self,
        place: &[usize],
        slab: &mut Slab<'_, T>,
        convert: &impl Fn([u8; N]) -> T,
    ) -> Result<(), String> {
        let path = self.array.file_of(place);
        let named = |e: io::Error| {
            let name = path.strip_prefix(&self.array.folder).unwrap_or(&path);
            format!("chunk {}: {e}", name.display())
        };
        self.read_file(&path, place, slab, convert).map_err(named)
    }

    fn gather<T: Voxel, const N: usize>(
        &self,
        loading: &Loading,
        fill: f64,
        convert: impl Fn([u8; N]) -> T + Sync,
    ) -> Result<Array3<T>, String> {
        let [nx, ny, nz] = self.dims();
        let mut all: Vec<T> = Vec::new();
        all.try_reserve_exact(nx * ny * nz).map_err(|_| "not enough memory for the voxels")?;
        all.resize(nx * ny * nz, T::from_f64(fill));
        let depth = self.space[2].map_or(1, |axis| self.array.file_shape()[axis]).min(nz);
        let [across, down, files_deep] = self.files();
        let pieces = loading.pieces(ReadingStage::Unpacking, across * down * files_deep);
        all.par_chunks_mut(nx * ny * depth).enumerate().try_for_each(|(z, out)| {
            let slices = out.len() / (nx * ny);
            let slab = &mut self.slab(out, [0, 0, z * depth], [nx, ny, slices])?;
            for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
                if pieces.is_cancelled() {
                    return Err("it was cancelled".to_string());
                }
                self.read_named(&self.place([x, y, z]), slab, &convert)?;
                pieces.done();
            }
            Ok(())
        })?;
        Array3::from_shape_vec((nz, ny, nx), all).map_err(|e| e.to_string())
    }

    /// Creates a slab of `sizes` voxels from the voxel `first` on, as a view with the axes of the Zarr array.
    fn slab<'o, T>(
        &self,
        out: &'o mut [T],
        first: [usize; 3],
        sizes: [usize; 3],
    ) -> Result<Slab<'o, T>, String> {
        let strides = [1, sizes[0], sizes[0] * sizes[1]];
        let axes = self.fixed.len();
        let (mut from, mut shape, mut steps) = (self.fixed.clone(), vec![1; axes], vec![0; axes]);
        for (along, axis) in self.space.iter().enumerate() {
            if let Some(axis) = *axis {
                (from[axis], shape[axis], steps[axis]) = (first[along], sizes[along], strides[along]);
            }
        }
        let voxels = ArrayViewMutD::from_shape(IxDyn(&shape).strides(IxDyn(&steps)), out);
        Ok(Slab { voxels: voxels.map_err(|e| e.to_string())?, from })
    }

    /// Reads one Zarr chunk or shard file into a slab of the volume, if the file exists.
    fn read_file<T: Copy, const N: usize>(
        &self,
        path: &Path,
        place: &[usize],
        slab: &mut Slab<'_, T>,
        convert: &impl Fn([u8; N]) -> T,
    ) -> io::Result<()> {
        let bytes = match std::fs::metadata(path) {
            Ok(about) if about.is_file() => about.len(),
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            // Voxels without a file have the fill value.
            _ => return Ok(()),
        };
        let origin: Vec<usize> =
            place.iter().zip(self.array.file_shape()).map(|(n, size)| n * size).collect();
        let layout = &self.array.layout;
        let Some(shards) = &self.array.shards else {
            return self.read_chunk(path, [0, bytes], &origin, slab, convert);
        };
        let index = index(&mut File::open(path)?, bytes, shards, layout)?;
        let grid: Vec<usize> =
            shards.shape.iter().zip(&layout.shape).map(|(shard, chunk)| shard / chunk).collect();
        // Chunks of the shard that have elements in the slab, along each axis.
        let within = |axis: usize| {
            let (side, first) = (layout.shape[axis], slab.from[axis].saturating_sub(origin[axis]));
            let end = (slab.from[axis] + slab.voxels.shape()[axis]).saturating_sub(origin[axis]);
            first / side..end.div_ceil(side).min(grid[axis])
        };
        let ranges: Vec<Range<usize>> = (0..grid.len()).map(within).collect();
        let counts: Vec<usize> = ranges.iter().map(|range| range.len()).collect();
        for offset in ndarray::indices(IxDyn(&counts)) {
            let at: Vec<usize> =
                offset.slice().iter().zip(&ranges).map(|(n, range)| range.start + n).collect();
            let place = at.iter().zip(&grid).fold(0, |place, (n, count)| place * count + n);
            let Some(&span) = index.get(place).filter(|span| **span != [ABSENT; 2]) else { continue };
            if span[0].checked_add(span[1]).is_none_or(|end| end > bytes) {
                return Err(bad("a chunk of it ends beyond the file"));
            }
            let steps = at.iter().zip(&layout.shape);
            let corner: Vec<usize> =
                origin.iter().zip(steps).map(|(from, (n, size))| from + n * size).collect();
            self.read_chunk(path, span, &corner, slab, convert)?;
        }
        Ok(())
    }

    /// Reads a Zarr chunk from a byte range of a file into a slab. Skips a chunk that has no
    /// voxels in the slab.
    fn read_chunk<T: Copy, const N: usize>(
        &self,
        path: &Path,
        span: [u64; 2],
        origin: &[usize],
        slab: &mut Slab<'_, T>,
        convert: &impl Fn([u8; N]) -> T,
    ) -> io::Result<()> {
        let layout = &self.array.layout;
        // Indices within the chunk that belong to the slab, for each axis.
        let within: Vec<Range<usize>> = (0..origin.len())
            .map(|axis| {
                let (first, end) = (slab.from[axis], slab.from[axis] + slab.voxels.shape()[axis]);
                let range = first.max(origin[axis])..end.min(origin[axis] + layout.shape[axis]);
                range.start - origin[axis]..range.end.saturating_sub(origin[axis])
            })
            .collect();
        if within.iter().any(Range::is_empty) {
            return Ok(());
        }
        let bytes = layout.shape.iter().fold(N as u64, |bytes, n| bytes * *n as u64);
        if layout.compression.uncompressed_bytes(bytes).is_some_and(|expected| expected != span[1]) {
            return Err(bad(format!("it has {} bytes, and its numbers {bytes}", span[1])));
        }
        let mut stream = layout.compression.decoder(File::open(path)?, span, bytes)?;
        let part = slab.voxels.slice_each_axis_mut(|place| {
            let axis = place.axis.index();
            let first = origin[axis] + within[axis].start - slab.from[axis];
            Slice::from(first..first + within[axis].len())
        });
        // Rows of the file run along its last axis; those of the slab follow in the same order.
        let (&inner, outer) = layout.axes.split_last().ok_or_else(|| bad("it has no axes"))?;
        let mut part = part.permuted_axes(IxDyn(&layout.axes));
        let mut rows = part.lanes_mut(Axis(outer.len())).into_iter();
        let (length, wanted) = (layout.shape[inner], &within[inner]);
        let outer_shape: Vec<usize> = outer.iter().map(|axis| layout.shape[*axis]).collect();
        let mut buffer = vec![0u8; N * length.min(PIECE)];
        for at in ndarray::indices(IxDyn(&outer_shape)) {
            let is_inside = outer.iter().zip(at.slice()).all(|(axis, n)| within[*axis].contains(n));
            let mut row = if is_inside { rows.next() } else { None };
            for from in (0..length).step_by(PIECE) {
                let count = PIECE.min(length - from);
                let piece = &mut buffer[..N * count];
                stream.read_exact(piece).map_err(|e| match e.kind() {
                    io::ErrorKind::UnexpectedEof => bad(format!("it holds fewer than its {bytes} bytes")),
                    _ => e,
                })?;
                let Some(row) = &mut row else { continue };
                let numbers = piece.as_chunks::<N>().0;
                for n in wanted.start.max(from)..wanted.end.min(from + count) {
                    row[n - wanted.start] = convert(numbers[n - from]);
                }
            }
        }
        match stream.read(&mut [0])? {
            0 => Ok(()),
            _ => Err(bad(format!("it holds more than its {bytes} bytes"))),
        }
    }
}

/// Slab of voxels of the volume, as a view with the axes of the Zarr array.
struct Slab<'a, T> {
    voxels: ArrayViewMutD<'a, T>,
    /// Index of the first element of the slab along each axis of the Zarr array.
    from: Vec<usize>,
}

/// Reads the index of a Zarr shard: offset and size in bytes of each of its chunks.
fn index(file: &mut File, file_bytes: u64, shards: &Shards, layout: &Layout) -> io::Result<Vec<[u64; 2]>> {
    let parts = shards.shape.iter().zip(&layout.shape);
    let count = parts.fold(1, |n, (shard, chunk)| n * (shard / chunk));
    let bytes = 16 * count as u64 + if shards.index_has_checksum { CHECKSUM_BYTES } else { 0 };
    let from = file_bytes.checked_sub(bytes).ok_or_else(|| bad("it ends within its index"))?;
    file.seek(SeekFrom::Start(if shards.index_is_first { 0 } else { from }))?;
    let mut index = file.take(bytes);
    let mut all = Vec::new();
    match shards.index_has_checksum {
        true => all = verified(index)?,
        false => _ = index.read_to_end(&mut all)?,
    }
    let words = all.as_chunks::<8>().0.as_chunks::<2>().0;
    Ok(words.iter().map(|pair| pair.map(u64::from_le_bytes)).collect())
}
