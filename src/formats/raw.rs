//! Raw files: voxels and nothing else, gzipped or not; the layout comes from `--raw`, from a [`Sidecar`] or from the
//! file's name.

use super::raw_layout::RawLayout;
use super::sidecar::Sidecar;
use super::source::{Block, Packing, Source, Whole};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::Path;

/// What is read, and where the file does not say it, how it is placed.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFile {
    /// Grid and element type.
    pub layout: RawLayout,
    /// Voxel size, mm; voxel (0, 0, 0) then sits at the world's origin and the axes are the world's.
    pub spacing_mm: Option<[f64; 3]>,
    /// Bytes before the voxels, unpacked.
    pub offset_bytes: u64,
    /// What stands beside the file, where anything does.
    pub sidecar: Option<Sidecar>,
}

impl From<RawLayout> for RawFile {
    /// Voxels from the first byte on, and nothing known of where they are.
    fn from(layout: RawLayout) -> Self {
        Self { layout, spacing_mm: None, offset_bytes: 0, sidecar: None }
    }
}

/// Reads a raw file, gzipped or not. Without a spacing and without a sidecar voxels count 1 mm.
///
/// # Errors
/// The file cannot be read, its size is not exactly the offset and the voxels, or a spacing is not above 0.
pub fn read(path: &Path, file: &RawFile) -> Result<Volume> {
    read_with(path, file, &Loading::default())
}

/// As [`read`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn read_with(path: &Path, file: &RawFile, loading: &Loading) -> Result<Volume> {
    let RawFile { layout, spacing_mm, offset_bytes, sidecar } = file;
    let source = path.display().to_string();
    let refuse = |why: String| Error::input("cannot read raw volume", &source, why);
    let mut warnings = Vec::new();
    if sidecar.is_none() && spacing_mm.is_none() {
        warnings.push("no --spacing given: voxels taken as 1 mm".to_string());
    }
    let spacing_mm = spacing_mm.unwrap_or([1.0; 3]);
    if !spacing_mm.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(Error::input(
            "cannot use spacing",
            "--spacing",
            format!("{spacing_mm:?} mm is not three lengths above 0"),
        ));
    }
    let RawLayout { dims, element, byte_order } = *layout;
    let block = Block { dims, element, byte_order, offset: *offset_bytes, frame: 0 };
    let wanted = block.bytes().and_then(|bytes| bytes.checked_add(*offset_bytes));
    // Voxels may begin as a gzip stream does: a file of just their size is none.
    let is_exact = std::fs::metadata(path).is_ok_and(|m| Some(m.len()) == wanted);
    let packing = if is_exact { Packing::Plain } else { Packing::Sniffed };
    let mut data = Source::open_at(path, 0, packing, loading)?;
    let another_size = |held: String| {
        let [nx, ny, nz] = dims;
        let wanted = wanted.map_or("more bytes than can be counted".into(), |n| format!("{n} bytes"));
        let claim = format!("{nx}x{ny}x{nz} {} after {offset_bytes} bytes is {wanted}", block.stored_type());
        refuse(format!("{claim}, the file has {held}"))
            .hint("--raw DIMXxDIMYxDIMZ:TYPE and --offset BYTES must account for the whole file")
    };
    let is_plain = matches!(data, Source::Plain { .. });
    if is_plain && wanted != Some(data.most_bytes()) {
        return Err(another_size(format!("{} bytes", data.most_bytes())));
    }
    let voxels = block.read_all(&mut data).map_err(|e| match e {
        // What a packed file holds is known once it was unpacked.
        Whole::Another(held) => another_size(held),
        Whole::Unreadable(why) => refuse(why),
    })?;
    let world_from_index = match sidecar {
        Some(said) if file.spacing_mm.is_none() => said.affine(),
        _ => DAffine3::from_scale(DVec3::from_array(spacing_mm)),
    };
    let scaling = sidecar.as_ref().map_or(Scaling::IDENTITY, Sidecar::scaling);
    let affine_source = match sidecar {
        Some(_) if file.spacing_mm.is_none() => AffineSource::Axes,
        _ => AffineSource::Spacing,
    };
    let stored_type = block.stored_type();
    let provenance = Provenance { affine_source, warnings, ..Provenance::new(&source, "raw", stored_type) };
    Volume::new_with(voxels, scaling, world_from_index, provenance, loading)
}
