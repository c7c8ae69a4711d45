//! Registry of the volume file formats, and reading of volumes with it. A new format needs only one entry in
//! [`FORMATS`]: error messages, help and the file dialog use that list.

use super::downsample::{downsampled, room_for};
use super::layer::layer;
use super::strands::{StrandFlags, is_strand_source, load_strands};
use super::values;
use crate::error::{Error, Result};
use crate::files::hash::sha256_of_files;
use crate::files::loading::{HostLimit, Loading};
use crate::formats::raw::RawFile;
use crate::formats::{Head, Sidecar, dicom, metaimage, npy, nrrd, tiff_stack, vti, zarr};
use crate::formats::{RawLayout, nifti, raw};
use crate::phantom::Phantom;
use crate::scene::Shading;
use crate::strands::{STRAND_EXTENSIONS, StrandSet, StrandVolume, VoxelisedStrands};
use crate::volume::{ByteCount, Crop, Downsample, Volume};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

layer! {
/// Command-line flags for reading a volume; a flag that is not given is `None`.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct ReadFlags {
    /// Raw voxels: DIMXxDIMYxDIMZ:TYPE, TYPE one of u8 i8 u16 i16 u32 i32 f32 f64, then :be for big-endian [default: from a name like foot_256x256x256_uint8.raw]
    #[arg(long, value_name = "LAYOUT", help_heading = "Volume")]
    pub raw: Option<RawLayout>,
    /// Voxel spacing of a raw, .npy, TIFF or Zarr file, mm, also in place of its own; other formats refuse it
    /// [default: the file's, or 1,1,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::spacing_mm, allow_hyphen_values = true, help_heading = "Volume")]
    pub spacing: Option<[f64; 3]>,
    /// Bytes before the first voxel of a raw file [default: 0]
    #[arg(long, value_name = "BYTES", allow_hyphen_values = true, help_heading = "Volume")]
    pub offset: Option<u64>,
    /// DICOM series of a folder that holds several, from 1 in the order of their series numbers
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub series: Option<usize>,
    /// Volume (time frame) of a 4-D file, from 0 [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub frame: Option<usize>,
    /// Resolution level of a multi-resolution image, from 0, the finest [default: the finest that fits memory and a
    /// texture]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub level: Option<usize>,
    /// Read only these voxels, x0:x1,y0:y1,z0:z1 by index from 0, both ends included; parts may be empty [default:
    /// all]
    #[arg(long, value_name = "RANGES", allow_hyphen_values = true, help_heading = "Volume")]
    pub crop: Option<Crop>,
    /// Average blocks of voxels: of 2x2x1 voxels (=2x2x1); or the smallest blocks that leave at most so many bytes of voxels
    /// (=2GiB), or as many as the adapter's textures and free memory hold (=auto, or no value) [default: all voxels]
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "auto", help_heading = "Volume")]
    pub downsample: Option<Downsample>,
    /// Host memory for voxels: read larger volumes in parts [default: all]
    #[arg(id = "host-memory", long, value_name = "BYTES", help_heading = "Volume")]
    #[serde(rename = "host-memory")]
    pub host_memory: Option<ByteCount>,
    /// Folder for decompressed files beyond host memory [default: none]
    #[arg(long, value_name = "FOLDER", help_heading = "Volume")]
    pub scratch: Option<String>,
    /// Command-line flags for voxelising strands.
    #[command(flatten)]
    #[serde(flatten)]
    pub strands: StrandFlags,
}
}

/// Specification of a volume that can be read: its path or built-in name, with the flags for reading it.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeSpec {
    /// Source of the volume: a path, or `phantom:NAME[:SIZE]` for a built-in volume. A file of
    /// [`crate::strands::STRAND_FORMATS`] and `phantom:hair-NAME[:SEGMENTS]` are strands.
    pub source: String,
    /// Command-line flags for reading the volume.
    pub flags: ReadFlags,
}

impl VolumeSpec {
    /// Specifies a volume by its path or `phantom:NAME[:SIZE]`, without flags.
    pub fn new(source: impl Into<String>) -> Self {
        Self { source: source.into(), flags: ReadFlags::default() }
    }

