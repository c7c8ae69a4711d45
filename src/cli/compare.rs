//! `umbravox compare`: the error-against-time table of several methods on one or more scenes.

use super::told::{load, print_result, say};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::{check_output_dir, prepare_output_dir};
use crate::gpu::Gpu;
use crate::measure::budget::Budget;
use crate::measure::job::{Effort, file_name_part};
use crate::measure::journal::{JOURNAL, Journal};
use crate::measure::progress::{Progress, spoken};
use crate::measure::table::Row;
use crate::open::{Loaded, SceneArgs, SceneSettings};
use crate::render::Renderer;
use crate::report::make::{Made, Order, Subject, make, scene_name};
use crate::report::tables::summary;
use crate::report::writers::json;
use crate::shadow::{COMPARED, parse_list};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Write the error-against-time table of several shadow methods, with plots and pictures
#[derive(Debug, Args)]
pub struct CompareArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The folder for tables, plots and pictures; made when it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Go on with what an interrupted run of the same program, scenes and settings has measured into DIR; without it
    /// the table is started anew
    #[arg(long)]
    pub resume: bool,
    /// Methods separated by `;`; a value without `=` is one more for the key before it, and every combination is a row
    #[arg(long, value_name = "METHODS", default_value_t = COMPARED.clone())]
    pub methods: String,
    /// Search the settings of each method of --methods for its least errors within so many bytes, or so many milliseconds
    /// of build and frame, and add them as rows: bytes=2MiB,8MiB or ms=50; may be given several times
    #[arg(long, value_name = "BUDGET")]
    pub budget: Vec<String>,
    /// Measure as well what each omission of the plan is worth: times and bytes with it forced back on
    #[arg(long)]
    pub ablate: bool,
    /// Timed runs of each method, after warm-up
    #[arg(long, value_name = "N", default_value_t = Effort::default().repeats as u32,
        value_parser = clap::value_parser!(u32).range(Effort::REPEATS))]
    pub repeats: u32,
    /// Points that the camera sees, for point_err_*
    #[arg(long, value_name = "N", default_value_t = Effort::default().points as u32,
        value_parser = clap::value_parser!(u32).range(Effort::POINTS))]
    pub points: u32,
    /// Light rays, for ray_err_max and bound_held
    #[arg(long, value_name = "N", default_value_t = Effort::default().rays as u32,
        value_parser = clap::value_parser!(u32).range(Effort::RAYS))]
    pub rays: u32,
    /// Depths on each light ray
    #[arg(long, value_name = "N", default_value_t = Effort::default().depths as u32,
        value_parser = clap::value_parser!(u32).range(Effort::DEPTHS))]
    pub depths: u32,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a failure of the device or disk, or (after everything is written) a row that failed.
pub fn run(args: CompareArgs) -> Result<()> {
    let methods = parse_list(&args.methods).map_err(|e| e.at("--methods"))?;
    let mut budgets = Vec::new();
    for text in &args.budget {
        budgets.extend(Budget::parse_list(text).map_err(|e| e.at("--budget"))?);
    }
    check_output_dir(&args.output)?;
    let effort = Effort {
        repeats: args.repeats as usize,
        points: args.points as usize,
        rays: args.rays as usize,
        depths: args.depths as usize,
    };
    let paths = args.scene.scene.clone();
    let scenes = args.scene.into_each()?;
    let adapter = one_adapter(&scenes)?;
    if scenes.iter().any(|s| s.shadow.is_some()) {
        say("note", &"--shadow is not used by compare; --methods is");
    }
    let (names, first) = read_all(&scenes, &paths)?;
    let renderer = Arc::new(Renderer::new(Gpu::open(adapter.as_deref())?));
    // Made last: what is refused before leaves no empty folder.
    prepare_output_dir(&args.output)?;
    let mut journal = Journal::open(&args.output, args.resume)?;
    if args.resume {
        say("note", &format_args!("{} holds {} rows", args.output.join(JOURNAL).display(), journal.len()));
    }

    let bar = progress_bar()?;
    let mut progress = Progress::new(|status| {
        bar.set_length(status.total as u64);
        bar.set_position(status.done as u64);
        // First what must not be cut off at the end of the line.
        let left = status.left_s.map_or(String::new(), |s| format!("about {} left, ", spoken(s)));
        bar.set_message(format!("{left}{}", status.what));
    });
    let order = Order { methods: &methods, effort, ablate: args.ablate, budgets: &budgets, remark: "" };
    let mut first = Some(first);
    let mut read = |i: usize| {
        let loaded = first.take().map_or_else(|| scenes[i].load(&Loading::default()), Ok)?;
        let Loaded { volume, tf, scene, .. } = loaded;
        let strands = scenes[i].spec().strands(&Loading::default())?;
        Ok(Subject { volume: Arc::new(volume), tf, strands, scene, forced: scenes[i].forced() })
    };
    let made = make(&order, &names, &mut read, &renderer, &mut journal, &mut progress)?;
    drop(progress);
    bar.finish_and_clear();
    publish(made, &scenes, &args.output)
}

