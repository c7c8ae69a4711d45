//! `umbravox compare`: the error-against-time table of several methods.

use super::compare_report::Report;
use super::scene_args::SceneArgs;
use super::{Loaded, print_result, say};
use crate::error::{Error, Result};
use crate::measure::compare::{Compared, Comparison, Effort, Job, compare, progress_steps};
use crate::measure::heat::{round_max, write_heat_map};
use crate::measure::plot::write_plots;
use crate::measure::report::{summary, write_tables};
use crate::measure::table::{Row, json};
use crate::output::{check_output_dir, prepare_output_dir, write_picture, write_whole};
use crate::render::Session;
use crate::shadow::parse_list;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Every family, each with at least three settings.
const DEFAULT_METHODS: &str = "none;rays;dsm:epsilon=0.06,0.02,0.005;osm:layers=8,32,128;dom:layers=3,7,15;\
    bom:layers=3,7,15";

/// Write the error-against-time table of several shadow methods, with plots, pictures and a report
#[derive(Debug, Args)]
pub struct CompareArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The folder for tables, plots, pictures and report.html; made when it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Methods apart by `;`; a value without `=` is one more for the key before it, and every combination is a row
    #[arg(long, value_name = "METHODS", default_value = DEFAULT_METHODS)]
    pub methods: String,
    /// Timed runs of each method, after warm-up
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: u32,
    /// Points that the camera sees, for point_err_*
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub points: u32,
    /// Light rays, for ray_err_max and bound_held
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub rays: u32,
    /// Depths on each light ray
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(2..=4000))]
    pub depths: u32,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a failure of the device or disk.
pub fn run(args: CompareArgs) -> Result<()> {
    let methods = parse_list(&args.methods).map_err(|e| e.at("--methods"))?;
    check_output_dir(&args.output)?;
    let request = args.scene.into_request()?;
    let Loaded { volume, tf, scene } = super::load(&request)?;
    if request.shadow.is_some() {
        say("note", &"--shadow is not used by compare; --methods is");
    }
    let volume = Arc::new(volume);
    let session = Session::open(request.adapter.as_deref(), Arc::clone(&volume), &tf)?;
    // Made last: what is refused before leaves no empty folder.
    prepare_output_dir(&args.output)?;
    let job = Job {
        session: &session,
        volume: &volume,
        tf: &tf,
        scene: &scene,
        scene_name: scene_name(&volume, &tf),
        effort: Effort {
            repeats: args.repeats as usize,
            points: args.points as usize,
            rays: args.rays as usize,
            depths: args.depths as usize,
        },
    };
    let bar = progress_bar(progress_steps(methods.len()))?;
    let result = compare(&job, &methods, &mut |what| {
        bar.set_message(what.to_owned());
        bar.inc(1);
    });
    bar.finish_and_clear();
    let Comparison { compared, notes, failures } = result?;
    notes.iter().for_each(|note| say("note", note));
    for (name, e) in &failures {
        say("warning", &format_args!("{name} failed: {e}"));
    }
    if request.explain {
        for c in &compared {
            c.left_out.iter().for_each(|o| say("plan", &format_args!("{}: {o}", c.slug)));
        }
    }
    let rows: Vec<Row> = compared.iter().map(|c| c.row.clone()).collect();
    let tables = write_tables(&rows, &args.output, "compare")?;
    let plots = write_plots(&rows, &args.output, "compare")?;
    let pictures = write_pictures(&compared, &args.output)?;
    let mut report = Report::default();
    report.add(&job, &compared, &notes, &failures)?;
    let report = report.write(&args.output)?;
    if request.json {
        let json = String::from_utf8(json(&rows)?)
            .map_err(|e| Error::runtime("cannot print result", "stdout", e))?;
        print_result(&json)?;
    } else {
        print_result(&summary(&rows))?;
    }
    for (what, paths) in
        [("tables", tables), ("plots", plots), ("pictures", pictures), ("report", vec![report])]
    {
        let names: Vec<_> = paths.iter().map(|p| p.display().to_string()).collect();
        say(what, &names.join(" "));
    }
    Ok(())
}

/// Writes each row's picture, where it differs from the picture of `rays`, and `pictures.md`, which shows the two side by
/// side; returns the paths.
fn write_pictures(compared: &[Compared], folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = vec![folder.join("pictures.md")];
    let mut sheet = String::from("| method | picture | difference from `rays` |\n| --- | --- | --- |\n");
    for c in compared {
        let name = format!("picture_{}.png", c.slug);
        sheet += &format!("| {} {} | ![{name}]({name}) |", c.row.method, c.row.params);
        let path = folder.join(name);
        write_picture(&path, &c.picture)?;
        paths.push(path);
        sheet += &match &c.difference {
            Some(_) => format!(" ![difference](difference_{}.png) |\n", c.slug),
            None => " |\n".into(),
        };
        if let Some(difference) = &c.difference {
            let path = folder.join(format!("difference_{}.png", c.slug));
            let label = "|difference| from rays, linear RGBA";
            write_heat_map(&path, difference, round_max(difference), label)?;
            paths.push(path);
        }
    }
    write_whole(&paths[0], |file| file.write_all(sheet.as_bytes()))?;
    Ok(paths)
}

/// Volume and transfer function in a few words: `CT_AVM, CT bone`.
pub(super) fn scene_name(volume: &Volume, tf: &TransferFunction) -> String {
    let source = &volume.provenance.source;
    let file = source.rsplit(['/', '\\']).next().unwrap_or(source);
    let stem = file.strip_suffix(".gz").unwrap_or(file);
    let stem = [".nii", ".hdr", ".img", ".raw"].iter().find_map(|e| stem.strip_suffix(e)).unwrap_or(stem);
    let volume = stem.strip_prefix("phantom:").unwrap_or(stem);
    format!("{volume}, {}", tf.name)
}

/// Shown on stderr where that is a terminal.
fn progress_bar(steps: usize) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}")
        .map_err(|e| Error::runtime("cannot show progress", "stderr", e))?;
    Ok(ProgressBar::new(steps as u64).with_style(style))
}
