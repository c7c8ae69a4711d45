//! NIfTI-1 and NIfTI-2, and Analyze 7.5 before them: `.nii`, `.hdr` with `.img`, each plain or gzipped.
//!
//! Read here and not by the `nifti` crate, which knows version 1 alone and allocates what the header claims before it
//! has seen any data.

use super::frames::picked;
use super::nifti_header::{self, HEADER_BYTES, Header};
use super::source::{Block, Source, inexact_integers};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::element::{Element, read_full};
use crate::volume::{Provenance, Scaling, Volume};
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
    let of_several = picked(path, frame, frames)?;

    let (mut data, data_path, at) = if header.paired {
        let data_path = pair.ok_or_else(|| {
            refuse("its header says that the voxels are in an .img file, but it is not named .hdr".into())
        })?;
        let data_path = data_path.voxels();
        (Source::open(&data_path, loading)?, data_path, 0)
    } else {
        (source, header_path, header_bytes)
    };
    let block = Block { dims, element, byte_order: header.byte_order, offset, frame };
    let voxels = block
        .read(&mut data, at)
        .map_err(|why| Error::input("cannot read volume", data_path.display(), why))?;

    let mut warnings = header_warnings(&header, element);
    warnings.splice(0..0, of_several);
    warnings.extend(inexact_integers(&voxels, element));
    let (world_from_index, affine_source) = header.affine(&mut warnings);
    let provenance = Provenance {
        source: path.display().to_string(),
        format: if header.is_analyze { "analyze".into() } else { format!("nifti{}", header.version) },
        stored_type: block.stored_type(),
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

fn header_warnings(header: &Header, element: Element) -> Vec<String> {
    let mut warnings = Vec::new();
    if header.is_analyze && header.scaling() != Ok(Scaling::IDENTITY) {
        warnings.push("its values are scaled as SPM has it (Analyze 7.5 knows no scaling)".into());
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
