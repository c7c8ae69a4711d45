//! `umbravox voxelise`: converts strands (hair or fibres) to an extinction volume, with a report on its accuracy.

use super::console::{print_json, print_message, print_result};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::check_output;
use crate::formats::{NIFTI_EXTENSIONS, write_nifti};
use crate::measure::cylinders::{AgainstCylinders, MAX_BEAMS, against_cylinders};
use crate::open::{StrandFlags, is_strand_source, load_strands};
use crate::scene::Light;
use crate::strands::{Conservation, Kernel, STRAND_EXTENSIONS, StrandVolume, Strands};
use clap::Args;
use glam::DVec3;
use serde::Serialize;
use std::path::PathBuf;

/// Convert strands (hair or fibres) to an extinction volume, with a report on its accuracy
#[derive(Debug, Args)]
pub struct VoxeliseArgs {
    /// File of strands (.hair, .tck, .trk, .vtk, .vtp, .obj) or built-in strands, hair-NAME[:SEGMENTS]
    #[arg(value_name = "STRANDS")]
    pub strands: String,
    /// Output file of the extinction volume: .nii or .nii.gz [default: only the report]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub flags: StrandFlags,
    /// Number of light beams along which the transmittance of the volume is compared with that of the original
    /// strands, 0 to 100000
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = beams())]
    pub rays: u32,
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
}

fn beams() -> clap::builder::RangedU64ValueParser<u32> {
    clap::builder::RangedU64ValueParser::new().range(0..=MAX_BEAMS as u64)
}

/// Report on a voxelisation of strands. The fields are the keys of `voxelise --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    pub source: String,
    pub strands: u32,
    pub segments: usize,
    pub kernel: Kernel,
    pub dims: [usize; 3],
    pub spacing_mm: f64,
    /// Largest extinction in the volume, 1/mm.
    pub extinction_max: f64,
    #[serde(flatten)]
    pub conservation: Conservation,
    pub voxelise_ms: f64,
    pub segments_per_s: f64,
    /// Direction towards the light for which the transmittance of the volume is compared with that of the strands.
    pub light: [f64; 3],
    /// Difference in transmittance between the voxelised volume and the original strands, taken as cylinders; `null`
    /// without light beams or without segments.
    pub against_cylinders: Option<AgainstCylinders>,
}

/// Runs the `voxelise` command: converts strands to an extinction volume and prints a report.
///
/// # Errors
/// Bad input, or the disk is full.
pub fn run(args: &VoxeliseArgs) -> Result<()> {
    if let Some(output) = &args.output {
        check_output(output, NIFTI_EXTENSIONS)?;
    }
    let source = if args.strands.starts_with("hair-") && !is_strand_source(&args.strands) {
        format!("phantom:{}", args.strands)
    } else {
        args.strands.clone()
    };
    if !is_strand_source(&source) {
        return Err(Error::input(
            "cannot read strands",
            &source,
            "it is neither a file of strands nor a built-in set",
        )
        .hint(format!("files end in {}; built in are hair-NAME[:SEGMENTS]", STRAND_EXTENSIONS.join(", "))));
    }
    let strands = load_strands(&source, args.flags.thickness, &Loading::default())?;
    let made = args.flags.voxelise(&strands, &Loading::default())?;
    made.volume.provenance.warnings.iter().for_each(|warning| print_message("warning", warning));
    if let Some(output) = &args.output {
        write_nifti(&made.volume, output)?;
    }
    let report = Report::of(&strands, &made, args.rays as usize);
    if args.json { print_json(&report) } else { print_result(&report.to_text()) }
}

impl Report {
    /// Compares the voxelised volume with its strands on `beams` light beams towards the default light.
    pub fn of(strands: &Strands, made: &StrandVolume, beams: usize) -> Self {
        let (toward, _) = Light::default().from_point(DVec3::ZERO);
        Self {
            source: strands.source().into(),
            strands: strands.arrays().strands,
            segments: strands.segment_count(),
            kernel: made.kernel,
            dims: made.grid.dims,
            spacing_mm: made.grid.spacing_mm,
            extinction_max: made.volume.value_range()[1],
            conservation: made.conservation,
            voxelise_ms: made.voxelise_ms,
            segments_per_s: strands.segment_count() as f64 / (made.voxelise_ms * 1e-3),
            light: toward.to_array(),
            against_cylinders: against_cylinders(strands, &made.volume, toward, beams),
        }
    }

    /// Formats the report on a voxelisation as aligned text, one line per quantity.
    pub fn to_text(&self) -> String {
        let mut lines = Vec::new();
        let mut line = |name: &str, value: String| lines.push(format!("{name:<14} {value}\n"));
        let Conservation { area_mm2, area_inside_mm2, on_grid_mm2, relative_error } = self.conservation;
        let [nx, ny, nz] = self.dims;
        line("source", self.source.clone());
        line("strands", format!("{}, {} segments", self.strands, self.segments));
        line("grid", format!("{nx} x {ny} x {nz} voxels of {:.6} mm", self.spacing_mm));
        let kernel = match self.kernel {
            Kernel::Box => "box",
            Kernel::Tent => "tent",
        };
        line("kernel", kernel.into());
        line("time", format!("{:.1} ms, {:.3e} segments/s", self.voxelise_ms, self.segments_per_s));
        line("area", format!("{area_mm2:.9e} mm^2: sum of (1 - transparency) diameter length"));
        line("inside", format!("{area_inside_mm2:.9e} mm^2"));
        line("on the grid", format!("{on_grid_mm2:.9e} mm^2: sum of extinction times voxel volume"));
        line("conservation", format!("{relative_error:.2e} relative error"));
        line("extinction", format!("at most {:.6} per mm", self.extinction_max));
        if let Some(a) = &self.against_cylinders {
            let [x, y, z] = self.light;
            let light = format!("dir:{x:.4},{y:.4},{z:.4}");
            line("cylinders", format!("{} beams of {} rays towards {light}", a.beams, a.rays_per_beam));
            line("", format!("mean transmittance of the strands {:.4}", a.true_mean));
            let difference = format!("mean {:+.4}, rms {:.4}, max {:.4}", a.mean, a.rms, a.max);
            line("", format!("voxelised - strands: {difference} (sampling {:.4})", a.sampling_rms));
        }
        lines.concat()
    }
}
