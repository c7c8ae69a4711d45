//! Input stream of a volume file, compressed or not, and the block of voxels to read from it.

use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use crate::files::memory_budget;
use crate::volume::element::grid_bytes;
use crate::volume::read::{ReadFailure, read_transposed, read_voxels};
use crate::volume::{ByteOrder, Element, Voxels};
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

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
        let source = Self { stream, file_bytes: metadata.len().saturating_sub(start), trailing: 0, loading };
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
        let [nx, ny, nz] = self.dims;
        let claim = format!("{nx}x{ny}x{nz} {} from byte {} on", self.stored_type(), self.offset);
        let frame_bytes = self.bytes();
        let start = frame_bytes
            .and_then(|bytes| bytes.checked_mul(self.frame as u64))
            .and_then(|skipped| skipped.checked_add(self.offset));
        let end = start.zip(frame_bytes).and_then(|(start, bytes)| start.checked_add(bytes));
        let (Some(start), Some(end)) = (start, end) else {
            return Err(format!("its header claims {claim}: more bytes than can be counted"));
        };
        let short =
            |problem: String| format!("its header claims {claim}, {end} bytes in all, but it {problem}");
        if end > data.max_bytes() {
            let unit = if data.is_compressed() { " compressed bytes" } else { "" };
            return Err(short(format!("holds {}{unit}", data.file_bytes)));
        }
        let memory_bytes = self.element.memory_bytes();
        let factors = data.loading.factors_for(self.dims, memory_bytes)?;
        memory_budget::check_grid(
            factors.map_or(self.dims, |f| memory_budget::reduced_dims(self.dims, f)),
            memory_bytes,
        )?;
        // Progress counts the bytes up to the end of the voxels.
        if let Stream::Plain(file) = &mut data.stream {
            file.get_mut().ends_at(end);
        }
        if start < position || data.skip(start - position).map_err(|e| e.to_string())? < start - position {
            return Err(short(format!("ends before byte {start}")));
        }
        let voxels = voxels(data, factors).map_err(|failure| match failure {
            ReadFailure::Short { got } => short(format!("ends after {}", start + got)),
            other => other.to_string(),
        })?;
        if data.is_compressed() {
            let rest = io::copy(&mut data.take(1 << 16), &mut io::sink());
            data.trailing = rest.map_err(|e| format!("damaged after the voxels: {e}"))?;
        }
        Ok(voxels)
    }
}
