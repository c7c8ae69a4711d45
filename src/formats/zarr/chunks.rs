//! Reader of the chunks of an array that a volume needs.

use super::metadata::{Array, Layout, Shards};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::element::grid_bytes;
use crate::volume::read::with_element;
use crate::volume::{Voxel, Voxels};
use ndarray::Array3;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Largest folder depth and number of files of a store that are counted.
const MAX_DEPTH: usize = 32;
const MAX_FILES: u64 = 8_000_000;

/// Largest ratio of a volume to the bytes of its files, beyond a small size. Missing chunks have the fill value.
const MAX_RATIO: u64 = 1 << 14;
const SMALL_BYTES: u64 = 64 << 20;
/// Largest ratio of missing chunks to files.
const MAX_ABSENT: u64 = 1 << 12;
/// Largest ratio of a chunk to the volume, beyond a small size. A chunk may hold other frames too.
const MAX_CHUNK_RATIO: u64 = 64;
const SMALL_CHUNK_BYTES: u64 = 16 << 20;
/// Numbers that are read at a time.
const PIECE: usize = 1 << 14;
/// Index entry of a missing chunk.
const ABSENT: u64 = u64::MAX;

/// Volume within an array: its spatial axes and its indices along the others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SubVolume<'a> {
    pub(super) array: &'a Array,
    /// Axes of x, y and z; a planar array has no z.
    pub(super) space: [Option<usize>; 3],
    /// Index along each other axis; 0 along the spatial ones.
    pub(super) fixed: Vec<usize>,
}