/// Reads every scene before anything is done: a mistake in the last is not found hours later. Gives their names, and the
/// first one itself.
fn read_all(scenes: &[SceneSettings], paths: &[PathBuf]) -> Result<(Vec<String>, Loaded)> {
    let (mut names, mut first) = (Vec::new(), None);
    for (i, settings) in scenes.iter().enumerate() {
        let loaded = load(settings)?;
        let name = paths.get(i).map_or_else(|| scene_name(&loaded.volume, &loaded.tf), |path| stem(path));
        names.push(unused_name(name, &names));
        first.get_or_insert(loaded);
    }
    let none = || Error::input("bad command line", "--scene", "no scene");
    Ok((names, first.ok_or_else(none)?))
}

/// Writes what was measured, prints the table and says what files there are.
fn publish(made: Made, scenes: &[SceneSettings], folder: &Path) -> Result<()> {
    let all = &made.comparison;
    all.notes.iter().for_each(|note| say("note", note));
    for (name, e) in &all.failures {
        say("warning", &format_args!("{name} failed: {e}"));
    }
    if scenes.iter().any(|s| s.explain) {
        for c in &all.compared {
            c.left_out.iter().for_each(|o| say("plan", &format_args!("{}: {o}", c.slug)));
        }
    }
    let rows = all.rows();
    let files = made.write(folder)?;
    files.ablations.iter().for_each(|path| say("ablation", &path.display()));
    files.budgets.iter().for_each(|path| say("budgets", &path.display()));
    if scenes.iter().any(|s| s.json) {
        print_result(&json(&rows)?)?;
    } else {
        print_result(&summary(&rows))?;
    }
    let report = [files.report];
    for (what, paths) in [
        ("tables", &files.tables[..]),
        ("plots", &files.plots),
        ("pictures", &files.pictures),
        ("report", &report),
    ] {
        let names: Vec<_> = paths.iter().map(|p| p.display().to_string()).collect();
        say(what, &names.join(" "));
    }
    verdict(&rows, folder)
}

/// The one adapter that all scenes are drawn on: times of several make no table.
fn one_adapter(scenes: &[SceneSettings]) -> Result<Option<String>> {
    let mut named = scenes.iter().map(|s| &s.adapter);
    let first = named.next().cloned().flatten();
    if named.any(|a| *a != first) {
        let why = "scene files name different ones, and a table is of one";
        return Err(Error::input("cannot choose graphics adapter", "--scene", why)
            .hint("--adapter wins over all of them"));
    }
    Ok(first)
}

/// An error where a row failed: the first one's reason stands for all.
fn verdict(rows: &[Row], folder: &Path) -> Result<()> {
    let mut failed = rows.iter().filter(|r| r.has_failed()).peekable();
    let Some(first) = failed.peek() else { return Ok(()) };
    let why = format!("{} {}: {}", first.method, first.params, first.note);
    let count = failed.count();
    let what = format!("{count} of {} rows failed", rows.len());
    Err(Error::runtime(what, folder.join("compare.csv").display(), why))
}

/// A scene file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The name, with a number where a scene has it already; also where the two would give files of one name.
fn unused_name(name: String, used: &[String]) -> String {
    let taken = |name: &str| used.iter().any(|u| file_name_part(u) == file_name_part(name));
    let numbered = (2..).map(|n| format!("{name}-{n}"));
    std::iter::once(name.clone()).chain(numbered).find(|n| !taken(n)).unwrap_or(name)
}

/// Shown on stderr where that is a terminal.
fn progress_bar() -> Result<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:20} {pos}/{len} {wide_msg}")
        .map_err(|e| Error::runtime("cannot show progress", "stderr", e))?;
    Ok(ProgressBar::new(0).with_style(style))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_one_name_are_told_apart() {
        let mut names: Vec<String> = Vec::new();
        for path in
            ["a/chest.toml", "b/chest.toml", "chest-2.toml", "c/chest.toml", "head 1.toml", "head_1.toml"]
        {
            names.push(unused_name(stem(Path::new(path)), &names));
        }
        assert_eq!(names, ["chest", "chest-2", "chest-2-2", "chest-3", "head 1", "head_1-2"]);
    }

    #[test]
    fn one_failed_row_makes_the_verdict() {
        let mut rows = vec![Row::default(), Row { method: "dsm".into(), ..Row::default() }];
        assert!(verdict(&rows, Path::new("out")).is_ok());
        rows[1].set_failed(&"planted");
        let e = verdict(&rows, Path::new("out")).unwrap_err();
        assert_eq!(e.exit_status(), 1);
        assert!(e.what == "1 of 2 rows failed" && e.why == "dsm : planted", "{e}");
    }
}
