//! Input stream of a volume file, compressed or not, and the block of voxels to read from it.

use super::file_voxels::FileVoxels;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use crate::files::memory_budget;
use crate::files::output::TemporaryFile;
use crate::volume::element::grid_bytes;
use crate::volume::read::{ReadFailure, read_transposed, read_voxels};
use crate::volume::{ByteOrder, Element, VoxelStorage, Voxels};
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Largest possible ratio of decompressed to compressed bytes of the deflate method.
const DEFLATE_MAX_RATIO: u64 = 1032;

/// Compression of the input stream of a volume file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    /// Gzip compression if the stream of the volume file starts with the gzip magic bytes, otherwise none.
    Detected,
    None,
    /// Gzip compression if the stream of the volume file starts with the gzip magic bytes, otherwise zlib.
    Deflate,
}

enum Stream<'a> {
    Plain(BufReader<Watched<'a, File>>),
    Compressed(Box<dyn Read + 'a>),
}

/// Input stream of a volume file from a start offset on, decompressed while it is read.
pub(super) struct Source<'a> {
    stream: Stream<'a>,
    /// Number of bytes of the volume file from the start of the input stream to the end of the file.
    file_bytes: u64,
    /// Number of bytes found after the voxels of a compressed volume file.
    pub(super) trailing: u64,
    loading: &'a Loading,
    path: PathBuf,
    /// Byte of the file at which the input stream starts.
    start: u64,
}

impl<'a> Source<'a> {
    /// Opens a volume file from its first byte on, gzipped or not.
    pub(super) fn open(path: &Path, loading: &'a Loading) -> Result<Self> {
        Self::open_at(path, 0, Compression::Detected, loading)
    }

    /// Opens a volume file from byte `start` on.
    pub(super) fn open_at(
        path: &Path,
        start: u64,
        compression: Compression,
        loading: &'a Loading,
    ) -> Result<Self> {
        let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
        let io_error = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => refuse("no such file".into()),
            _ => refuse(e.to_string()),
        };
        // Checked before opening: opening a pipe waits for a writer.
        let metadata = std::fs::metadata(path).map_err(io_error)?;
        if metadata.is_dir() {
            return Err(refuse("it is a folder".into()));
        }
        if !metadata.is_file() {
            return Err(refuse("it is no plain file".into()));
        }
        let file = Watched::new(File::open(path).map_err(io_error)?, metadata.len(), loading);
        let mut file = BufReader::with_capacity(1 << 16, file);
        if start > 0 {
            file.seek(SeekFrom::Start(start)).map_err(io_error)?;
        }
        let is_gzip = file.fill_buf().map_err(io_error)?.starts_with(&[0x1f, 0x8b]);
        let stream = match (compression, is_gzip) {
            (Compression::None, _) | (Compression::Detected, false) => Stream::Plain(file),
            (_, true) => Stream::Compressed(Box::new(MultiGzDecoder::new(file))),
            (Compression::Deflate, false) => Stream::Compressed(Box::new(ZlibDecoder::new(file))),
        };
        let file_bytes = metadata.len().saturating_sub(start);
        let source = Self { stream, file_bytes, trailing: 0, loading, path: path.into(), start };
        loading.begin(if source.is_compressed() { ReadingStage::Unpacking } else { ReadingStage::Reading });
        Ok(source)
    }

    pub(super) fn is_compressed(&self) -> bool {
        matches!(self.stream, Stream::Compressed(_))
    }

    /// Returns an upper bound of the number of decompressed bytes in the input stream of a volume file.
    pub(super) fn max_bytes(&self) -> u64 {
        self.file_bytes.saturating_mul(if self.is_compressed() { DEFLATE_MAX_RATIO } else { 1 })
    }

    /// Reads on to the end of a compressed stream, which verifies its checksum. Counts the bytes that follow the voxels.
    fn read_to_end(&mut self) -> Result<(), String> {
        if self.is_compressed() {
            let rest = io::copy(&mut self.take(1 << 16), &mut io::sink());
            self.trailing = rest.map_err(|e| format!("damaged after the voxels: {e}"))?;
        }
        Ok(())
    }

    /// Skips `count` bytes of the input stream of a volume file; returns the number of skipped bytes.
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        if let Stream::Plain(file) = &mut self.stream {
            // The caller has compared `count` with the file's size, which fits in i64.
            file.seek_relative(count.min(i64::MAX as u64) as i64)?;
            return Ok(count);
        }
        match io::copy(&mut self.take(count), &mut io::sink()) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
            other => other,
        }
    }
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.stream {
            Stream::Plain(file) => file.read(buffer),
            Stream::Compressed(stream) => stream.read(buffer),
        }
    }
}

/// Block of voxels in the input stream of a volume file, described by the header of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    /// Number of voxels of the block along x, y and z; x runs fastest.
    pub(super) dims: [usize; 3],
    pub(super) element: Element,
    pub(super) byte_order: ByteOrder,
    /// Byte offset of the first frame of the volume in the decompressed stream.
    pub(super) offset: u64,
    /// Index of the frame of the volume to read, from 0.
    pub(super) frame: usize,
}

impl Block {
    /// Describes the stored voxel type and byte order for the user.
    pub(super) fn stored_type(&self) -> String {
        self.element.describe(self.byte_order)
    }

    /// Returns the size of one frame of the volume in the file, bytes; `None` on overflow.
    pub(super) fn bytes(&self) -> Option<u64> {
        grid_bytes(self.dims, self.element.bytes() as u64)
    }

