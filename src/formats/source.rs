//! A file of voxels, plain or packed, and the block of voxels in it: what every reader of one stream shares.

use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use crate::files::memory_budget;
use crate::volume::Voxels;
use crate::volume::element::{ByteOrder, Element, ReadFailure, data_bytes, read_reduced, read_turned_voxels};
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Deflate cannot pack more than this many bytes into one.
const DEFLATE_MAX_RATIO: u64 = 1032;

type Input<'a> = BufReader<Watched<'a, File>>;

/// A file to read from, from one of its bytes on; gzip and zlib streams are told from their content, not from a name.
pub(super) enum Source<'a> {
    Plain { file: Input<'a>, bytes: u64 },
    Gzip { stream: Box<MultiGzDecoder<Input<'a>>>, packed_bytes: u64 },
    Zlib { stream: Box<ZlibDecoder<Input<'a>>>, packed_bytes: u64 },
}

/// How what follows is packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Packing {
    /// As it stands, or gzipped where it begins so.
    Sniffed,
    /// As it stands, whatever it begins with.
    Plain,
    /// A gzip or zlib stream: which one is told from its first bytes.
    Deflate,
}

impl<'a> Source<'a> {
    /// The whole file, gzipped or not.
    pub(super) fn open(path: &Path, loading: &'a Loading) -> Result<Self> {
        Self::open_at(path, 0, Packing::Sniffed, loading)
    }

    /// From byte `start` on.
    pub(super) fn open_at(path: &Path, start: u64, packing: Packing, loading: &'a Loading) -> Result<Self> {
        let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
        let io_error = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => refuse("no such file".into()),
            _ => refuse(e.to_string()),
        };
        // Asked before it is opened: opening a pipe waits for somebody to write.
        let metadata = std::fs::metadata(path).map_err(io_error)?;
        if metadata.is_dir() {
            return Err(refuse("it is a folder".into()));
        }
        if !metadata.is_file() {
            return Err(refuse("it is no plain file".into()));
        }
        let file = File::open(path).map_err(io_error)?;
        let bytes = metadata.len().saturating_sub(start);
        let mut file = BufReader::with_capacity(1 << 16, Watched::new(file, metadata.len(), loading));
        if start > 0 {
            file.seek(SeekFrom::Start(start)).map_err(io_error)?;
        }
        let first = file.fill_buf().map_err(io_error)?;
        let gzipped = first.starts_with(&[0x1f, 0x8b]);
        let unpacks = packing == Packing::Deflate || gzipped && packing == Packing::Sniffed;
        loading.begin(if unpacks { ReadingStage::Unpacking } else { ReadingStage::Reading });
        Ok(match unpacks {
            false => Self::Plain { file, bytes },
            true if gzipped => {
                Self::Gzip { stream: Box::new(MultiGzDecoder::new(file)), packed_bytes: bytes }
            }
            true => Self::Zlib { stream: Box::new(ZlibDecoder::new(file)), packed_bytes: bytes },
        })
    }

    fn loading(&self) -> &'a Loading {
        match self {
            Self::Plain { file, .. } => file.get_ref(),
            Self::Gzip { stream, .. } => stream.get_ref().get_ref(),
            Self::Zlib { stream, .. } => stream.get_ref().get_ref(),
        }
        .loading()
    }

    /// Says that the bytes up to `end` are what is read. What a packed stream holds before them is only told from all of
    /// it: there the share is that of the whole file.
    fn wanted_to(&mut self, end: u64) {
        if let Self::Plain { file, .. } = self {
            file.get_mut().ends_at(end);
        }
    }

    /// More bytes than this cannot come out.
    pub(super) fn most_bytes(&self) -> u64 {
        match self {
            Self::Plain { bytes, .. } => *bytes,
            Self::Gzip { packed_bytes, .. } | Self::Zlib { packed_bytes, .. } => {
                packed_bytes.saturating_mul(DEFLATE_MAX_RATIO)
            }
        }
    }

    fn held(&self) -> String {
        match self {
            Self::Plain { bytes, .. } => format!("{bytes}"),
            Self::Gzip { packed_bytes, .. } | Self::Zlib { packed_bytes, .. } => {
                format!("{packed_bytes} compressed bytes")
            }
        }
    }

    /// Passes over `count` bytes; returns how many there were.
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        if let Self::Plain { file, .. } = self {
            // The caller has compared `count` with the file's size, which fits in i64.
            file.seek_relative(count.min(i64::MAX as u64) as i64)?;
            return Ok(count);
        }
        match io::copy(&mut self.take(count), &mut io::sink()) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
            other => other,
        }
    }

    /// Reads a little on, which checks the checksum where the voxels are the last thing in a packed stream.
    fn finish(&mut self) -> io::Result<()> {
        if !matches!(self, Self::Plain { .. }) {
            io::copy(&mut self.take(1 << 16), &mut io::sink())?;
        }
        Ok(())
    }
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain { file, .. } => file.read(buffer),
            Self::Gzip { stream, .. } => stream.read(buffer),
            Self::Zlib { stream, .. } => stream.read(buffer),
        }
    }
}

