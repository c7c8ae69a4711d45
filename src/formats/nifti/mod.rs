//! Reads NIfTI-1, NIfTI-2 and Analyze 7.5 volumes: `.nii`, or `.hdr` with `.img`, each plain or gzipped.
//!
//! The `nifti` crate parses the headers of NIfTI-1. Its version 0.18 cannot read the voxels: it ignores
//! `vox_offset`, allocates as much memory as a damaged header claims, and reads only the first member of a gzip
//! file.

mod header;
mod write;

pub use self::write::{NIFTI_EXTENSIONS, write_nifti};

use self::header::{HEADER_BYTES, Header};
use super::common::{frame_warning, refusal, with_integer_warning};
use super::source::{Block, Source};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::read::read_full;
use crate::volume::{Element, Provenance, Scaling, Volume};
use std::path::{Path, PathBuf};

/// Reads one frame of a NIfTI volume, selected by its index from 0. The path names a single file, or either file of a
/// `.hdr`/`.img` pair.
///
/// # Errors
/// The file cannot be read, is not NIfTI, holds no scalars, or has less data than its header claims; or reading was
/// cancelled.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    let pair = Pair::new(path);
    let header_path = pair.as_ref().map_or(path, |pair| &pair.header);
    let refuse = refusal(path);
    let mut source = Source::open(header_path, loading)?;
    let (header, header_bytes) = read_header(&mut source, header_path)?;

    let (dims, frames) = header.grid().map_err(&refuse)?;
    let element = header.element().map_err(&refuse)?;
    let scaling = header.scaling().map_err(&refuse)?;
    let offset = header.data_offset().map_err(&refuse)?;
    let frame_warning = frame_warning(path, frame, frames)?;

    let (mut data, data_path, at) = if header.is_pair {
        let pair = pair.as_ref().ok_or_else(|| {
            refuse("its voxels are in an .img file by its header, but it is not named .hdr".into())
        })?;
        (Source::open(&pair.voxels, loading)?, &*pair.voxels, 0)
    } else {
        (source, header_path, header_bytes)
    };
    let block = Block { dims, element, byte_order: header.byte_order, offset, frame };
    let storage = block.open(&mut data, at).map_err(refusal(data_path))?;

    let mut warnings = header_warnings(&header, element);
    warnings.splice(0..0, frame_warning);
    let (world_from_index, affine_source) = header.affine(&mut warnings);
    let provenance = Provenance {
        source: path.display().to_string(),
        format: if header.is_analyze { "analyze".into() } else { format!("nifti{}", header.version) },
        stored_type: block.stored_type(),
        affine_source,
        frames,
        frame,
        values: header.value_meaning(),
        non_finite: 0,
        segments: Vec::new(),
        warnings,
    };
    let volume = Volume::from_storage(storage, scaling, world_from_index, provenance, loading)?;
    Ok(with_integer_warning(volume, element))
}

/// Whether a file begins with a NIfTI header, gzipped or not.
pub fn is_nifti(path: &Path) -> bool {
    let loading = Loading::default();
    let path = Pair::new(path).map_or_else(|| path.to_path_buf(), |pair| pair.header);
    Source::open(&path, &loading).is_ok_and(|mut source| read_header(&mut source, &path).is_ok())
}

/// Reads the header of a NIfTI file and returns it with its size in bytes.
fn read_header(source: &mut Source<'_>, path: &Path) -> Result<(Header, u64)> {
    let refuse = refusal(path);
    let mut bytes = [0u8; HEADER_BYTES[1]];
    let (start, rest) = bytes.split_at_mut(4);
    let got = read_full(source, start).map_err(|e| refuse(e.to_string()))?;
    if got == 0 {
        return Err(refuse("it is empty".into()));
    }
    let (version, order) = <[u8; 4]>::try_from(&*start)
        .ok()
        .filter(|_| got == 4)
        .and_then(header::recognise)
        .ok_or_else(|| {
            let name = path.to_string_lossy().to_ascii_lowercase();
            let is_named = [".nii", ".nii.gz", ".hdr", ".img"].iter().any(|ending| name.ends_with(ending));
            refuse(if is_named { "it is not a NIfTI file" } else { "its format is not supported" }.into())
        })?;
    let length = HEADER_BYTES[usize::from(version) - 1];
    let got = 4 + read_full(source, &mut rest[..length - 4]).map_err(|e| refuse(e.to_string()))?;
    if got < length {
        return Err(refuse(format!("its header ends after {got} of {length} bytes")));
    }
    let header = Header::parse(&bytes[..length], version, order).map_err(&refuse)?;
    Ok((header, length as u64))
}

fn header_warnings(header: &Header, element: Element) -> Vec<String> {
    let mut warnings = Vec::new();
    if header.is_analyze && header.scaling() != Ok(Scaling::IDENTITY) {
        warnings.push("its values are scaled as in SPM (Analyze 7.5 has no scaling)".into());
    }
    if header.vox_offset == 0.0 && !header.is_pair {
        warnings.push("vox_offset is 0: the voxels are read right after the header".into());
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
        warnings.push(format!("the header gives lengths in {unit}: its numbers are used as millimetres"));
    }
    warnings
}

/// Lists the files of a NIfTI volume: both files of a `.hdr`/`.img` pair, or the single file.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    match Pair::new(path) {
        Some(Pair { header, voxels }) if header.exists() && voxels.exists() => vec![header, voxels],
        _ => vec![path.into()],
    }
}

/// Paths of the header file and the voxel file of a NIfTI `.hdr`/`.img` pair, from the name of either file.
struct Pair {
    header: PathBuf,
    voxels: PathBuf,
}

impl Pair {
    fn new(path: &Path) -> Option<Self> {
        let is = |p: &Path, ending: &str| p.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
        let is_gzipped = is(path, "gz");
        let plain = if is_gzipped { path.with_extension("") } else { path.to_path_buf() };
        // The existing file with this ending, compressed as the given one if possible; otherwise its usual name.
        let other = |ending: &str| {
            let mut names = [ending.to_string(), ending.to_uppercase(), format!("{ending}.gz")];
            if is_gzipped {
                names.rotate_right(1);
            }
            let files = names.map(|name| plain.with_extension(name));
            files.iter().find(|p| p.exists()).unwrap_or(&files[0]).clone()
        };
        if is(&plain, "hdr") {
            Some(Self { header: path.into(), voxels: other("img") })
        } else if is(&plain, "img") {
            Some(Self { header: other("hdr"), voxels: path.into() })
        } else {
            None
        }
    }
}