impl SubVolume<'_> {
    /// Voxels along x, y and z.
    pub(super) fn dims(&self) -> [usize; 3] {
        self.space.map(|axis| axis.map_or(1, |axis| self.array.shape[axis]))
    }

    /// Bytes of the voxels in memory; `None` on overflow.
    pub(super) fn memory_bytes(&self) -> Option<u64> {
        grid_bytes(self.dims(), self.array.element.memory_bytes())
    }

    /// Number of files along x, y and z.
    fn files(&self) -> [usize; 3] {
        let sizes = self.array.file_shape();
        self.space.map(|axis| axis.map_or(1, |axis| self.array.shape[axis].div_ceil(sizes[axis])))
    }

    /// Index of a file in the grid of all files.
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

    /// Lists the existing files, in grid order.
    ///
    /// # Errors
    /// The array claims far more than its files can hold.
    pub(super) fn present(&self) -> Result<Vec<PathBuf>, String> {
        self.check_claims()?;
        let [nx, ny, nz] = self.files();
        let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        let files = places.map(|at| self.array.file_of(&self.place(at)));
        Ok(files.filter(|file| file.is_file()).collect())
    }

    /// Refuses claims that the files of the array cannot hold, before memory or time is spent.
    fn check_claims(&self) -> Result<(), String> {
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
        let mut found = StoredFiles::default();
        found.count(&self.array.folder, MAX_DEPTH).map_err(|e| e.to_string())?;
        let files = self.files().iter().fold(1u64, |files, n| files.saturating_mul(*n as u64));
        let most = found.bytes.saturating_mul(MAX_RATIO).max(SMALL_BYTES);
        let most_files = found.files.saturating_add(1).saturating_mul(MAX_ABSENT);
        if bytes > most || files > most_files {
            let StoredFiles { files: found_files, bytes: found_bytes } = found;
            return Err(format!(
                "{bytes} bytes in {files} files are claimed, and there are {found_bytes} in {found_files}"
            ));
        }
        Ok(())
    }

    /// Reads the voxels.
    ///
    /// # Errors
    /// A chunk cannot be read, or the array claims far more than its files can hold.
    pub(super) fn read(&self, loading: &Loading) -> Result<Voxels, String> {
        self.check_claims()?;
        let Array { element, layout, fill, .. } = self.array;
        with_element!(*element, layout.byte_order, convert => self.gather(loading, *fill, convert))
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
            let slab = &mut Slab { out, from: z * depth, strides: [1, nx, nx * ny] };
            for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
                if pieces.is_cancelled() {
                    return Err("it was cancelled".to_string());
                }
                let place = self.place([x, y, z]);
                let path = self.array.file_of(&place);
                let named = |e: io::Error| {
                    let name = path.strip_prefix(&self.array.folder).unwrap_or(&path);
                    format!("chunk {}: {e}", name.display())
                };
                self.read_file(&path, &place, slab, &convert).map_err(named)?;
                pieces.done();
            }
            Ok(())
        })?;
        Array3::from_shape_vec((nz, ny, nx), all).map_err(|e| e.to_string())
    }

    /// Reads the file at an index of the grid of files, if it exists.
    fn read_file<T: Copy, const N: usize>(
        &self,
        path: &Path,
        place: &[usize],
        slab: &mut Slab<'_, T>,
        convert: &impl Fn([u8; N]) -> T,
    ) -> io::Result<()> {
        match std::fs::metadata(path) {
            Ok(about) if about.is_file() => {}
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            // Voxels without a file have the fill value.
            _ => return Ok(()),
        }
        let open = || File::open(path);
        let bytes = open()?.metadata()?.len();
        let origin: Vec<usize> =
            place.iter().zip(self.array.file_shape()).map(|(n, size)| n * size).collect();
        let layout = &self.array.layout;
        let Some(shards) = &self.array.shards else {
            return self.read_chunk(open()?, [0, bytes], &origin, slab, convert);
        };
        let index = index(&mut open()?, bytes, shards, layout)?;
        let grid: Vec<usize> =
            shards.shape.iter().zip(&layout.shape).map(|(shard, chunk)| shard / chunk).collect();
        for (number, span) in index.into_iter().enumerate() {
            let mut corner = origin.clone();
            let mut rest = number;
            for axis in (0..grid.len()).rev() {
                corner[axis] += rest % grid[axis] * layout.shape[axis];
                rest /= grid[axis];
            }
            if span == [ABSENT; 2] || !self.wants(&corner) {
                continue;
            }
            if span[0].checked_add(span[1]).is_none_or(|end| end > bytes) {
                return Err(bad("a chunk of it ends beyond the file"));
            }
            self.read_chunk(open()?, span, &corner, slab, convert)?;
        }
        Ok(())
    }

    /// Whether the chunk at `corner` holds voxels of the volume.
    fn wants(&self, corner: &[usize]) -> bool {
        let array = self.array;
        corner.iter().enumerate().all(|(axis, &from)| {
            let range = from..(from + array.layout.shape[axis]).min(array.shape[axis]);
            if self.space.contains(&Some(axis)) {
                !range.is_empty()
            } else {
                range.contains(&self.fixed[axis])
            }
        })
    }

    /// Reads the chunk at `origin` of the array from a span of a file.
    fn read_chunk<T: Copy, const N: usize>(
        &self,
        file: File,
        span: [u64; 2],
        origin: &[usize],
        slab: &mut Slab<'_, T>,
        convert: &impl Fn([u8; N]) -> T,
    ) -> io::Result<()> {
        let layout = &self.array.layout;
        let bytes = layout.shape.iter().fold(N as u64, |bytes, n| bytes * *n as u64);
        if layout.compression.uncompressed_bytes(bytes).is_some_and(|expected| expected != span[1]) {
            return Err(bad(format!("it has {} bytes, and its numbers {bytes}", span[1])));
        }
        let mut stream = layout.compression.decoder(file, span, bytes)?;
        // The numbers `within` each row of the file go to `to` and on, `stride` apart.
        let (&inner, outer) = layout.axes.split_last().ok_or_else(|| bad("it has no axes"))?;
        let length = layout.shape[inner];
        let within = self.along(inner, origin[inner], length);
        let stride = self.stride(inner, slab);
        let rows = outer.iter().fold(1, |rows, axis| rows * layout.shape[*axis]);
        let mut buffer = vec![0u8; N * length.min(PIECE)];
        let mut at = vec![0; outer.len()];
        for _ in 0..rows {
            let mut to = self.offset(inner, origin[inner] + within.start, slab);
            for (axis, n) in outer.iter().zip(&at) {
                let inside = self.along(*axis, origin[*axis], layout.shape[*axis]).contains(n);
                to = to
                    .filter(|_| inside)
                    .zip(self.offset(*axis, origin[*axis] + n, slab))
                    .map(|(a, b)| a + b);
            }
            for from in (0..length).step_by(PIECE) {
                let count = PIECE.min(length - from);
                let piece = &mut buffer[..N * count];
                stream.read_exact(piece).map_err(|e| match e.kind() {
                    io::ErrorKind::UnexpectedEof => bad(format!("it holds fewer than its {bytes} bytes")),
                    _ => e,
                })?;
                let Some(to) = to else { continue };
                let numbers = piece.as_chunks::<N>().0;
                let wanted = within.start.max(from)..within.end.min(from + count);
                for n in wanted {
                    slab.out[to + (n - within.start) * stride] = convert(numbers[n - from]);
                }
            }
            // Advance to the next row; the last outer axis runs fastest.
            for (n, axis) in at.iter_mut().zip(outer).rev() {
                *n += 1;
                if *n < layout.shape[*axis] {
                    break;
                }
                *n = 0;
            }
        }
        match stream.read(&mut [0])? {
            0 => Ok(()),
            _ => Err(bad(format!("it holds more than its {bytes} bytes"))),
        }
    }

    /// Range of numbers of the volume along an axis of a chunk at `origin`.
    fn along(&self, axis: usize, origin: usize, length: usize) -> Range<usize> {
        match self.space.contains(&Some(axis)) {
            true => 0..length.min(self.array.shape[axis].saturating_sub(origin)),
            false => match self.fixed[axis].checked_sub(origin) {
                Some(at) if at < length => at..at + 1,
                _ => 0..0,
            },
        }
    }

    fn stride<T>(&self, axis: usize, slab: &Slab<'_, T>) -> usize {
        self.space.iter().position(|of| *of == Some(axis)).map_or(0, |along| slab.strides[along])
    }

    /// Offset in a slab of an index along an axis; `None` outside the slab.
    fn offset<T>(&self, axis: usize, index: usize, slab: &Slab<'_, T>) -> Option<usize> {
        let along = self.space.iter().position(|of| *of == Some(axis));
        let index = if along == Some(2) { index.checked_sub(slab.from)? } else { index };
        Some(along.map_or(0, |along| index * slab.strides[along]))
    }
}

