//! `umbravox info`: prints the properties of a volume.

use super::console::{print_json, print_message, print_result};
use super::info_strands::StrandInfo;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::formats::{Head, dicom};
use crate::open::units::{Meaning, Units, ValueKind};
use crate::open::{ReadFlags, VolumeSpec, is_strand_source, likely_labels, load, load_any_strands};
use crate::report::number::trimmed;
use crate::volume::{AffineSource, Bricks, Provenance, Scaling, Volume};
use bytesize::ByteSize;
use clap::Args;
use glam::{DMat4, DVec3};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// Print the properties of volume files, or list the series of a DICOM folder
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// Volumes (NIfTI, DICOM folder, NRRD, MetaImage, OME-Zarr, TIFF, .vti, .npy, raw), strands (.hair, .tck, .trk,
    /// .vtk, .vtp, .obj) or built-in volumes phantom:NAME[:SIZE]
    #[arg(value_name = "VOLUME", required = true)]
    pub volumes: Vec<String>,
    #[command(flatten)]
    pub volume_flags: ReadFlags,
    /// Interpret voxel values as HU or as fractions of their range [default: as the file or the values suggest]
    #[arg(long, value_enum, value_name = "UNITS")]
    pub units: Option<Units>,
    /// Print the properties as JSON: an object, or an array of objects for several volumes
    #[arg(long)]
    pub json: bool,
}

/// Properties of a volume, as `umbravox info` prints them. The fields are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    #[serde(flatten)]
    pub provenance: Provenance,
    /// Number of voxels along each index axis of the volume.
    pub dims: [usize; 3],
    /// Type of the voxel values in memory, such as `int16`.
    pub memory_type: &'static str,
    /// Affine matrix from voxel indices to world mm (RAS+), in row-major order.
    pub affine: [[f64; 4]; 4],
    pub spacing_mm: [f64; 3],
    /// Size of the volume along its index axes, mm: side lengths of the domain `[-0.5, n - 0.5]^3`.
    pub size_mm: [f64; 3],
    /// Bounding box of the volume in world mm: smallest and largest corner.
    pub bounds_mm: [[f64; 3]; 2],
    /// Smallest and largest voxel value after scaling by slope and intercept.
    pub value_range: [f64; 2],
    /// Interpretation of the voxel values: `HU`, `1/mm` or `fraction`.
    pub units: ValueKind,
    /// Reason why the voxel values are interpreted in these units.
    pub units_why: String,
    /// Whether the units of the voxel values were guessed from the values alone.
    pub units_guessed: bool,
    /// Reason why the volume is probably a segmentation, such as named segments; `None` for an image.
    pub labels_why: Option<String>,
    pub stored_range: [f64; 2],
    pub scaling: Scaling,
    /// Whether the scaling from stored to physical voxel values differs from the identity.
    pub scaled: bool,
    /// Number of bricks (blocks of voxels) along each index axis. The field `bricks` is their total number.
    pub brick_counts: [usize; 3],
    pub bricks: usize,
    pub memory_bytes: u64,
}

impl Info {
    /// Collects the properties of a volume. `units` overrides the interpretation of its voxel values.
    pub fn of(volume: &Volume, units: Option<Units>) -> Self {
        let meaning = Meaning::of(volume, units);
        let dims = volume.dims();
        let spacing_mm = volume.spacing_mm();
        let corners = volume.corners_mm();
        let brick_counts = Bricks::counts_for(dims);
        Self {
            provenance: volume.provenance.clone(),
            dims,
            memory_type: volume.element().name(),
            affine: DMat4::from(volume.world_from_index()).transpose().to_cols_array_2d(),
            spacing_mm,
            size_mm: std::array::from_fn(|axis| dims[axis] as f64 * spacing_mm[axis]),
            bounds_mm: [
                corners.into_iter().reduce(DVec3::min).unwrap_or_default().to_array(),
                corners.into_iter().reduce(DVec3::max).unwrap_or_default().to_array(),
            ],
            value_range: volume.value_range(),
            units: meaning.kind,
            units_why: meaning.why,
            units_guessed: meaning.is_guess,
            labels_why: likely_labels(volume),
            stored_range: volume.stored_range(),
            scaling: volume.scaling(),
            scaled: volume.scaling() != Scaling::IDENTITY,
            brick_counts,
            bricks: brick_counts.iter().product(),
            memory_bytes: volume.bytes(),
        }
    }

