//! From what the command line says to a volume.

use super::{Phantom, RawLayout, Volume, nifti, raw};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::strands::{self, StrandFlags, StrandSet, is_strand_source};
use std::path::Path;

/// Which volume, and what its file does not say itself.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeSpec {
    /// A path, or `phantom:NAME[:SIZE]` for a built-in volume; a `.hair` path and `phantom:hair-NAME[:SEGMENTS]` are
    /// strands.
    pub source: String,
    /// Layout of a raw file (`--raw`); absent, a file name may say it.
    pub raw: Option<RawLayout>,
    /// Voxel size of a raw file (`--spacing`), mm.
    pub spacing_mm: Option<[f64; 3]>,
    /// Bytes before the voxels of a raw file (`--offset`).
    pub offset_bytes: Option<u64>,
    /// Frame of a 4-D file (`--frame`), counted from 0; absent, the first.
    pub frame: Option<usize>,
    /// How strands become voxels (`--resolution`, `--kernel`, `--thickness`).
    pub strands: StrandFlags,
}

impl VolumeSpec {
    /// A path or `phantom:NAME[:SIZE]`, everything else as the file says.
    pub fn new(source: impl Into<String>) -> Self {
        Self {
            source: source.into(),
            raw: None,
            spacing_mm: None,
            offset_bytes: None,
            frame: None,
            strands: StrandFlags::default(),
        }
    }
}

impl Default for VolumeSpec {
    /// The default phantom.
    fn default() -> Self {
        Self::new(format!("phantom:{}", Phantom::default()))
    }
}

/// Loads a volume.
///
/// # Errors
/// The volume cannot be read, or a flag does not apply to its kind.
pub fn load(spec: &VolumeSpec) -> Result<Volume> {
    load_with(spec, &Loading::default())
}

/// As [`load`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn load_with(spec: &VolumeSpec, loading: &Loading) -> Result<Volume> {
    loading.go_on(&spec.source)?;
    let outcome = read(spec, loading);
    // Whatever else went wrong then did so because of that.
    loading.go_on(&spec.source)?;
    outcome
}

fn read(spec: &VolumeSpec, loading: &Loading) -> Result<Volume> {
    let path = Path::new(&spec.source);
    let phantom = spec.source.strip_prefix("phantom:");
    // Someone who gives --raw means it, whatever the file's name says.
    let layout = spec.raw.or_else(|| phantom.is_none().then(|| RawLayout::from_file_name(path)).flatten());
    let refuse_flag = |flag: &str, given: bool, kind: &str| match given {
        true => Err(Error::input("cannot use flag", flag, format!("{} is {kind}", spec.source))),
        false => Ok(()),
    };
    let of_strands = layout.is_none() && is_strand_source(&spec.source);
    if !of_strands {
        let StrandFlags { resolution, kernel, thickness } = spec.strands;
        refuse_flag("--resolution", resolution.is_some(), "not of strands")?;
        refuse_flag("--kernel", kernel.is_some(), "not of strands")?;
        refuse_flag("--thickness", thickness.is_some(), "not of strands")?;
    }
    if phantom.is_some() || layout.is_none() {
        let kind = match (of_strands, phantom.is_some()) {
            (true, _) => "of strands",
            (false, true) => "a built-in volume",
            (false, false) => "not known to be a raw file (--raw)",
        };
        refuse_flag("--raw", spec.raw.is_some(), kind)?;
        refuse_flag("--spacing", spec.spacing_mm.is_some(), kind)?;
        refuse_flag("--offset", spec.offset_bytes.is_some(), kind)?;
    }
    if of_strands {
        refuse_flag("--frame", spec.frame.is_some_and(|f| f > 0), "of strands, one frame")?;
        let strands = strands::load_strands_with(&spec.source, spec.strands.thickness, loading)?;
        return strands::load_volume_with(&strands, &spec.strands, loading).map(|made| made.volume);
    }
    match (phantom, layout) {
        (Some(name), _) => {
            refuse_flag("--frame", spec.frame.is_some_and(|f| f > 0), "a built-in volume of one frame")?;
            let (phantom, size) = Phantom::parse(name, &StrandSet::ALL.map(StrandSet::name))?;
            phantom.build_with(size, loading)
        }
        (None, Some(layout)) => {
            refuse_flag("--frame", spec.frame.is_some_and(|f| f > 0), "a raw file of one frame")?;
            raw::read_with(path, layout, spec.spacing_mm, spec.offset_bytes.unwrap_or(0), loading)
        }
        (None, None) => nifti::read_with(path, spec.frame.unwrap_or(0), loading),
    }
}
