//! `umbravox probe`: prints exact optical depths of segments, transmittance at points by a shadow method, or
//! transmittance curves along a light ray, or writes slices of a shadow map.

use super::console::{load_scene, open_session, print_message, print_result};
use super::probe_curve::{self, CurveFlags};
use super::probe_points::parse_points;
use super::probe_rays::probe_rays;
use super::probe_slices;
use crate::error::Result;
use crate::exact::ExactField;
use crate::files::input::read_text;
use crate::measure::errors::mean_of_maps;
use crate::open::{Loaded, SceneArgs, SceneRequest, values};
use crate::shadow::mapped_lights;
use clap::Args;
use glam::DVec3;
use std::io::{self, IsTerminal};
use std::path::PathBuf;

/// Print the exact optical depth of segments, a shadow method's transmittance at points, or transmittance curves
/// along a light ray; or write slices of a shadow map as pictures
#[derive(Debug, Args)]
pub struct ProbeArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub what: What,
    #[command(flatten)]
    pub curve_flags: CurveFlags,
    /// Print the column names of --rays or --points in a first line that begins with `#`; always done on a terminal
    #[arg(long, conflicts_with_all = ["curve", "map_slices"])]
    pub header: bool,
}

/// Returns the line of column names for the output of `probe` if `--header` requests it, or an empty text.
fn header(requested: bool, columns: &str) -> String {
    if requested || io::stdout().is_terminal() { format!("# {columns}\n") } else { String::new() }
}

/// Flags that select the output of `probe`: exactly one of optical depths of segments, transmittance at points, a
/// transmittance curve, or slices of a shadow map.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct What {
    /// File of segments (`-`: standard input), `x0 y0 z0 x1 y1 z1` per line, world mm; prints the exact `optical_depth transmittance` of
    /// each, 17 digits
    #[arg(long, value_name = "FILE")]
    pub rays: Option<PathBuf>,
    /// File of points (`-`: standard input), `x y z` per line, world mm, or .mrk.json, .fcsv of 3D Slicer; prints
    /// `T_method T_exact`: transmittance from the light, by the --shadow method and exact; with `enclose=on` also `L
    /// U`, bounds on `T_exact`
    #[arg(long, value_name = "FILE")]
    pub points: Option<PathBuf>,
    /// Point, world mm: prints transmittance against depth along the light ray through it, by --methods and exact, as
    /// CSV and plot; depth starts where the ray enters the volume, or at a light inside it
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true)]
    pub curve: Option<DVec3>,
    /// Number of depths: writes the transmittance at the texel centres of the --shadow method's map at each depth, and the
    /// exact one, as grey pictures seen from the light: `NAME_0000.png` and `NAME_0000_exact.png` for `--output NAME.png`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256), requires = "output")]
    pub map_slices: Option<u32>,
}

/// Runs the `probe` command: prints exact transmittances, and those of shadow methods.
///
/// # Errors
/// Bad input, or a failure of the device.
pub fn run(args: ProbeArgs) -> Result<()> {
    let SceneRequest { settings, run } = args.scene.into_request()?;
    settings.one_light("probe")?;
    if let Some(point_mm) = args.what.curve {
        settings.hard_lights("probe --curve")?;
        return probe_curve::run(&settings, &run, point_mm, &args.curve_flags);
    }
    if let (Some(count), Some(output)) = (args.what.map_slices, &args.curve_flags.output) {
        settings.hard_lights("probe --map-slices")?;
        return probe_slices::run(&settings, &run, count, output);
    }
    // Small files are checked before the volume is read.
    if let Some(path) = &args.what.rays {
        let text = read_text(path, "cannot read rays")?;
        let loaded = load_scene(&settings)?;
        let field = ExactField::new(&loaded.volume, &loaded.tf);
        let answers = probe_rays(&field, &text, &path.display().to_string())?;
        loaded.volume.check_reads()?;
        print_result(&(header(args.header, "optical_depth transmittance") + &answers))?;
    }
    if let Some(path) = &args.what.points {
        let method = settings.method()?;
        let points = parse_points(&read_text(path, "cannot read points")?, &path.display().to_string())?;
        let Loaded { volume, strands, tf, scene, .. } = load_scene(&settings)?;
        let source = scene.lights.first().cloned().unwrap_or_default();
        let (exact, standard_error) = ExactField::new(&volume, &tf).transmittances_from(&points, &source);
        volume.check_reads()?;
        if source.is_soft() {
            let about = "T_exact is a mean over the light, with a standard error of";
            print_message(
                "note",
                &format_args!("{about} {standard_error:.1e} (root mean square over the points)"),
            );
        }
        let session = open_session(&run, &settings, (volume, strands), &tf)?;
        let lights = mapped_lights(method.as_ref(), &scene.under(source.clone())).into_iter();
        let shadows =
            lights.map(|light| session.shadow(method.as_ref(), light)).collect::<Result<Vec<_>>>()?;
        let found = mean_of_maps(&shadows, &points, |map, points| session.query(map, points))?;
        let enclosure = shadows.first().filter(|_| !source.is_soft()).and_then(|map| map.enclosure.as_ref());
        let enclosed = enclosure.map(|e| e.query(&session, &points)).transpose()?;
        let line = |(i, (m, e)): (usize, (&f64, &f64))| match &enclosed {
            Some(all) => format!("{m:.9} {e:.17} {:.9} {:.9}\n", all[i][0], all[i][1]),
            None => format!("{m:.9} {e:.17}\n"),
        };
        let columns = if enclosed.is_some() { "T_method T_exact L U" } else { "T_method T_exact" };
        let lines: String = found.iter().zip(&exact).enumerate().map(line).collect();
        print_result(&(header(args.header, columns) + &lines))?;
    }
    Ok(())
}