    /// Formats the properties of a volume as aligned text, one line per property.
    pub fn to_text(&self) -> String {
        let times = |values: [String; 3]| values.join(" x ");
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name:<12} {value}");
        };
        line("source", self.provenance.source.clone());
        line("format", self.provenance.format.clone());
        line("type", format!("{} ({} in memory)", self.provenance.stored_type, self.memory_type));
        line("dimensions", format!("{} voxels", times(self.dims.map(|n| n.to_string()))));
        line("spacing", format!("{} mm", times(self.spacing_mm.map(number))));
        line("size", format!("{} mm", times(self.size_mm.map(number))));
        let form = match self.provenance.affine_source {
            AffineSource::Sform => "sform",
            AffineSource::Qform => "qform",
            AffineSource::Axes => "directions and origin",
            AffineSource::Spacing => "voxel sizes",
        };
        for (row, values) in self.affine[..3].iter().enumerate() {
            let name = if row == 0 { "affine" } else { "" };
            let cells: Vec<String> = values.iter().map(|v| format!("{:>12}", number(*v))).collect();
            let from = if row == 0 { format!("   from {form}") } else { String::new() };
            line(name, format!("{}{from}", cells.concat()));
        }
        let [low, high] = self.bounds_mm.map(|corner| corner.map(number).join(", "));
        line("world box", format!("({low}) to ({high}) mm"));
        let [low, high] = self.value_range.map(number);
        line("values", format!("{low} to {high}"));
        let guessed = if self.units_guessed { "; guessed from the values, --units decides" } else { "" };
        line("taken as", format!("{} ({}{guessed})", self.units.name(), self.units_why));
        if let Some(why) = &self.labels_why {
            line("labels", format!("probably a segmentation ({why}); --labels gives an image its labels"));
        }
        let Scaling { slope, intercept } = self.scaling;
        line("scaling", format!("stored x {} + {}", number(slope), number(intercept)));
        line("non-finite", format!("{} voxels", self.provenance.non_finite));
        line("frame", format!("{} of {} (counted from 0)", self.provenance.frame, self.provenance.frames));
        for (i, segment) in self.provenance.segments.iter().enumerate() {
            line(if i == 0 { "segments" } else { "" }, format!("{} {}", segment.label, segment.name));
        }
        line("bricks", format!("{} ({})", times(self.brick_counts.map(|n| n.to_string())), self.bricks));
        line("memory", ByteSize::b(self.memory_bytes).display().iec().to_string());
        for warning in &self.provenance.warnings {
            line("warning", warning.clone());
        }
        text
    }
}

/// Formats a number with six significant digits or all digits of its integer part, without trailing zeros.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-4..1e7).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    let decimals = if magnitude < 1.0 { 6 } else { 5 - magnitude.log10().floor().min(5.0) as usize };
    let text = format!("{value:.decimals$}");
    let text = trimmed(&text);
    if text == "-0" { "0".into() } else { text }
}

/// Properties of an input of `umbravox info`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum Described {
    Volume(Box<Info>),
    /// Strands, and the volume made of them if they have a thickness.
    Strands {
        #[serde(flatten)]
        strands: StrandInfo,
        #[serde(flatten)]
        volume: Option<Box<Info>>,
        #[serde(skip_serializing_if = "Option::is_none")]
        source: Option<String>,
    },
    /// Folder of several DICOM series.
    Series {
        source: String,
        format: &'static str,
        series: Vec<String>,
    },
}

impl Described {
    /// Reads an input and collects its properties.
    fn read(source: &str, args: &InfoArgs) -> Result<Self> {
        let spec = VolumeSpec { source: source.to_owned(), flags: args.volume_flags.clone() };
        let info = || load(&spec).map(|volume| Box::new(Info::of(&volume, args.units)));
        // A raw volume may have any name.
        if is_strand_source(source) && args.volume_flags.raw.is_none() {
            let thickness = args.volume_flags.strands.thickness;
            let strands = StrandInfo::of(&load_any_strands(source, thickness, &Loading::default())?);
            let volume = strands.thickness_mm.map(|_| info()).transpose()?;
            let source = volume.is_none().then(|| source.to_owned());
            return Ok(Self::Strands { strands, volume, source });
        }
        info().map(Self::Volume).or_else(|error| {
            let lists = args.volume_flags.series.is_none() && Path::new(source).is_dir();
            let series = if lists && dicom::is_dicom(&Head::of(Path::new(source))) {
                dicom::series_of(Path::new(source))?
            } else {
                Vec::new()
            };
            match series.len() {
                0 | 1 => Err(error),
                _ => Ok(Self::Series { source: source.to_owned(), format: "dicom", series }),
            }
        })
    }

    /// Formats the properties as aligned text.
    fn to_text(&self) -> String {
        match self {
            Self::Volume(info) => info.to_text(),
            Self::Strands { strands, volume, source } => {
                let source = source.iter().map(|source| format!("{:<12} {source}\n", "source"));
                let volume = volume.iter().map(|info| info.to_text());
                source.chain(volume).collect::<String>() + &strands.to_text(number)
            }
            Self::Series { source, series, .. } => {
                let lines = series
                    .iter()
                    .enumerate()
                    .map(|(i, summary)| format!("--series {:<3} {summary}\n", i + 1));
                format!("{:<12} {source}\n{:<12} dicom, {} series\n", "source", "format", series.len())
                    + &lines.collect::<String>()
            }
        }
    }
}

/// Runs the `info` command: reads each volume and prints its properties to stdout. A volume that cannot be read does
/// not keep the others from being printed.
///
/// # Errors
/// A volume cannot be read, or stdout cannot be written to.
pub fn run(args: &InfoArgs) -> Result<()> {
    let (mut described, mut failed) = (Vec::new(), None::<Error>);
    for source in &args.volumes {
        match Described::read(source, args) {
            Ok(of_source) if args.json => described.push(of_source),
            Ok(of_source) => {
                let gap = if described.is_empty() { "" } else { "\n" };
                print_result(&format_args!("{gap}{}", of_source.to_text()))?;
                described.push(of_source);
            }
            Err(error) => {
                // The caller prints the last error.
                failed.iter().for_each(|earlier| print_message("error", earlier));
                failed = Some(error);
            }
        }
    }
    match &described[..] {
        [only] if args.json && args.volumes.len() == 1 => print_json(only)?,
        all if args.json && args.volumes.len() > 1 => print_json(&all)?,
        _ => {}
    }
    failed.map_or(Ok(()), Err)
}