/// Voxels as a header claims them to lie in a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    /// Voxels along x, y and z; x runs fastest.
    pub(super) dims: [usize; 3],
    pub(super) element: Element,
    pub(super) byte_order: ByteOrder,
    /// The stream's byte at which the first frame begins.
    pub(super) offset: u64,
    /// Which of the frames that follow each other.
    pub(super) frame: usize,
}

impl Block {
    /// Type and byte order for people.
    pub(super) fn stored_type(&self) -> String {
        self.element.describe(self.byte_order)
    }

    /// The bytes of one frame; `None` where they cannot be counted.
    pub(super) fn bytes(&self) -> Option<u64> {
        data_bytes(self.dims, self.element)
    }

    /// The bytes of its voxels in memory; `None` where they cannot be counted.
    pub(super) fn kept_bytes(&self) -> Option<u64> {
        let bytes = self.element.kept_bytes() as u64;
        self.dims.iter().try_fold(bytes, |bytes, n| bytes.checked_mul(*n as u64))
    }

    /// What they are reduced by while they are read; voxels that there is no memory for are refused.
    fn factors(&self, data: &Source<'_>) -> Result<Option<[usize; 3]>, String> {
        let factors = data.loading().factors_for(self.dims, self.element.kept_bytes() as u64)?;
        let dims = factors.map_or(self.dims, |factors| memory_budget::reduced_dims(self.dims, factors));
        memory_budget::check_grid(dims, self.element.kept_bytes() as u64).map(|()| factors)
    }

    /// Reads the voxels out of a stream of which `read` bytes have been taken.
    ///
    /// # Errors
    /// The stream holds fewer bytes than are claimed, or cannot be read; in words.
    pub(super) fn read(&self, data: &mut Source<'_>, read: u64) -> Result<Voxels, String> {
        self.read_by(data, read, |data, factors| {
            read_reduced(data, self.dims, self.element, self.byte_order, factors)
        })
    }

    /// As [`Self::read`], where z runs fastest and x slowest.
    ///
    /// # Errors
    /// As there.
    pub(super) fn read_turned(&self, data: &mut Source<'_>, read: u64) -> Result<Voxels, String> {
        // Means of blocks are made afterwards.
        self.read_by(data, read, |data, _| read_turned_voxels(data, self.dims, self.element, self.byte_order))
    }

    fn read_by<'a>(
        &self,
        data: &mut Source<'a>,
        read: u64,
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
        let short = |held: String| format!("its header claims {claim}, {end} bytes in all, but it {held}");
        if end > data.most_bytes() {
            return Err(short(format!("holds {}", data.held())));
        }
        let factors = self.factors(data)?;
        data.wanted_to(end);
        if start < read || data.skip(start - read).map_err(|e| e.to_string())? < start - read {
            return Err(short(format!("ends before byte {start}")));
        }
        let voxels = voxels(data, factors).map_err(|failure| match failure {
            ReadFailure::Short { got } => short(format!("ends after {}", start + got)),
            other => other.to_string(),
        })?;
        data.finish().map_err(|e| format!("damaged after the voxels: {e}"))?;
        Ok(voxels)
    }
}

/// Why a file is not exactly its voxels.
#[derive(Debug)]
pub(super) enum Whole {
    /// It holds so much instead.
    Another(String),
    /// It cannot be read.
    Unreadable(String),
}

impl Block {
    /// Reads the voxels of a stream that holds nothing after them.
    ///
    /// # Errors
    /// See [`Whole`].
    pub(super) fn read_all(&self, data: &mut Source<'_>) -> Result<Voxels, Whole> {
        let end = self.bytes().and_then(|bytes| bytes.checked_add(self.offset));
        if end.is_none_or(|end| end > data.most_bytes()) {
            return Err(Whole::Another(data.held()));
        }
        let io_error = |e: io::Error| Whole::Unreadable(e.to_string());
        if data.skip(self.offset).map_err(io_error)? < self.offset {
            return Err(Whole::Another("fewer".into()));
        }
        let factors = self.factors(data).map_err(Whole::Unreadable)?;
        let voxels = read_reduced(data, self.dims, self.element, self.byte_order, factors);
        let voxels = voxels.map_err(|failure| match failure {
            ReadFailure::Short { got } => Whole::Another(format!("{} bytes", self.offset + got)),
            other => Whole::Unreadable(other.to_string()),
        })?;
        match data.read(&mut [0]).map_err(io_error)? {
            0 => Ok(voxels),
            _ => Err(Whole::Another("more".into())),
        }
    }
}

/// What to say of integers that `f64` cannot hold: 64-bit ones beyond 2^53 are rounded to the nearest.
pub(super) fn inexact_integers(voxels: &Voxels, element: Element) -> Option<String> {
    let limit = (1u64 << f64::MANTISSA_DIGITS) as f64;
    match (voxels, element) {
        (Voxels::F64(a), Element::I64 | Element::U64) if a.iter().any(|v| v.abs() > limit) => {
            Some("integers beyond 2^53 were rounded to 53 bits".into())
        }
        _ => None,
    }
}
