//! `umbravox info`: properties of a volume.

use super::console::print_properties;
use crate::error::Result;
use crate::open::units::{Meaning, Units, ValueKind};
use crate::open::{ReadFlags, VolumeSpec, load};
use crate::volume::{Bricks, Provenance, Scaling, Volume, Voxels};
use clap::Args;
use glam::{DMat4, DVec3};
use serde::Serialize;

/// Print the properties of a volume file
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// A volume (NIfTI, DICOM folder, NRRD, MetaImage, OME-Zarr, TIFF, .vti, .npy, raw), strands (.hair, .tck, .trk, .vtk,
    /// .vtp, .obj) or a built-in one, phantom:NAME[:SIZE]
    #[arg(value_name = "VOLUME")]
    pub volume: String,
    #[command(flatten)]
    pub volume_flags: ReadFlags,
    /// Interpret values as HU or as fractions of their range [default: as the file or the values suggest]
    #[arg(long, value_enum, value_name = "UNITS")]
    pub units: Option<Units>,
    /// Print the result as JSON instead of TOML
    #[arg(long)]
    pub json: bool,
}

/// Properties of a volume; the keys of `info`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    #[serde(flatten)]
    pub provenance: Provenance,
    /// Voxels along the index axes.
    pub dims: [usize; 3],
    /// Element type in memory.
    pub memory_type: &'static str,
    /// World mm (RAS+) from index coordinates, row by row.
    pub affine: [[f64; 4]; 4],
    pub spacing_mm: [f64; 3],
    /// Lengths of the domain `[-0.5, n - 0.5]^3` along the index axes.
    pub size_mm: [f64; 3],
    /// World coordinates of the domain's bounding box: smallest and largest corner.
    pub bounds_mm: [[f64; 3]; 2],
    /// Smallest and largest value after scaling.
    pub value_range: [f64; 2],
    /// Interpretation of the values: `HU`, `1/mm` or `fraction`.
    pub units: ValueKind,
    /// Reason for the interpretation.
    pub units_why: String,
    /// Whether the interpretation was guessed from the values alone.
    pub units_guessed: bool,
    pub stored_range: [f64; 2],
    pub scaling: Scaling,
    /// Whether the scaling changes anything.
    pub scaled: bool,
    /// Bricks along the index axes, and in all.
    pub brick_counts: [usize; 3],
    pub bricks: usize,
    pub memory_bytes: u64,
}

impl Info {
    /// Properties of a volume.
    pub fn of(volume: &Volume, units: Option<Units>) -> Self {
        let meaning = Meaning::of(volume, units);
        let dims = volume.dims();
        let spacing_mm = volume.spacing_mm();
        let corners = volume.corners_mm();
        let brick_counts = Bricks::counts_for(dims);
        Self {
            provenance: volume.provenance.clone(),
            dims,
            memory_type: match volume.voxels() {
                Voxels::U8(_) => "uint8",
                Voxels::I16(_) => "int16",
                Voxels::U16(_) => "uint16",
                Voxels::F32(_) => "float32",
                Voxels::F64(_) => "float64",
            },
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
            stored_range: volume.stored_range(),
            scaling: volume.scaling(),
            scaled: volume.scaling() != Scaling::IDENTITY,
            brick_counts,
            bricks: brick_counts.iter().product(),
            memory_bytes: volume.bytes(),
        }
    }
}

/// Reads a volume and prints what was read to stdout.
///
/// # Errors
/// The volume cannot be read, or stdout cannot be written to.
pub fn run(args: &InfoArgs) -> Result<()> {
    let volume = load(&VolumeSpec { source: args.volume.clone(), flags: args.volume_flags })?;
    print_properties(&Info::of(&volume, args.units), args.json)
}
