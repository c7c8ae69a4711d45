//! The formats that can be read, and reading: from what a user names to a [`Volume`].
//!
//! One entry of [`FORMATS`] is all that a format needs: errors, hints, help and the window's dialog read that list.

use super::strands::{StrandFlags, is_strand_source, load_strands};
use super::values;
use crate::error::{Error, Result};
use crate::files::hash::sha256_of_files;
use crate::files::loading::Loading;
use crate::scene::Shading;
use crate::strands::{STRAND_EXTENSIONS, StrandSet, StrandVolume, VoxelisedStrands};
use crate::volume::{Phantom, RawLayout, Volume, nifti, raw};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How to read a volume that does not say it itself; absent ones are `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args, Serialize)]
pub struct ReadFlags {
    /// Read VOLUME as raw voxels: DIMXxDIMYxDIMZ:TYPE, TYPE one of u8 i8 u16 i16 u32 i32 f32 f64, then :be for
    /// big-endian [default: from a name like foot_256x256x256_uint8.raw]
    #[arg(long, value_name = "LAYOUT", value_parser = values::raw_layout, help_heading = "Volume")]
    pub raw: Option<RawLayout>,
    /// Voxel spacing of a raw file, mm [default: 1,1,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::spacing_mm, allow_hyphen_values = true, help_heading = "Volume")]
    pub spacing: Option<[f64; 3]>,
    /// Bytes before the first voxel of a raw file [default: 0]
    #[arg(long, value_name = "BYTES", allow_hyphen_values = true, help_heading = "Volume")]
    pub offset: Option<u64>,
    /// Which volume of a 4-D file, from 0 [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub frame: Option<usize>,
    #[expect(missing_docs, reason = "flags of their own, whose comments are the help")]
    #[command(flatten)]
    #[serde(flatten)]
    pub strands: StrandFlags,
}

/// Which volume, and what its file does not say itself.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeSpec {
    /// A path, or `phantom:NAME[:SIZE]` for a built-in volume; a file of [`crate::strands::STRAND_FORMATS`] and
    /// `phantom:hair-NAME[:SEGMENTS]` are strands.
    pub source: String,
    /// How to read it.
    pub flags: ReadFlags,
}

impl VolumeSpec {
    /// A path or `phantom:NAME[:SIZE]`, everything else as the file says.
    pub fn new(source: impl Into<String>) -> Self {
        Self { source: source.into(), flags: ReadFlags::default() }
    }

    fn path(&self) -> &Path {
        Path::new(&self.source)
    }

    /// SHA-256 of the file, or of both of a pair one after the other; `None` for what is built in.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn sha256(&self) -> Result<Option<String>> {
        if self.phantom().is_some() {
            return Ok(None);
        }
        let files = nifti::files_of(self.path());
        sha256_of_files(files.iter().map(PathBuf::as_path)).map(Some)
    }

    /// What follows after `phantom:`.
    fn phantom(&self) -> Option<&str> {
        self.source.strip_prefix("phantom:")
    }

    /// The layout of a raw file: someone who gives `--raw` means it, whatever the file's name says.
    fn layout(&self) -> Option<RawLayout> {
        let of_name = || RawLayout::from_file_name(self.path());
        self.phantom().is_none().then(|| self.flags.raw.or_else(of_name)).flatten()
    }

    /// Whether strands are what it names.
    fn is_of_strands(&self) -> bool {
        self.layout().is_none() && is_strand_source(&self.source)
    }

    /// Refuses a shading that this is not made for.
    pub(super) fn check_shading(&self, shading: Option<Shading>) -> Result<()> {
        match shading {
            Some(Shading::KajiyaKay) if !self.is_of_strands() => {
                let why = format!(
                    "kajiya-kay shades strands by their direction, and {} is not of strands",
                    self.source
                );
                Err(Error::input("cannot use shading", "--shading", why).hint(
                    "lambert and blinn-phong shade any volume; strands are files of hair or tracks, and phantom:hair-NAME",
                ))
            }
            _ => Ok(()),
        }
    }
}

impl Default for VolumeSpec {
    /// The default phantom.
    fn default() -> Self {
        Self::new(format!("phantom:{}", Phantom::default()))
    }
}

/// What has been read.
#[derive(Debug)]
pub struct Read {
    /// The voxels.
    pub volume: Volume,
    /// What they were made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
}

impl From<Volume> for Read {
    fn from(volume: Volume) -> Self {
        Self { volume, strands: None }
    }
}

/// A kind of input that becomes a volume.
#[derive(Debug)]
pub struct Format {
    /// What such a file is, to be said after `SOURCE is`.
    pub kind: &'static str,
    /// How a user asks for it, in hints and in help.
    pub asked_as: &'static str,
    /// Endings of its files, the last part alone: the window's dialog shows these.
    pub endings: &'static [&'static str],
    /// The keys of [`ReadFlags`] that apply.
    pub flags: &'static [&'static str],
    /// Whether an input is of this format, by name, flags or its first bytes.
    sniff: fn(&VolumeSpec) -> bool,
    read: fn(&VolumeSpec, &Loading) -> Result<Read>,
}

/// Every format, in the order in which they are tried; the last one takes whatever no other one does, and says why not.
pub const FORMATS: &[Format] = &[
    Format {
        kind: "raw voxels",
        asked_as: "raw files with --raw DIMXxDIMYxDIMZ:TYPE",
        endings: &["raw"],
        flags: &["raw", "spacing", "offset"],
        sniff: |spec| spec.layout().is_some(),
        read: |spec, loading| {
            let layout = spec
                .layout()
                .ok_or_else(|| Error::input("cannot read raw volume", &spec.source, "no layout"))?;
            let (spacing, offset) = (spec.flags.spacing, spec.flags.offset.unwrap_or(0));
            raw::read_with(spec.path(), layout, spacing, offset, loading).map(Read::from)
        },
    },
    Format {
        kind: "of strands",
        asked_as: "strands (.hair, .tck, .trk, .vtk, .vtp, .obj)",
        endings: STRAND_EXTENSIONS,
        flags: &["resolution", "kernel", "thickness"],
        sniff: VolumeSpec::is_of_strands,
        read: |spec, loading| {
            let strands = load_strands(&spec.source, spec.flags.strands.thickness, loading)?;
            let StrandVolume { volume, grid, kernel, .. } = spec.flags.strands.voxelise(&strands, loading)?;
            Ok(Read { volume, strands: Some(Arc::new(VoxelisedStrands::new(strands, grid, kernel))) })
        },
    },
    Format {
        kind: "a built-in volume",
        asked_as: "phantom:NAME[:SIZE]",
        endings: &[],
        flags: &[],
        sniff: |spec| spec.phantom().is_some(),
        read: |spec, loading| {
            let (phantom, size) =
                Phantom::parse(spec.phantom().unwrap_or_default(), &StrandSet::ALL.map(StrandSet::name))?;
            phantom.build_with(size, loading).map(Read::from)
        },
    },
    Format {
        kind: "read as NIfTI",
        asked_as: "NIfTI (.nii, .nii.gz, .hdr with .img)",
        endings: &["nii", "gz", "hdr", "img"],
        flags: &["frame"],
        sniff: |_| true,
        read: |spec, loading| {
            let path = spec.path();
            let read = nifti::read_with(path, spec.flags.frame.unwrap_or(0), loading).map_err(|e| {
                let unknown = e.hint.is_none() && path.exists() && !nifti::is_nifti(path);
                if unknown { e.hint(format!("accepted are {}", accepted())) } else { e }
            });
            read.map(Read::from)
        },
    },
];

/// How to ask for each format, as a list in one line.
pub fn accepted() -> String {
    FORMATS.iter().map(|f| f.asked_as).collect::<Vec<_>>().join(", ")
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
    read_with(spec, loading).map(|read| read.volume)
}

/// As [`load_with`], with the strands that a volume was made from.
///
/// # Errors
/// As there.
pub fn read_with(spec: &VolumeSpec, loading: &Loading) -> Result<Read> {
    loading.go_on(&spec.source)?;
    let format = FORMATS.iter().find(|f| (f.sniff)(spec)).unwrap_or(&FORMATS[FORMATS.len() - 1]);
    refuse_flags(spec, format)?;
    let outcome = (format.read)(spec, loading);
    // Whatever else went wrong then did so because of that.
    loading.go_on(&spec.source)?;
    outcome
}

/// Refuses a flag that is for other formats.
fn refuse_flags(spec: &VolumeSpec, format: &Format) -> Result<()> {
    // The first frame is the only one that every format has.
    let flags = ReadFlags { frame: spec.flags.frame.filter(|frame| *frame > 0), ..spec.flags };
    let given =
        serde_json::to_value(flags).map_err(|e| Error::runtime("cannot use flags", &spec.source, e))?;
    let mut given = given.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
    let Some((flag, _)) = given.find(|(flag, _)| !format.flags.contains(&flag.as_str())) else {
        return Ok(());
    };
    let mut others = FORMATS.iter().filter(|f| f.flags.contains(&flag.as_str()));
    let other = others.next().map_or("nothing", |f| f.asked_as);
    let why = format!("{} is {}, and this flag is for {other}", spec.source, format.kind);
    Err(Error::input("cannot use flag", format!("--{flag}"), why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        flags: ReadFlags,
    }

    #[test]
    fn every_flag_is_some_formats_and_every_formats_flag_there() {
        use clap::CommandFactory;
        let command = Line::command();
        let known: Vec<&str> = command.get_arguments().map(|a| a.get_id().as_str()).collect();
        let mut used: Vec<&str> = FORMATS.iter().flat_map(|f| f.flags).copied().collect();
        assert!(known.iter().all(|flag| used.contains(flag)), "{known:?} {used:?}");
        used.retain(|flag| !known.contains(flag));
        assert!(used.is_empty(), "{used:?}");
    }

    #[test]
    fn a_flag_of_another_format_is_refused_with_the_one_that_takes_it() {
        for (source, flag, other) in [
            ("a.nii", "--spacing=1,1,1", "raw files"),
            ("a.nii", "--kernel=tent", ".hair"),
            ("a.hair", "--offset=1", "raw files"),
            ("a.hair", "--frame=1", "NIfTI"),
            ("a_2x2x2_u8.raw", "--thickness=1", ".hair"),
            ("phantom:slab", "--raw=2x2x2:u8", "raw files"),
            ("phantom:hair-curly", "--spacing=1,1,1", "raw files"),
        ] {
            let flags = Line::try_parse_from(["test", flag]).unwrap().flags;
            let e = load(&VolumeSpec { source: source.into(), flags }).unwrap_err();
            assert!(flag.starts_with(&e.place) && e.why.contains(source) && e.why.contains(other), "{e}");
        }
    }

    #[test]
    fn what_is_of_no_format_hears_of_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.dat");
        for bytes in [&b""[..], b"no volume at all"] {
            std::fs::write(&path, bytes).unwrap();
            let hint = load(&VolumeSpec::new(path.to_string_lossy())).unwrap_err().hint.unwrap();
            assert!(FORMATS.iter().all(|f| hint.contains(f.asked_as)) && hint.contains(".hair"), "{hint}");
        }
        assert!(load(&VolumeSpec::new("gone.nii")).unwrap_err().hint.is_none());
    }
}
