//! `umbravox probe --curve`: transmittance against depth along a light ray, by several shadow methods and exact.

use super::console::{load_scene, open_session, print_json, print_message, print_result};
use crate::error::Result;
use crate::exact::ExactField;
use crate::files::output::{check_output, check_output_dir, extension, prepare_output_dir, write_whole};
use crate::measure::light_curve::{LightCurve, MethodCurve};
use crate::open::{Loaded, RunFlags, SceneSettings};
use crate::report::make::scene_name;
use crate::report::plot::curve::{curve_pdf, curve_png, curve_svg};
use crate::shadow::{CURVES, parse_list};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Extensions of the output files of `probe --curve`. A name without extension is a folder for one file of each type.
const ENDINGS: &[&str] = &["csv", "svg", "png", "pdf"];

/// JSON output of `probe --curve`: the exact transmittance curve and those of the shadow methods.
#[derive(Serialize)]
struct Json<'a> {
    #[serde(flatten)]
    curve: &'a LightCurve,
    methods: &'a [MethodCurve],
}

/// Prints or writes the transmittance curves along the light ray through `point_mm`, by several shadow methods and
/// exact.
///
/// # Errors
/// Bad input, or a failure of the device or disk.
pub fn run(settings: &SceneSettings, run: &RunFlags, point_mm: DVec3, flags: &CurveFlags) -> Result<()> {
    let methods = match (&flags.methods, &settings.shadow) {
        (None, Some(one)) => vec![one.method()?],
        (list, _) => parse_list(list.as_deref().unwrap_or(&CURVES)).map_err(|e| e.at("--methods"))?,
    };
    let files = files(flags.output.as_deref())?;
    let Loaded { volume, strands, tf, scene, .. } = load_scene(settings)?;
    let curve = LightCurve::through(&ExactField::new(&volume, &tf), &scene.light(), point_mm)
        .map_err(|e| e.at("--curve"))?;
    volume.check_reads()?;
    let session = open_session(run, settings, (Arc::clone(&volume), strands), &tf)?;
    let points = curve.points_mm();
    let mut found = Vec::with_capacity(methods.len());
    for method in &methods {
        let shadow = session.shadow(method.as_ref(), scene.light())?;
        found.push(MethodCurve {
            method: method.name().into(),
            params: method.params(),
            map: method.has_map().then_some(shadow.light_space.map_size),
            transmittance: session.query(&shadow, &points)?,
        });
    }
    let about = format!("{}; light {}", scene_name(&volume, &tf), scene.light().text());
    let file = |ending: &str| match ending {
        "svg" => Ok(curve_svg(&curve, &found, &about).into_bytes()),
        "png" => curve_png(&curve, &found, &about),
        "pdf" => curve_pdf(&curve, &found, &about),
        _ => curve.csv(&found),
    };
    // Created last, so that a refused input leaves no empty folder.
    flags.output.iter().filter(|_| files.len() > 1).try_for_each(|folder| prepare_output_dir(folder))?;
    for (path, ending) in &files {
        let bytes = file(ending)?;
        write_whole(path, |f| f.write_all(&bytes))?;
        print_message("written", &path.display());
    }
    if run.json {
        return print_json(&Json { curve: &curve, methods: &found });
    }
    match files.is_empty() {
        true => print_result(&String::from_utf8_lossy(&file("csv")?)),
        false => print_result(&summary(&curve, &found)),
    }
}

/// Output files of `probe --curve` for the transmittance curves, with their extensions. The files are validated
/// before any computation. Empty for output to stdout.
fn files(output: Option<&Path>) -> Result<Vec<(PathBuf, &'static str)>> {
    let Some(path) = output else { return Ok(Vec::new()) };
    // A name with another extension is more likely an unknown format than a folder.
    if path.extension().is_some() && !path.is_dir() {
        check_output(path, ENDINGS)?;
        return Ok(vec![(path.into(), extension(path, ENDINGS)?)]);
    }
    check_output_dir(path)?;
    Ok(ENDINGS.iter().map(|ending| (path.join(format!("curve.{ending}")), *ending)).collect())
}

/// Text summary of the light ray of `probe --curve`, with the largest transmittance error of each shadow method along
/// the ray.
fn summary(curve: &LightCurve, methods: &[MethodCurve]) -> String {
    let [x, y, z] = curve.origin_mm.to_array();
    let [dx, dy, dz] = curve.direction.to_array();
    let last = curve.exact.last().copied().unwrap_or(1.0);
    let mut text = format!(
        "depth 0 at {x:.6},{y:.6},{z:.6} mm, along {dx:.9},{dy:.9},{dz:.9}\nlength {:.6} mm, exact transmittance \
        at its end {last:.9}\ndepth of the point {:.6} mm\n",
        curve.length_mm, curve.point_depth_mm
    );
    for m in methods {
        if let Some(far) = curve.farthest(m) {
            text += &format!(
                "{}: largest error {:.6} at depth {:.6} mm ({:.6}, exact {:.6})\n",
                m.name(methods),
                (far.t_method - far.t_exact).abs(),
                far.depth_mm,
                far.t_method,
                far.t_exact
            );
        }
    }
    text
}

/// Flags of `probe --curve`: shadow methods and output files.
#[derive(Debug, clap::Args)]
pub struct CurveFlags {
    #[arg(long, value_name = "METHODS", conflicts_with_all = ["rays", "points", "map_slices"],
        help = format!("With --curve: methods separated by `;`; a value without `=` is one more for \
            the key before it [default: the method of --shadow, or {}]", CURVES.as_str()))]
    pub methods: Option<String>,
    /// With --curve: output file (.csv, .svg, .png or .pdf), or a folder for curve.csv, curve.svg, curve.png and
    /// curve.pdf [default: CSV on stdout]. With --map-slices: name of the pictures (.png, .exr or .npy)
    #[arg(short, long, value_name = "DIR|FILE", conflicts_with_all = ["rays", "points"])]
    pub output: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_makes_a_file_and_a_name_without_one_a_folder() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let count = |name: &str| files(Some(&at(name))).unwrap().len();
        let (file, folder) = (|name| count(name) == 1, |name| count(name) == ENDINGS.len());
        assert!(file("a.csv") && file("a.SVG") && file("a.png"));
        assert!(folder("a") && folder("a.b/c"));
        assert!(files(Some(Path::new("a.txt"))).is_err());
        std::fs::create_dir(at("x.csv")).unwrap();
        assert!(folder("x.csv"));
        std::fs::write(at("taken"), "").unwrap();
        assert_eq!(files(Some(&at("taken"))).err().map(|e| e.exit_status()), Some(2));
        assert_eq!(files(Some(&at("no/a.csv"))).err().map(|e| e.exit_status()), Some(2));
    }

    #[test]
    fn the_help_says_the_default() {
        use clap::CommandFactory;
        let help =
            crate::cli::Cli::command().find_subcommand_mut("probe").map(|c| c.render_long_help().to_string());
        let words = |s: &str| s.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words(&help.unwrap()).contains(&format!("or {}]", CURVES.as_str())));
    }
}