/// Consecutive slices of the volume.
struct Slab<'a, T> {
    out: &'a mut [T],
    from: usize,
    strides: [usize; 3],
}

fn bad(why: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why.to_string())
}

/// Reads the index of a shard: offset and bytes of each chunk.
fn index(file: &mut File, file_bytes: u64, shards: &Shards, layout: &Layout) -> io::Result<Vec<[u64; 2]>> {
    let parts = shards.shape.iter().zip(&layout.shape);
    let count = parts.fold(1, |n, (shard, chunk)| n * (shard / chunk));
    let (bytes, checksum_bytes) = (16 * count as u64, if shards.index_has_checksum { 4 } else { 0 });
    let from =
        file_bytes.checked_sub(bytes + checksum_bytes).ok_or_else(|| bad("it ends within its index"))?;
    file.seek(SeekFrom::Start(if shards.index_is_first { 0 } else { from }))?;
    let mut all = vec![0; (bytes + checksum_bytes) as usize];
    file.read_exact(&mut all)?;
    let (index, checksum) = all.split_at(bytes as usize);
    if shards.index_has_checksum && crc32c::crc32c(index).to_le_bytes() != *checksum {
        return Err(bad("its index is damaged: its checksum differs"));
    }
    let words = index.as_chunks::<8>().0.as_chunks::<2>().0;
    Ok(words.iter().map(|pair| pair.map(u64::from_le_bytes)).collect())
}

/// Number and size of the files below a folder.
#[derive(Debug, Default)]
struct StoredFiles {
    files: u64,
    bytes: u64,
}

impl StoredFiles {
    fn count(&mut self, folder: &Path, depth: usize) -> io::Result<()> {
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                if depth > 0 {
                    self.count(&entry.path(), depth - 1)?;
                }
            } else if self.files < MAX_FILES {
                self.files += 1;
                self.bytes += std::fs::metadata(entry.path()).map_or(0, |about| about.len());
            }
        }
        Ok(())
    }
}
