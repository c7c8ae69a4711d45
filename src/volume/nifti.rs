//! NIfTI-1 and NIfTI-2: `.nii`, `.hdr` with `.img`, each plain or gzipped.
//!
//! Read here and not by the `nifti` crate, which knows version 1 alone and allocates what the header claims before it
//! has seen any data.

use super::element::{Element, ReadFailure, data_bytes, read_full, read_voxels};
use super::nifti_header::{self, HEADER_BYTES, Header};
use super::{Provenance, Volume, Voxels};
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Reads one frame (0 is the first) of a NIfTI file; of a pair either file may be named.
///
/// # Errors
/// The file cannot be read, is not NIfTI, holds no scalars, or has less data than its header claims.
pub fn read(path: &Path, frame: usize) -> Result<Volume> {
    read_with(path, frame, &Loading::default())
}

/// As [`read`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    let pair = Pair::of(path);
    let header_path = pair.as_ref().map_or_else(|| path.to_path_buf(), Pair::header);
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let mut source = Source::open(&header_path, loading)?;
    let (header, header_bytes) = read_header(&mut source, &header_path)?;

    let (dims, frames) = header.grid().map_err(refuse)?;
    let element = header.element().map_err(refuse)?;
    let scaling = header.scaling().map_err(refuse)?;
    let offset = header.data_offset().map_err(refuse)?;
    if frame >= frames {
        return Err(Error::input(
            "cannot read frame",
            path.display(),
            format!("--frame {frame} is beyond its {frames} frames (counted from 0)"),
        ));
    }

    let (mut data, data_path, at) = if header.paired {
        let data_path = pair.ok_or_else(|| {
            refuse("its header says that the voxels are in an .img file, but it is not named .hdr".into())
        })?;
        let data_path = data_path.voxels();
        (Source::open(&data_path, loading)?, data_path, 0)
    } else {
        (source, header_path, header_bytes)
    };
    let refuse = |why: String| Error::input("cannot read volume", data_path.display(), why);
    let frame_bytes = data_bytes(dims, element);
    let start = frame_bytes
        .and_then(|bytes| bytes.checked_mul(frame as u64))
        .and_then(|skipped| skipped.checked_add(offset));
    let end = start.zip(frame_bytes).and_then(|(start, bytes)| start.checked_add(bytes));
    let [nx, ny, nz] = dims;
    let claim = format!("{nx}x{ny}x{nz} {} from byte {offset} on", element.describe(header.byte_order));
    let (Some(start), Some(end)) = (start, end) else {
        return Err(refuse(format!("its header claims {claim}: more bytes than can be counted")));
    };
    let short =
        |held: String| refuse(format!("its header claims {claim}, {end} bytes in all, but it {held}"));
    if end > data.most_bytes() {
        return Err(short(format!("holds {}", data.held())));
    }
    data.wanted_to(end);
    if start < at || data.skip(start - at).map_err(|e| refuse(e.to_string()))? < start - at {
        return Err(short(format!("ends before byte {start}")));
    }
    let voxels =
        read_voxels(&mut data, dims, element, header.byte_order).map_err(|failure| match failure {
            ReadFailure::Short { got } => short(format!("ends after {}", start + got)),
            other => refuse(other.to_string()),
        })?;
    data.finish().map_err(|e| refuse(format!("damaged after the voxels: {e}")))?;

    let mut warnings = header_warnings(&header, element, frames, frame);
    warnings.extend(inexact_integers(&voxels, element));
    let (world_from_index, affine_source) = header.affine(&mut warnings);
    let provenance = Provenance {
        source: path.display().to_string(),
        format: format!("nifti{}", header.version),
        stored_type: element.describe(header.byte_order),
        affine_source,
        frames,
        frame,
        values: header.values_said(),
        non_finite: 0,
        warnings,
    };
    Volume::new_with(voxels, scaling, world_from_index, provenance, loading)
}

