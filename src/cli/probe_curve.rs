//! `umbravox probe --curve`: transmittance against depth along a light ray, of several methods and exact.

use super::console::{load_scene, print_json, print_message, print_result};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::files::output::{check_output, check_output_dir, prepare_output_dir, write_whole};
use crate::measure::light_curve::{LightCurve, MethodCurve};
use crate::open::{Loaded, RunFlags, SceneSettings};
use crate::render::Session;
use crate::report::make::scene_name;
use crate::report::plot::curve::{curve_pdf, curve_png, curve_svg};
use crate::shadow::{CURVES, parse_list};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Extensions of output files; any other name is a folder for all of them.
const ENDINGS: &[&str] = &["csv", "svg", "png", "pdf"];

/// Destination of the result.
enum Destination<'a> {
    /// CSV (or JSON) on stdout.
    Stdout,
    File(&'a Path),
    Folder(&'a Path),
}

/// The result as JSON.
#[derive(Serialize)]
struct Json<'a> {
    #[serde(flatten)]
    curve: &'a LightCurve,
    methods: &'a [MethodCurve],
}

/// Prints or writes the curves along the light ray through `point_mm`.
///
/// # Errors
/// Bad input, or a failure of the device or disk.
pub fn run(
    settings: &SceneSettings,
    run: &RunFlags,
    point_mm: DVec3,
    methods: Option<&str>,
    output: Option<&Path>,
) -> Result<()> {
    let methods = match (methods, &settings.shadow) {
        (None, Some(one)) => vec![one.method()?],
        (list, _) => parse_list(list.unwrap_or(&CURVES)).map_err(|e| e.at("--methods"))?,
    };
    let destination = destination(output)?;
    let Loaded { volume, strands, tf, scene, .. } = load_scene(settings)?;
    let curve = LightCurve::through(&ExactField::new(&volume, &tf), &scene.light(), point_mm)
        .map_err(|e| e.at("--curve"))?;
    let session =
        Session::open(run.adapter.as_deref(), Arc::clone(&volume), &tf, settings.disabled_optimizations())?
            .with_strands(strands);
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
    let write = |path: &Path, ending: &str| {
        let bytes = file(ending)?;
        write_whole(path, |f| f.write_all(&bytes))?;
        print_message("written", &path.display());
        Ok(())
    };
    match destination {
        Destination::Stdout => {}
        Destination::File(path) => write(path, ending_of(path).unwrap_or("csv"))?,
        Destination::Folder(folder) => {
            // Created last, so that a refused input leaves no empty folder.
            prepare_output_dir(folder)?;
            ENDINGS.iter().try_for_each(|ending| write(&folder.join(format!("curve.{ending}")), ending))?;
        }
    }
    let broken = |e: &dyn std::fmt::Display| Error::runtime("cannot print result", "stdout", e);
    if run.json {
        return print_json(&Json { curve: &curve, methods: &found });
    }
    match destination {
        Destination::Stdout => print_result(&String::from_utf8(file("csv")?).map_err(|e| broken(&e))?),
        _ => print_result(&summary(&curve, &found)),
    }
}

/// Checks the output before any work is done.
fn destination(output: Option<&Path>) -> Result<Destination<'_>> {
    let Some(path) = output else { return Ok(Destination::Stdout) };
    // A name with another extension is more likely an unknown format than a folder.
    if path.extension().is_some() && !path.is_dir() {
        check_output(path, ENDINGS)?;
        return Ok(Destination::File(path));
    }
    check_output_dir(path)?;
    Ok(Destination::Folder(path))
}

/// Extension of a name among [`ENDINGS`], case-insensitive.
fn ending_of(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_str()?.to_lowercase();
    ENDINGS.iter().copied().find(|e| *e == extension)
}

/// Summary of the ray, and of the largest error of each method.
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

/// Flags of `--curve`.
#[derive(Debug, clap::Args)]
pub struct CurveFlags {
    #[arg(long, value_name = "METHODS", help = format!("With --curve: methods separated by `;`; a value without `=` \
        is one more for the key before it [default: the method of --shadow, or {}]", CURVES.as_str()))]
    pub methods: Option<String>,
    /// With --curve: a .csv, .svg, .png or .pdf file, or a folder for curve.csv, curve.svg, curve.png and curve.pdf
    /// [default: CSV on stdout]
    #[arg(short, long, value_name = "DIR|FILE")]
    pub output: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_makes_a_file_and_a_name_without_one_a_folder() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let file = |name: &str| matches!(destination(Some(&at(name))), Ok(Destination::File(_)));
        let folder = |name: &str| matches!(destination(Some(&at(name))), Ok(Destination::Folder(_)));
        assert!(file("a.csv") && file("a.SVG") && file("a.png"));
        assert!(folder("a") && folder("a.b/c"));
        assert!(destination(Some(Path::new("a.txt"))).is_err());
        std::fs::create_dir(at("x.csv")).unwrap();
        assert!(folder("x.csv"));
        std::fs::write(at("taken"), "").unwrap();
        assert_eq!(destination(Some(&at("taken"))).err().map(|e| e.exit_status()), Some(2));
        assert_eq!(destination(Some(&at("no/a.csv"))).err().map(|e| e.exit_status()), Some(2));
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
