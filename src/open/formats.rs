//! The formats that can be read, and reading: from what a user names to a [`Volume`].
//!
//! One entry of [`FORMATS`] is all that a format needs: errors, hints, help and the window's dialog read that list.

use super::fit::{fitted, room_for};
use super::strands::{StrandFlags, is_strand_source, load_strands};
use super::values;
use crate::error::{Error, Result};
use crate::files::hash::sha256_of_files;
use crate::files::loading::Loading;
use crate::formats::raw::RawFile;
use crate::formats::{Head, Sidecar, dicom, metaimage, npy, nrrd, tiff_stack, vti, zarr};
use crate::formats::{RawLayout, nifti, raw};
use crate::phantom::Phantom;
use crate::scene::Shading;
use crate::strands::{STRAND_EXTENSIONS, StrandSet, StrandVolume, VoxelisedStrands};
use crate::volume::{Crop, Downsample, Volume};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// How to read a volume that does not say it itself; absent ones are `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args, Serialize)]
pub struct ReadFlags {
    /// Read VOLUME as raw voxels: DIMXxDIMYxDIMZ:TYPE, TYPE one of u8 i8 u16 i16 u32 i32 f32 f64, then :be for
    /// big-endian [default: from a name like foot_256x256x256_uint8.raw]
    #[arg(long, value_name = "LAYOUT", value_parser = values::raw_layout, help_heading = "Volume")]
    pub raw: Option<RawLayout>,
    /// Voxel spacing of a file that does not say it (raw, .npy, TIFF, Zarr), or to win over it, mm [default: the file's, or 1,1,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::spacing_mm, allow_hyphen_values = true, help_heading = "Volume")]
    pub spacing: Option<[f64; 3]>,
    /// Bytes before the first voxel of a raw file [default: 0]
    #[arg(long, value_name = "BYTES", allow_hyphen_values = true, help_heading = "Volume")]
    pub offset: Option<u64>,
    /// Which series of a folder of DICOM files, from 1, where it holds several: the order of their series numbers
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub series: Option<usize>,
    /// Which volume of a 4-D file, from 0 [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub frame: Option<usize>,
    /// Which size of an image that is there in several, from 0, the finest [default: the finest that fits memory and a texture]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub level: Option<usize>,
    /// Only these voxels, x0:x1,y0:y1,z0:z1 by index from 0, both ends included; parts may be empty [default: all]
    #[arg(long, value_name = "RANGES", value_parser = Crop::from_str, allow_hyphen_values = true, help_heading = "Volume")]
    pub crop: Option<Crop>,
    /// Fewer voxels, each the mean of a block: of 2x2x1 voxels, or the smallest blocks that leave so many bytes of voxels
    /// (--fit=2GiB), or that the adapter's textures and the machine's free memory hold (--fit) [default: all voxels]
    #[arg(long, value_name = "auto|BYTES|XxYxZ", value_parser = Downsample::from_str, num_args = 0..=1, require_equals = true, default_missing_value = "auto", help_heading = "Volume")]
    pub fit: Option<Downsample>,
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

    /// SHA-256 of the file, or of all of several one after the other; `None` for what is built in.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn sha256(&self) -> Result<Option<String>> {
        if self.phantom().is_some() {
            return Ok(None);
        }
        let files = self.format().map(|format| (format.files)(self)).transpose()?.unwrap_or_default();
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

    /// As a raw file: its layout from `--raw`, from what stands beside it, or from its name.
    fn raw_file(&self) -> Result<RawFile> {
        let sidecar = if self.flags.raw.is_none() { Sidecar::beside(self.path())? } else { None };
        let layout = match (&sidecar, self.layout()) {
            (Some(said), _) => said.raw_layout()?,
            (None, Some(layout)) => layout,
            (None, None) => {
                return Err(Error::input("cannot read raw volume", &self.source, "nothing says its layout")
                    .hint("--raw DIMXxDIMYxDIMZ:TYPE, or a name like foot_256x256x256_uint8.raw"));
            }
        };
        let (spacing_mm, offset_bytes) = (self.flags.spacing, self.flags.offset.unwrap_or(0));
        Ok(RawFile { layout, spacing_mm, offset_bytes, sidecar })
    }