    /// Reads a block of voxels from the input stream of a volume file, which is at byte `position`. Reads on to the
    /// end of a compressed stream to verify its checksum.
    ///
    /// # Errors
    /// The stream cannot be read, or holds fewer bytes than the header claims.
    pub(super) fn read(&self, data: &mut Source<'_>, position: u64) -> Result<Voxels, String> {
        self.read_by(data, position, |data, factors| {
            read_voxels(data, self.dims, self.element, self.byte_order, factors)
        })
    }

    /// Prepares a block of voxels from the input stream of a volume file, which is at byte `position`. It reads them like
    /// [`Self::read`] if they fit host memory. Otherwise they stay in the file, which is read in parts; a compressed file
    /// is first decompressed into the scratch folder.
    ///
    /// # Errors
    /// See [`Self::read`]; or a compressed file exceeds host memory, and there is no scratch folder.
    pub(super) fn open(&self, data: &mut Source<'_>, position: u64) -> Result<VoxelStorage, String> {
        let loading = data.loading;
        let limit = loading.out_of_core_limit(self.dims, self.element.memory_bytes());
        let Some(host_bytes) = limit.filter(|_| !loading.is_reducing()) else {
            return self.read(data, position).map(VoxelStorage::from);
        };
        let [start, end] = self.span(data)?;
        let in_file = FileVoxels {
            path: data.path.clone(),
            offset: data.start + start,
            dims: self.dims,
            element: self.element,
            byte_order: self.byte_order,
            copy: None,
        };
        if !data.is_compressed() {
            return Ok(VoxelStorage::out_of_core(in_file, host_bytes));
        }
        let Some(folder) = loading.scratch() else {
            let why = format!("it is compressed, and its voxels exceed {host_bytes} bytes of host memory");
            return Err(format!("{why}: --scratch names a folder for {} bytes", end - start));
        };
        self.skip_to(data, start, position, end)?;
        let (mut file, copy) =
            TemporaryFile::create_in(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let copied = io::copy(&mut data.take(end - start), &mut file).map_err(|e| e.to_string())?;
        if copied < end - start {
            return Err(self.short(end, format!("ends after {}", start + copied)));
        }
        data.read_to_end()?;
        let (path, copy) = (copy.path().to_path_buf(), Some(copy));
        Ok(VoxelStorage::out_of_core(FileVoxels { path, offset: 0, copy, ..in_file }, host_bytes))
    }

    /// Reads a block of voxels from a volume file that stores them with z fastest. Does not downsample them; the
    /// caller does.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub(super) fn read_transposed(&self, data: &mut Source<'_>, position: u64) -> Result<Voxels, String> {
        self.read_by(data, position, |data, _| {
            read_transposed(data, self.dims, self.element, self.byte_order)
        })
    }

    fn read_by<'a>(
        &self,
        data: &mut Source<'a>,
        position: u64,
        voxels: impl FnOnce(&mut Source<'a>, Option<[usize; 3]>) -> Result<Voxels, ReadFailure>,
    ) -> Result<Voxels, String> {
        let [start, end] = self.span(data)?;
        let memory_bytes = self.element.memory_bytes();
        let factors = data.loading.factors_for(self.dims, memory_bytes)?;
        memory_budget::check_grid(
            factors.map_or(self.dims, |f| memory_budget::reduced_dims(self.dims, f)),
            memory_bytes,
        )?;
        self.skip_to(data, start, position, end)?;
        let voxels = voxels(data, factors).map_err(|failure| match failure {
            ReadFailure::Short { got } => self.short(end, format!("ends after {}", start + got)),
            other => other.to_string(),
        })?;
        data.read_to_end()?;
        Ok(voxels)
    }

    /// Returns the first byte of the block in the decompressed stream, and its end.
    ///
    /// # Errors
    /// The stream cannot hold as many bytes.
    fn span(&self, data: &Source<'_>) -> Result<[u64; 2], String> {
        let frame_bytes = self.bytes();
        let start = frame_bytes
            .and_then(|bytes| bytes.checked_mul(self.frame as u64))
            .and_then(|skipped| skipped.checked_add(self.offset));
        let end = start.zip(frame_bytes).and_then(|(start, bytes)| start.checked_add(bytes));
        let (Some(start), Some(end)) = (start, end) else {
            return Err(format!("its header claims {}: more bytes than can be counted", self.claim()));
        };
        if end > data.max_bytes() {
            let unit = if data.is_compressed() { " compressed bytes" } else { "" };
            return Err(self.short(end, format!("holds {}{unit}", data.file_bytes)));
        }
        Ok([start, end])
    }

    fn claim(&self) -> String {
        let [nx, ny, nz] = self.dims;
        format!("{nx}x{ny}x{nz} {} from byte {} on", self.stored_type(), self.offset)
    }

    fn short(&self, end: u64, problem: String) -> String {
        format!("its header claims {}, {end} bytes in all, but it {problem}", self.claim())
    }

    /// Skips the stream, which is at byte `position`, to the start of the block.
    fn skip_to(&self, data: &mut Source<'_>, start: u64, position: u64, end: u64) -> Result<(), String> {
        // Progress counts the bytes up to the end of the voxels.
        if let Stream::Plain(file) = &mut data.stream {
            file.get_mut().ends_at(end);
        }
        if start < position || data.skip(start - position).map_err(|e| e.to_string())? < start - position {
            return Err(self.short(end, format!("ends before byte {start}")));
        }
        Ok(())
    }
}
