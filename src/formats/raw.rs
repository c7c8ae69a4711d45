//! Reads raw volumes: files of voxels without a header, gzipped or not. The layout comes from `--raw`, a [`Sidecar`]
//! or the file name.

use super::raw_layout::{RawLayout, Sidecar};
use super::source::{Block, Compression, Source};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::Path;

/// Voxel layout and placement of a raw volume file, which has no header.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFile {
    /// Grid size, voxel type and byte order of the raw volume.
    pub layout: RawLayout,
    /// Voxel size of the raw volume in mm, which overrides the affine of the sidecar file. Voxel (0, 0, 0) is then at
    /// the origin, and the grid axes are the world axes.
    pub spacing_mm: Option<[f64; 3]>,
    /// Number of decompressed bytes before the first voxel of the raw volume file.
    pub offset_bytes: u64,
    /// Contents of the JSON sidecar file beside the raw volume, if there is one.
    pub sidecar: Option<Sidecar>,
}

impl From<RawLayout> for RawFile {
    /// Creates the layout of a raw volume file whose voxels start at the first byte; it has no voxel size and no
    /// sidecar file.
    fn from(layout: RawLayout) -> Self {
        Self { layout, spacing_mm: None, offset_bytes: 0, sidecar: None }
    }
}

/// Reads a raw volume file, gzipped or not. Without a voxel size or a sidecar file, voxels are taken as 1 mm.
///
/// # Errors
/// The file cannot be read, its size is not exactly that of the offset and the voxels, or a voxel size is not above
/// 0; or reading was cancelled.
pub fn read_with(path: &Path, file: &RawFile, loading: &Loading) -> Result<Volume> {
    let RawFile { layout: RawLayout { dims, element, byte_order }, spacing_mm, offset_bytes, sidecar } = file;
    let source = path.display().to_string();
    let refuse = |why: String| {
        Error::input("cannot read raw volume", &source, why)
            .hint("--raw DIMXxDIMYxDIMZ:TYPE and --offset BYTES must account for the whole file")
    };
    let mut warnings = Vec::new();
    if sidecar.is_none() && spacing_mm.is_none() {
        warnings.push("no --spacing given: voxels taken as 1 mm".to_string());
    }
    if spacing_mm.is_some_and(|spacing| !spacing.iter().all(|s| s.is_finite() && *s > 0.0)) {
        let why = format!("{:?} mm is not three lengths above 0", spacing_mm.unwrap_or_default());
        return Err(Error::input("cannot use spacing", "--spacing", why));
    }
    let block =
        Block { dims: *dims, element: *element, byte_order: *byte_order, offset: *offset_bytes, frame: 0 };
    let expected = block.bytes().and_then(|bytes| bytes.checked_add(*offset_bytes));
    // Voxels may begin like a gzip stream: a file of exactly their size is not compressed.
    let is_exact = std::fs::metadata(path).is_ok_and(|m| Some(m.len()) == expected);
    let compression = if is_exact { Compression::None } else { Compression::Detected };
    let mut data = Source::open_at(path, 0, compression, loading)?;
    let wrong_size = |found: String| {
        let [nx, ny, nz] = dims;
        let size = expected.map_or("more bytes than can be counted".into(), |n| format!("{n} bytes"));
        let claim = format!("{nx}x{ny}x{nz} {} after {offset_bytes} bytes is {size}", block.stored_type());
        refuse(format!("{claim}, the file has {found}"))
    };
    if !data.is_compressed() && !is_exact {
        return Err(wrong_size(format!("{} bytes", data.max_bytes())));
    }
    let storage = block.open(&mut data, 0).map_err(refuse)?;
    if data.trailing > 0 {
        return Err(wrong_size("more".into()));
    }
    let (world_from_index, affine_source) = match (spacing_mm, sidecar) {
        (None, Some(sidecar)) => (sidecar.affine(), AffineSource::Axes),
        (spacing_mm, _) => {
            let spacing_mm = DVec3::from_array(spacing_mm.unwrap_or([1.0; 3]));
            (DAffine3::from_scale(spacing_mm), AffineSource::Spacing)
        }
    };
    let scaling = sidecar.as_ref().map_or(Scaling::IDENTITY, Sidecar::scaling);
    let stored_type = block.stored_type();
    let provenance = Provenance { affine_source, warnings, ..Provenance::new(&source, "raw", stored_type) };
    Volume::from_storage(storage, scaling, world_from_index, provenance, loading)
}