    /// The format that it is of; `None` where it has no first bytes to tell.
    fn format(&self) -> Option<&'static Format> {
        let head = if self.phantom().is_some() { Head::default() } else { Head::of(self.path()) };
        FORMATS.iter().find(|f| (f.sniff)(self, &head))
    }

    fn frame(&self) -> usize {
        self.flags.frame.unwrap_or(0)
    }

    fn zarr_choice(&self) -> zarr::Choice {
        let ReadFlags { level, spacing, .. } = self.flags;
        zarr::Choice { level, frame: self.frame(), spacing_mm: spacing }
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
    /// Whether an input is of this format: by flags, by its first bytes, by its name.
    sniff: fn(&VolumeSpec, &Head) -> bool,
    read: fn(&VolumeSpec, &Loading) -> Result<Read>,
    /// The files that an input consists of.
    files: fn(&VolumeSpec) -> Result<Vec<PathBuf>>,
}

/// The file of that name.
fn itself(spec: &VolumeSpec) -> Result<Vec<PathBuf>> {
    Ok(vec![spec.path().into()])
}

/// Every format, in the order in which they are tried; the last one takes whatever no other one does, and says why not.
pub const FORMATS: &[Format] = &[
    Format {
        kind: "a built-in volume",
        asked_as: "phantom:NAME[:SIZE]",
        endings: &[],
        flags: &["crop", "fit"],
        sniff: |spec, _| spec.phantom().is_some() && !spec.is_of_strands(),
        read: |spec, loading| {
            let (phantom, size) =
                Phantom::parse(spec.phantom().unwrap_or_default(), &StrandSet::ALL.map(StrandSet::name))?;
            phantom.build_with(size, loading).map(Read::from)
        },
        files: |_| Ok(Vec::new()),
    },
    Format {
        kind: "raw voxels",
        asked_as: "raw files with --raw DIMXxDIMYxDIMZ:TYPE (.raw, .raw.gz)",
        endings: &["raw", "gz"],
        flags: &["raw", "spacing", "offset", "crop", "fit"],
        sniff: |spec, head| {
            let raw = head.is_named(&["raw", "raw.gz"]);
            spec.layout().is_some() || raw && Sidecar::path_of(spec.path()).is_file()
        },
        read: |spec, loading| raw::read_with(spec.path(), &spec.raw_file()?, loading).map(Read::from),
        files: itself,
    },
    Format {
        kind: "a Zarr store",
        asked_as: "OME-Zarr (a folder, .zarr)",
        endings: zarr::EXTENSIONS,
        flags: &["frame", "level", "spacing", "crop", "fit"],
        sniff: |_, head| zarr::is_zarr(head),
        read: |spec, loading| zarr::read_with(spec.path(), spec.zarr_choice(), loading).map(Read::from),
        files: |spec| zarr::files_of(spec.path(), spec.zarr_choice()),
    },
    Format {
        kind: "a DICOM series",
        asked_as: "DICOM (a folder, or a file of it)",
        endings: dicom::EXTENSIONS,
        flags: &["series", "frame", "crop", "fit"],
        sniff: |_, head| dicom::is_dicom(head),
        read: |spec, loading| {
            dicom::read_with(spec.path(), spec.flags.series, spec.frame(), loading).map(Read::from)
        },
        files: |spec| dicom::files_of(spec.path(), spec.flags.series),
    },
    Format {
        kind: "NRRD",
        asked_as: "NRRD (.nrrd, .nhdr)",
        endings: nrrd::EXTENSIONS,
        flags: &["frame", "crop", "fit"],
        sniff: |_, head| nrrd::is_nrrd(head),
        read: |spec, loading| nrrd::read_with(spec.path(), spec.frame(), loading).map(Read::from),
        files: |spec| nrrd::files_of(spec.path()),
    },
    Format {
        kind: "a MetaImage",
        asked_as: "MetaImage (.mha, .mhd)",
        endings: metaimage::EXTENSIONS,
        flags: &["frame", "crop", "fit"],
        sniff: |_, head| metaimage::is_metaimage(head),
        read: |spec, loading| metaimage::read_with(spec.path(), spec.frame(), loading).map(Read::from),
        files: |spec| metaimage::files_of(spec.path()),
    },
    Format {
        kind: "a VTK image",
        asked_as: "VTK images (.vti)",
        endings: vti::EXTENSIONS,
        flags: &["crop", "fit"],
        sniff: |_, head| vti::is_vti(head),
        read: |spec, loading| vti::read_with(spec.path(), loading).map(Read::from),
        files: itself,
    },
    Format {
        kind: "a TIFF stack",
        asked_as: "TIFF (a file of pages, or a folder of files)",
        endings: tiff_stack::EXTENSIONS,
        flags: &["frame", "spacing", "crop", "fit"],
        sniff: |_, head| tiff_stack::is_tiff(head),
        read: |spec, loading| {
            tiff_stack::read_with(spec.path(), spec.frame(), spec.flags.spacing, loading).map(Read::from)
        },
        files: |spec| Ok(tiff_stack::files_of(spec.path())),
    },
    Format {
        kind: "a NumPy array",
        asked_as: "NumPy (.npy)",
        endings: npy::EXTENSIONS,
        flags: &["frame", "spacing", "crop", "fit"],
        sniff: |_, head| npy::is_npy(head),
        read: |spec, loading| {
            npy::read_with(spec.path(), spec.frame(), spec.flags.spacing, loading).map(Read::from)
        },
        files: itself,
    },
    Format {
        kind: "of strands",
        asked_as: "strands (.hair, .tck, .trk, .vtk, .vtp, .obj)",
        endings: STRAND_EXTENSIONS,
        flags: &["resolution", "kernel", "thickness"],
        sniff: |spec, _| spec.is_of_strands(),
        read: |spec, loading| {
            let strands = load_strands(&spec.source, spec.flags.strands.thickness, loading)?;
            let StrandVolume { volume, grid, kernel, .. } = spec.flags.strands.voxelise(&strands, loading)?;
            Ok(Read { volume, strands: Some(Arc::new(VoxelisedStrands::new(strands, grid, kernel))) })
        },
        files: |spec| Ok(if spec.phantom().is_some() { Vec::new() } else { vec![spec.path().into()] }),
    },
    Format {
        kind: "read as NIfTI",
        asked_as: "NIfTI and Analyze 7.5 (.nii, .nii.gz, .hdr with .img)",
        endings: &["nii", "gz", "hdr", "img"],
        flags: &["frame", "crop", "fit"],
        sniff: |_, _| true,
        read: |spec, loading| {
            let path = spec.path();
            let read = nifti::read_with(path, spec.frame(), loading).map_err(|e| {
                let unknown = e.hint.is_none() && path.exists() && !nifti::is_nifti(path);
                if unknown { e.hint(format!("accepted are {}", accepted())) } else { e }
            });
            read.map(Read::from)
        },
        files: |spec| Ok(nifti::files_of(spec.path())),
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
    let format = spec.format().unwrap_or(&FORMATS[FORMATS.len() - 1]);
    refuse_flags(spec, format)?;
    let room = spec.flags.fit.map(room_for);
    // Voxels that are cropped have to be there first.
    loading.reduce_to(room.filter(|_| spec.flags.crop.is_none()));
    let outcome = (format.read)(spec, loading).and_then(|read| {
        let volume = match spec.flags.crop {
            Some(crop) => read.volume.cropped(crop, loading)?,
            None => read.volume,
        };
        Ok(Read { volume: fitted(volume, room, loading)?, ..read })
    });
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
        // What is done to any volume once it was read.
        for format in FORMATS.iter().filter(|f| f.flags.contains(&"crop")) {
            assert!(format.flags.contains(&"fit"), "{}", format.kind);
        }
    }

    #[test]
    fn a_flag_of_another_format_is_refused_with_the_one_that_takes_it() {
        for (source, flag, other) in [
            ("a.nii", "--spacing=1,1,1", "raw files"),
            ("a.nii", "--kernel=tent", ".hair"),
            ("a.hair", "--offset=1", "raw files"),
            ("a.hair", "--frame=1", "OME-Zarr"),
            ("a.nii", "--series=2", "DICOM"),
            ("a.nii", "--level=1", "OME-Zarr"),
            ("a.hair", "--crop=,,1:", "phantom"),
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