/// Whether a file begins with a NIfTI header, magic and all, gzipped or not.
pub fn is_nifti(path: &Path) -> bool {
    let loading = Loading::default();
    let path = Pair::of(path).map_or_else(|| path.to_path_buf(), |pair| pair.header());
    Source::open(&path, &loading).is_ok_and(|mut source| read_header(&mut source, &path).is_ok())
}

/// The header and the number of bytes taken from the source for it.
fn read_header(source: &mut Source<'_>, path: &Path) -> Result<(Header, u64)> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let mut bytes = [0u8; HEADER_BYTES[1]];
    let (start, rest) = bytes.split_at_mut(4);
    let got = read_full(source, start).map_err(|e| refuse(e.to_string()))?;
    if got == 0 {
        return Err(refuse("it is empty".into()));
    }
    let (version, order) = <[u8; 4]>::try_from(&*start)
        .ok()
        .filter(|_| got == 4)
        .and_then(nifti_header::recognise)
        .ok_or_else(|| refuse("it is not a NIfTI file".into()))?;
    let length = HEADER_BYTES[usize::from(version) - 1];
    let got = 4 + read_full(source, &mut rest[..length - 4]).map_err(|e| refuse(e.to_string()))?;
    if got < length {
        return Err(refuse(format!("its header ends after {got} of {length} bytes")));
    }
    let header = Header::parse(&bytes[..length], version, order).map_err(refuse)?;
    Ok((header, length as u64))
}

fn header_warnings(header: &Header, element: Element, frames: usize, frame: usize) -> Vec<String> {
    let mut warnings = Vec::new();
    if frames > 1 {
        warnings
            .push(format!("{frames} frames: frame {frame} (counted from 0) was read, --frame picks another"));
    }
    if header.vox_offset == 0.0 && !header.paired {
        warnings.push("vox_offset is 0: the voxels are taken to follow the header".into());
    }
    if i64::from(header.bitpix) != 8 * element.bytes() as i64 {
        warnings.push(format!("bitpix is {}, not that of {}: ignored", header.bitpix, element.name()));
    }
    let unit = match header.xyzt_units & 7 {
        1 => Some("metres"),
        3 => Some("microns"),
        _ => None,
    };
    if let Some(unit) = unit {
        warnings.push(format!(
            "the header gives lengths in {unit}: its numbers are used as millimetres all the same"
        ));
    }
    warnings
}

/// 64-bit integers beyond 2^53 are rounded to the nearest `f64`.
fn inexact_integers(voxels: &Voxels, element: Element) -> Option<String> {
    let limit = (1u64 << f64::MANTISSA_DIGITS) as f64;
    match (voxels, element) {
        (Voxels::F64(a), Element::I64 | Element::U64) if a.iter().any(|v| v.abs() > limit) => {
            Some("integers beyond 2^53 were rounded to 53 bits".into())
        }
        _ => None,
    }
}

/// The files that a name stands for: both of a pair.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    match Pair::of(path).map(|pair| [pair.header(), pair.voxels()]) {
        Some(both) if both.iter().all(|p| p.exists()) => both.into(),
        _ => vec![path.into()],
    }
}

/// The two files of a `.hdr`/`.img` pair, told from the name of either.
struct Pair {
    stem: PathBuf,
    /// The path as given, kept for the file that it names.
    given: PathBuf,
    given_is_header: bool,
}

impl Pair {
    fn of(path: &Path) -> Option<Self> {
        let is = |p: &Path, ending: &str| p.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
        let plain = if is(path, "gz") { path.with_extension("") } else { path.to_path_buf() };
        (is(&plain, "hdr") || is(&plain, "img")).then(|| Self {
            stem: plain.with_extension(""),
            given: path.to_path_buf(),
            given_is_header: is(&plain, "hdr"),
        })
    }

    fn header(&self) -> PathBuf {
        if self.given_is_header { self.given.clone() } else { self.other("hdr") }
    }

    fn voxels(&self) -> PathBuf {
        if self.given_is_header { self.other("img") } else { self.given.clone() }
    }