    fn path(&self) -> &Path {
        Path::new(&self.source)
    }

    /// Computes the SHA-256 of the volume's file, or of its concatenated files; `None` for a built-in volume.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn sha256(&self) -> Result<Option<String>> {
        if self.phantom().is_some() {
            return Ok(None);
        }
        let files = (self.format().files)(self)?;
        sha256_of_files(files.iter().map(PathBuf::as_path)).map(Some)
    }

    /// Name of the built-in volume, the text after `phantom:`; `None` if the volume is a file.
    fn phantom(&self) -> Option<&str> {
        self.source.strip_prefix("phantom:")
    }

    /// Layout of a raw volume file; `--raw` wins over the layout in the file's name.
    fn layout(&self) -> Option<RawLayout> {
        let of_name = || RawLayout::from_file_name(self.path());
        self.phantom().is_none().then(|| self.flags.raw.or_else(of_name)).flatten()
    }

    /// Describes a raw volume file. Its layout comes from `--raw`, else from a text header beside the file, else from
    /// the file's name.
    fn raw_file(&self) -> Result<RawFile> {
        let sidecar = if self.flags.raw.is_none() { Sidecar::beside(self.path())? } else { None };
        let layout = match (&sidecar, self.layout()) {
            (Some(sidecar), _) => sidecar.raw_layout()?,
            (None, Some(layout)) => layout,
            (None, None) => {
                return Err(Error::input("cannot read raw volume", &self.source, "nothing says its layout")
                    .hint("--raw DIMXxDIMYxDIMZ:TYPE, or a name like foot_256x256x256_uint8.raw"));
            }
        };
        let (spacing_mm, offset_bytes) = (self.flags.spacing, self.flags.offset.unwrap_or(0));
        Ok(RawFile { layout, spacing_mm, offset_bytes, sidecar })
    }

    fn format(&self) -> &'static Format {
        let head = if self.phantom().is_some() { Head::default() } else { Head::of(self.path()) };
        // The last format accepts everything.
        FORMATS.iter().find(|f| (f.sniff)(self, &head)).unwrap_or(&FORMATS[FORMATS.len() - 1])
    }

    fn frame(&self) -> usize {
        self.flags.frame.unwrap_or(0)
    }

    fn zarr_choice(&self) -> zarr::Choice {
        let ReadFlags { level, spacing, .. } = self.flags;
        let is_out_of_core = self.flags.host_memory.is_some();
        zarr::Choice { level, frame: self.frame(), is_out_of_core, spacing_mm: spacing }
    }

    /// Whether the volume is made from strands, by voxelising them.
    fn is_of_strands(&self) -> bool {
        self.layout().is_none() && is_strand_source(&self.source)
    }

    /// Returns an error if the shading model does not fit the volume: `kajiya-kay` needs a volume made from strands.
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
    fn default() -> Self {
        Self::new(format!("phantom:{}", Phantom::default()))
    }
}

/// Result of reading a volume: the volume, and the strands that it was made from, if any.
#[derive(Debug)]
pub struct Read {
    /// Volume that was read from a file, built, or voxelised from strands.
    pub volume: Volume,
    /// Strands that the volume was voxelised from, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
}

impl From<Volume> for Read {
    fn from(volume: Volume) -> Self {
        Self { volume, strands: None }
    }
}

/// File format of volumes: its description, flags and reader.
#[derive(Debug)]
pub struct Format {
    /// Noun phrase for inputs of this volume format, for error messages such as `SOURCE is a Zarr store`.
    pub kind: &'static str,
    /// Short text for hints and help that tells how to specify a volume of this format, with its file extensions.
    pub usage: &'static str,
    /// File extensions of the volume format for the file dialog. Of a double extension such as `.nii.gz` it lists
    /// only the last part.
    pub endings: &'static [&'static str],
    /// Names of the command-line flags for reading ([`ReadFlags`]) that apply to this volume format.
    pub flags: &'static [&'static str],
    /// Detects whether a volume has this file format, from the flags for reading, the file's first bytes and its
    /// name.
    sniff: fn(&VolumeSpec, &Head) -> bool,
    read: fn(&VolumeSpec, &Loading) -> Result<Read>,
    /// Lists the files that make up a volume of this format.
    files: fn(&VolumeSpec) -> Result<Vec<PathBuf>>,
}

fn itself(spec: &VolumeSpec) -> Result<Vec<PathBuf>> {
    Ok(vec![spec.path().into()])
}

/// List of all volume file formats in the order of detection. The last one accepts every input, and its error message
/// lists all formats.
pub const FORMATS: &[Format] = &[
    Format {
        kind: "a built-in volume",
        usage: "phantom:NAME[:SIZE]",
        endings: &[],
        flags: &["crop", "downsample", "host-memory"],
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
        usage: "raw files with --raw DIMXxDIMYxDIMZ:TYPE (.raw, .raw.gz)",
        endings: &["raw", "gz"],
        flags: &["raw", "spacing", "offset", "crop", "downsample", "host-memory", "scratch"],
        sniff: |spec, head| {
            let raw = head.is_named(&["raw", "raw.gz"]);
            spec.layout().is_some() || raw && Sidecar::path_of(spec.path()).is_file()
        },
        read: |spec, loading| raw::read_with(spec.path(), &spec.raw_file()?, loading).map(Read::from),
        files: itself,
    },
    Format {
        kind: "a Zarr store",
        usage: "OME-Zarr (a folder, .zarr)",
        endings: zarr::EXTENSIONS,
        flags: &["frame", "level", "spacing", "crop", "downsample", "host-memory"],
        sniff: |_, head| zarr::is_zarr(head),
        read: |spec, loading| zarr::read_with(spec.path(), spec.zarr_choice(), loading).map(Read::from),
        files: |spec| zarr::files_of(spec.path(), spec.zarr_choice()),
    },
    Format {
        kind: "a DICOM series",
        usage: "DICOM (a folder, or a file of it)",
        endings: dicom::EXTENSIONS,
        flags: &["series", "frame", "crop", "downsample"],
        sniff: |_, head| dicom::is_dicom(head),
        read: |spec, loading| {
            dicom::read_with(spec.path(), spec.flags.series, spec.frame(), loading).map(Read::from)
        },
        files: |spec| dicom::files_of(spec.path(), spec.flags.series),
    },
    Format {
        kind: "NRRD",
        usage: "NRRD (.nrrd, .nhdr)",
        endings: nrrd::EXTENSIONS,
        flags: &["frame", "crop", "downsample", "host-memory", "scratch"],
        sniff: |_, head| nrrd::is_nrrd(head),
        read: |spec, loading| nrrd::read_with(spec.path(), spec.frame(), loading).map(Read::from),
        files: |spec| nrrd::files_of(spec.path()),
    },
    Format {
        kind: "a MetaImage",
        usage: "MetaImage (.mha, .mhd)",
        endings: metaimage::EXTENSIONS,
        flags: &["frame", "crop", "downsample", "host-memory", "scratch"],
        sniff: |_, head| metaimage::is_metaimage(head),
        read: |spec, loading| metaimage::read_with(spec.path(), spec.frame(), loading).map(Read::from),
        files: |spec| metaimage::files_of(spec.path()),
    },
    Format {
        kind: "a VTK image",
        usage: "VTK images (.vti)",
        endings: vti::EXTENSIONS,
        flags: &["crop", "downsample"],
        sniff: |_, head| vti::is_vti(head),
        read: |spec, loading| vti::read_with(spec.path(), loading).map(Read::from),
        files: itself,
    },
    Format {
        kind: "a TIFF stack",
        usage: "TIFF (a file of pages, or a folder of files)",
        endings: tiff_stack::EXTENSIONS,
        flags: &["frame", "spacing", "crop", "downsample"],
        sniff: |_, head| tiff_stack::is_tiff(head),
        read: |spec, loading| {
            tiff_stack::read_with(spec.path(), spec.frame(), spec.flags.spacing, loading).map(Read::from)
        },
        files: |spec| Ok(tiff_stack::files_of(spec.path())),
    },
    Format {
        kind: "a NumPy array",
        usage: "NumPy (.npy)",
        endings: npy::EXTENSIONS,
        flags: &["frame", "spacing", "crop", "downsample", "host-memory", "scratch"],
        sniff: |_, head| npy::is_npy(head),
        read: |spec, loading| {
            npy::read_with(spec.path(), spec.frame(), spec.flags.spacing, loading).map(Read::from)
        },
        files: itself,
    },
    Format {
        kind: "of strands",
        usage: "strands (.hair, .tck, .trk, .vtk, .vtp, .obj)",
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
        usage: "NIfTI and Analyze 7.5 (.nii, .nii.gz, .hdr with .img)",
        endings: &["nii", "gz", "hdr", "img"],
        flags: &["frame", "crop", "downsample", "host-memory", "scratch"],
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

/// Lists in one line how to specify a volume of each file format.
pub fn accepted() -> String {
    FORMATS.iter().map(|f| f.usage).collect::<Vec<_>>().join(", ")
}

/// Reads a volume from a file, or builds a built-in one.
///
/// # Errors
/// See [`VolumeSpec::read`].
pub fn load(spec: &VolumeSpec) -> Result<Volume> {
    spec.read(&Loading::default()).map(|read| read.volume)
}

impl VolumeSpec {
    /// Reads the volume, and the strands that it was made from, if any. `loading` shows progress and can cancel the
    /// reading.
    ///
    /// # Errors
    /// A file that cannot be read, a flag of another format, or cancellation.
    pub fn read(&self, loading: &Loading) -> Result<Read> {
        loading.go_on(&self.source)?;
        let format = self.format();
        self.check_flags(format)?;
        let bytes = self.flags.host_memory.map(|limit| limit.0);
        loading.limit_host(HostLimit { bytes, scratch: self.flags.scratch.as_ref().map(PathBuf::from) });
        let room = self.flags.downsample.map(room_for);
        // Cropping needs all voxels: they are reduced afterwards.
        loading.reduce_to(room.filter(|_| self.flags.crop.is_none()));
        let outcome = (format.read)(self, loading).and_then(|read| {
            let volume = match self.flags.crop {
                Some(crop) => read.volume.cropped(crop, loading)?,
                None => read.volume,
            };
            Ok(Read { volume: downsampled(volume, room, loading)?, ..read })
        });
        // Cancellation is the cause of any other failure.
        loading.go_on(&self.source)?;
        outcome
    }

    /// Returns an error for a given command-line flag that does not apply to this volume format.
    fn check_flags(&self, format: &Format) -> Result<()> {
        // Every format has a first frame.
        let flags = ReadFlags { frame: self.flags.frame.filter(|frame| *frame > 0), ..self.flags.clone() };
        let given = toml::Table::try_from(flags).unwrap_or_default();
        let Some(flag) = given.keys().find(|flag| !format.flags.contains(&flag.as_str())) else {
            return Ok(());
        };
        let other = FORMATS.iter().find(|f| f.flags.contains(&flag.as_str())).map_or("nothing", |f| f.usage);
        let why = format!("{} is {}, and this flag is for {other}", self.source, format.kind);
        Err(Error::input("cannot use flag", format!("--{flag}"), why))
    }
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
        // Crop and downsample apply to any volume once it was read.
        for format in FORMATS.iter().filter(|f| f.flags.contains(&"crop")) {
            assert!(format.flags.contains(&"downsample"), "{}", format.kind);
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
    fn unknown_formats_are_refused_with_the_list() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.dat");
        for bytes in [&b""[..], b"no volume at all"] {
            std::fs::write(&path, bytes).unwrap();
            let hint = load(&VolumeSpec::new(path.to_string_lossy())).unwrap_err().hint.unwrap();
            assert!(FORMATS.iter().all(|f| hint.contains(f.usage)) && hint.contains(".hair"), "{hint}");
        }
        assert!(load(&VolumeSpec::new("gone.nii")).unwrap_err().hint.is_none());
    }
}