    /// The file with this ending that exists, compressed as the given one rather than otherwise; where there is none,
    /// the name that it should have.
    fn other(&self, ending: &str) -> PathBuf {
        let named = |ending: String| {
            let mut name = self.stem.clone().into_os_string();
            name.push(".");
            name.push(ending);
            PathBuf::from(name)
        };
        let plain = [ending.to_string(), ending.to_uppercase()];
        let gzipped = [format!("{ending}.gz")];
        let candidates: Vec<PathBuf> = if self.given.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
        {
            gzipped.into_iter().chain(plain).map(named).collect()
        } else {
            plain.into_iter().chain(gzipped).map(named).collect()
        };
        candidates.iter().find(|p| p.exists()).unwrap_or(&candidates[0]).clone()
    }
}

/// A file to read from, gzipped or not (told from its content, not from its name).
enum Source<'a> {
    Plain { file: BufReader<Watched<'a, File>>, bytes: u64 },
    Gzip { stream: Box<MultiGzDecoder<BufReader<Watched<'a, File>>>>, compressed_bytes: u64 },
}

/// Deflate cannot pack more than this many bytes into one.
const DEFLATE_MAX_RATIO: u64 = 1032;

impl<'a> Source<'a> {
    fn open(path: &Path, loading: &'a Loading) -> Result<Self> {
        let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
        let io_error = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => refuse("no such file".into()),
            _ => refuse(e.to_string()),
        };
        let file = File::open(path).map_err(io_error)?;
        let metadata = file.metadata().map_err(io_error)?;
        if metadata.is_dir() {
            return Err(refuse("it is a folder".into()));
        }
        let bytes = metadata.len();
        let mut file = BufReader::with_capacity(1 << 16, Watched::new(file, bytes, loading));
        let gzipped = file.fill_buf().map_err(io_error)?.starts_with(&[0x1f, 0x8b]);
        loading.begin(if gzipped { ReadingStage::Unpacking } else { ReadingStage::Reading });
        Ok(if gzipped {
            Self::Gzip { stream: Box::new(MultiGzDecoder::new(file)), compressed_bytes: bytes }
        } else {
            Self::Plain { file, bytes }
        })
    }

    /// Says that the bytes up to `end` are what is read. What a gzip stream holds before them is only told from all of
    /// it: there the share is that of the whole file.
    fn wanted_to(&mut self, end: u64) {
        if let Self::Plain { file, .. } = self {
            file.get_mut().ends_at(end);
        }
    }

    /// More bytes than this cannot come out.
    fn most_bytes(&self) -> u64 {
        match self {
            Self::Plain { bytes, .. } => *bytes,
            Self::Gzip { compressed_bytes, .. } => compressed_bytes.saturating_mul(DEFLATE_MAX_RATIO),
        }
    }

    fn held(&self) -> String {
        match self {
            Self::Plain { bytes, .. } => format!("{bytes}"),
            Self::Gzip { compressed_bytes, .. } => format!("{compressed_bytes} compressed bytes"),
        }
    }

    /// Passes over `count` bytes; returns how many there were.
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        match self {
            Self::Plain { file, .. } => {
                // The caller has compared `count` with the file's size, which fits in i64.
                file.seek_relative(count.min(i64::MAX as u64) as i64)?;
                Ok(count)
            }
            Self::Gzip { stream, .. } => match io::copy(&mut stream.by_ref().take(count), &mut io::sink()) {
                Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
                other => other,
            },
        }
    }

    /// Reads a little on, which checks the checksum where the voxels are the last thing in a gzip stream.
    fn finish(&mut self) -> io::Result<()> {
        if let Self::Gzip { stream, .. } = self {
            io::copy(&mut stream.by_ref().take(1 << 16), &mut io::sink())?;
        }
        Ok(())
    }
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain { file, .. } => file.read(buffer),
            Self::Gzip { stream, .. } => stream.read(buffer),
        }
    }
}
