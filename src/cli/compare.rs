//! `umbravox compare`: measures error, time and memory of several shadow methods on one or more scenes.

use super::console::{StepDisplay, load_scene, print_message, print_result};
use super::export::{check_page, page_methods, scene_page};
use super::interrupt::Interrupt;
use super::measuring_bar::MeasuringBar;
use crate::error::{Error, Result};
use crate::files::input::is_standard_stream;
use crate::files::loading::Loading;
use crate::files::output::{check_output_dir, prepare_output_dir, write_whole};
use crate::measure::budget::Budget;
use crate::measure::facts::Facts;
use crate::measure::job::{Checked, Effort, file_name_part};
use crate::measure::journal::{JOURNAL, Journal};
use crate::measure::progress::Progress;
use crate::measure::table::Row;
use crate::open::provenance::{RecordedScene, function_text};
use crate::open::{Layer, Loaded, RunFlags, SceneArgs, SceneRequest, SceneSettings};
use crate::render::Renderer;
use crate::report::Start;
use crate::report::make::{Files, Made, Order, Subject, make, scene_name};
use crate::report::run::{Run, Shard};
use crate::report::tables::{Layout, summary};
use crate::report::writers::table_json;
use crate::shadow::{COMPARED, Method, parse_distinct};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Write a table of error, time and memory of several shadow methods, with plots and pictures
#[derive(Debug, Args)]
pub struct CompareArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Folder for the tables, plots and pictures of the comparison; created if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Resume an interrupted comparison of the same scenes and settings in DIR
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Remove all files of an earlier comparison from DIR, and no others, and start again
    #[arg(long)]
    pub overwrite: bool,
    /// Shadow methods separated by `;`, each with settings such as dsm:map=256,512. Several values of a setting give
    /// several table rows, one per combination
    #[arg(long, value_name = "METHODS", default_value_t = COMPARED.clone())]
    pub methods: String,
    /// Also find, for each method of --methods, the settings with the smallest errors within a budget of memory
    /// (bytes=2MiB,8MiB) or of build plus frame time (ms=50; frames=3: in frames without shadows), and add them as rows;
    /// may be given several times
    #[arg(long, value_name = "BUDGET")]
    pub budget: Vec<String>,
    /// Also measure times and memory with each optimization (such as skipping empty space) turned off
    #[arg(long)]
    pub ablate: bool,
    /// Also measure each light of a scene with several lights alone, as a separate scene
    #[arg(long)]
    pub each_light: bool,
    /// Measure only part I of N (a shard) of the table's rows, I from 1 to N; `umbravox merge` combines the shards
    #[arg(long, value_name = "I/N", value_parser = str::parse::<Shard>, conflicts_with_all = ["ablate", "budget"])]
    pub shard: Option<Shard>,
    /// Also write a page that draws each scene in a browser with --methods, as `umbravox export` does. Its maps have
    /// fit=volume, so that its errors differ from those of the table
    #[arg(long)]
    pub page: bool,
    /// Allow that the pages of --page hold the voxels, labels and meshes of the scene's files
    #[arg(long, requires = "page")]
    pub embed_volume: bool,
    #[command(flatten)]
    pub layout: LayoutFlags,
    /// Number of timed runs of each shadow method, after warm-up [default: 6, and 20 where build and frame take less than
    /// 50 ms together]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(Effort::REPEATS))]
    pub repeats: Option<u32>,
    /// Number of visible points at which transmittance errors are measured (columns point_err_*)
    #[arg(long, value_name = "N", default_value_t = Effort::default().points as u32,
        value_parser = clap::value_parser!(u32).range(Effort::POINTS))]
    pub points: u32,
    /// Number of light rays along which errors and error bounds are tested (columns ray_err_max and bound_held)
    #[arg(long, value_name = "N", default_value_t = Effort::default().rays as u32,
        value_parser = clap::value_parser!(u32).range(Effort::RAYS))]
    pub rays: u32,
    /// Number of depths tested on each light ray
    #[arg(long, value_name = "N", default_value_t = Effort::default().depths as u32,
        value_parser = clap::value_parser!(u32).range(Effort::DEPTHS))]
    pub depths: u32,
    /// Light rays and points at which error bounds are tested: sample (as many light rays as --rays, and points in a
    /// twentieth as many cells between texels), all (the light ray of every texel, also at the depths of all curve nodes, and
    /// points as sample), or points (a million points between light rays, and light rays as sample)
    #[arg(long, value_enum, default_value_t = Checked::Sample, hide_possible_values = true)]
    pub check: Checked,
    /// Also measure flicker over N small steps of the light, and as many of the camera (columns flicker_rms and
    /// flicker_camera_rms)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(Effort::FLICKER))]
    pub flicker: Option<u32>,
}

/// Flags for the layout of comparison tables: columns and width.
#[derive(Debug, Args)]
pub struct LayoutFlags {
    /// Columns of the comparison table in compare.md, compare.tex and on the terminal: names from compare.csv,
    /// separated by commas [default: a few; in compare.md most]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub columns: Option<Vec<String>>,
    /// Width of grid.pdf, and maximum width of the table in compare.tex, points [default: 455, an A4 page with
    /// margins of 2.5 cm]
    #[arg(long, value_name = "PT", value_parser = tex_width_pt)]
    pub tex_width: Option<f64>,
    /// Difference from the reference picture at the upper end of the colour bar, in grid.pdf, the difference images
    /// and the report [default: the largest difference of a method with shadows, rounded up]
    #[arg(long, value_name = "D", value_parser = difference_max)]
    pub difference_max: Option<f32>,
}

impl LayoutFlags {
    /// Returns the table layout that the flags select, after checking the names of its columns.
    ///
    /// # Errors
    /// An unknown column.
    pub fn layout(&self) -> Result<Layout> {
        let trimmed = |names: &Vec<String>| names.iter().map(|n| n.trim().to_owned()).collect();
        let layout = Layout {
            columns: self.columns.as_ref().map(trimmed),
            tex_width_pt: self.tex_width.unwrap_or(Layout::TEX_WIDTH_PT),
            difference_max: self.difference_max,
        };
        layout.check().map(|()| layout)
    }
}

fn tex_width_pt(text: &str) -> Result<f64, String> {
    let text = text.trim_end_matches("pt").trim();
    let width = text.parse().ok().filter(|w| (100.0..=5000.0).contains(w));
    width.ok_or_else(|| "expected a width of 100 to 5000 points".into())
}

fn difference_max(text: &str) -> Result<f32, String> {
    let max = text.trim().parse().ok().filter(|max| (1e-6..=1.0).contains(max));
    max.ok_or_else(|| "expected a difference of linear colour, from 1e-6 to 1".into())
}

/// Runs the `compare` command: measures shadow methods on scenes, and writes tables, plots and pictures.
///
/// # Errors
/// Bad input, a failure of the device or disk, an interruption, or (after everything is written) a row that failed.
pub fn run(args: CompareArgs) -> Result<()> {
    let methods = parse_distinct(&args.methods).map_err(|e| e.at("--methods"))?;
    let layout = args.layout.layout()?;
    let budgets = distinct_budgets(&args.budget)?;
    Budget::check_methods(&budgets, &methods).map_err(|e| e.at("--methods"))?;
    check_output_dir(&args.output)?;
    let repeated = match args.repeats {
        Some(repeats) => Effort { repeats: repeats as usize, short_repeats: 0, ..Effort::default() },
        None => Effort::default(),
    };
    let effort = Effort {
        points: args.points as usize,
        rays: args.rays as usize,
        depths: args.depths as usize,
        check: args.check,
        flicker: args.flicker.unwrap_or(0) as usize,
        ..repeated
    };
    let paths = args.scene.scene.clone();
    let requests = args.scene.into_requests()?;
    let device = one_device(&requests)?;
    let output = requests.iter().fold(RunFlags::default(), |all, request| request.run.over(&all));
    let scenes: Vec<_> = requests.into_iter().map(|request| request.settings).collect();
    if scenes.iter().any(|s| s.shadow.is_some()) {
        print_message("note", &"compare ignores --shadow; --methods lists its methods");
    }
    if args.page {
        scenes.iter().try_for_each(|scene| check_page(scene, args.embed_volume))?;
    }
    let (scenes, first) = read_all(scenes, &paths, args.each_light)?;
    let renderer = Arc::new(Renderer::new(device.gpu()?));
    let records = scenes.iter().map(|scene| scene.record.clone()).collect();
    let facts = Facts::of(renderer.gpu());
    let mut run = Run::new(&facts, effort, &args.methods, &methods, records, args.shard);
    (run.ablate, run.pages) = (args.ablate, args.page);
    run.budgets = budgets.iter().map(Budget::to_string).collect();
    run.command = std::env::args().collect();
    if run.count_here() == 0 {
        let why = format!("the table has only {} rows", run.rows.len());
        return Err(Error::input("nothing to compare", "--shard", why));
    }
    let start = match (args.resume, args.overwrite) {
        (true, _) => Start::Resume,
        (_, true) => Start::Overwrite,
        _ => Start::New,
    };
    run.check(&args.output, start)?;
    // Created last, so that a refused input leaves no empty folder.
    prepare_output_dir(&args.output)?;
    let mut journal = Journal::open(&args.output, args.resume)?;
    if args.resume {
        print_message(
            "note",
            &format_args!("{} holds {} rows", args.output.join(JOURNAL).display(), journal.len()),
        );
    }
    let tf_texts: Vec<_> = scenes.iter().map(|scene| scene.tf_text.clone()).collect();
    run.begin(&args.output, start, &tf_texts)?;
    let made = measure_rows(&run, &budgets, &scenes, first, &renderer, &mut journal)
        .map_err(|e| if e.is_cancelled() { interrupted(&args.output, &run, &journal) } else { e })?;
    drop((journal, renderer));
    let rows = publish(made, &output, &args.output, &layout)?;
    let pages = if args.page { write_pages(&run, &scenes, &rows, &device, &args.output) } else { Ok(()) };
    verdict(&rows, &args.output).and(pages)
}

/// Writes a page for each scene that draws it in a browser, with the requested methods whose rows did not fail. A page
/// that fails does not end the others.
fn write_pages(
    run: &Run,
    scenes: &[RecordedScene],
    rows: &[Row],
    device: &RunFlags,
    folder: &Path,
) -> Result<()> {
    let mut failure = Ok(());
    for (i, (scene, here)) in scenes.iter().zip(run.methods_here()).enumerate() {
        let failed = |method: &dyn Method| {
            let of_scene = rows.iter().filter(|row| row.has_failed() && row.scene == run.scenes[i].name);
            of_scene.into_iter().any(|row| is_row_of(row, method))
        };
        let all = parse_distinct(&run.methods)?.into_iter().zip(here);
        let methods =
            all.filter(|(method, here)| *here && !failed(method.as_ref())).map(|(method, _)| method);
        let methods = page_methods(methods.collect())?;
        if methods.is_empty() {
            continue;
        }
        let path = folder.join(run.page_name(i));
        let page = scene.settings.load(&Loading::default());
        let page = page.and_then(|loaded| scene_page(&scene.settings, &loaded, &methods, device));
        match page.and_then(|page| write_whole(&path, |file| file.write_all(page.html.as_bytes()))) {
            Ok(()) => print_message("page", &path.display()),
            Err(error) if error.is_cancelled() => return Err(error),
            Err(error) => {
                print_message("warning", &format_args!("{} is not written: {error}", path.display()));
                failure = failure.and(Err(error));
            }
        }
    }
    failure
}

/// Whether a table row has a method with all of its settings.
fn is_row_of(row: &Row, method: &dyn Method) -> bool {
    let size = method.map_size();
    (&*row.method, &row.params) == (method.name(), &method.params()) && (size.is_none() || row.map == size)
}

/// Measures the rows of the table that compares shadow methods, with progress on the terminal. An interrupt (Ctrl-C)
/// stops it between two measurements.
fn measure_rows(
    run: &Run,
    budgets: &[Budget],
    scenes: &[RecordedScene],
    first: Loaded,
    renderer: &Arc<Renderer>,
    journal: &mut Journal,
) -> Result<Made> {
    let mut methods = Vec::new();
    for here in run.methods_here() {
        let all = parse_distinct(&run.methods)?;
        methods.push(all.into_iter().zip(here).filter(|(_, here)| *here).map(|(m, _)| m).collect());
    }
    let order = Order { methods: &methods, budgets, remark: "" };
    let mut first = Some(first);
    let mut read = |i: usize| {
        let first = first.take().filter(|_| i == 0);
        let loaded = first.map_or_else(|| scenes[i].settings.load(&Loading::default()), Ok)?;
        let Loaded { volume, strands, tf, scene, .. } = loaded;
        Ok(Subject { volume, tf, strands, scene, forced: scenes[i].settings.disabled_optimizations() })
    };
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("finished rows are kept");
    let mut progress = Progress::watched(MeasuringBar { bar: &bar, interrupt: &interrupt });
    let made = make(&order, run, &mut read, renderer, journal, &mut progress);
    drop(progress);
    bar.finish_and_clear();
    made
}

/// Error that ends an interrupted comparison of shadow methods: states how many table rows are finished and how to
/// resume.
fn interrupted(folder: &Path, run: &Run, journal: &Journal) -> Error {
    let count = run.count_here();
    let why = format!("{} of {count} rows are finished and recorded", journal.recorded().min(count));
    Error::runtime("interrupted", folder.display(), why).hint("the same command line with --resume continues")
}

/// Parses the budgets of memory or time given with `--budget` and removes duplicates.
fn distinct_budgets(texts: &[String]) -> Result<Vec<Budget>> {
    let parse = |text: &String| Budget::parse_list(text).map_err(|e| e.at("--budget"));
    let all = texts.iter().map(parse).collect::<Result<Vec<_>>>()?.concat();
    let is_first = |(i, budget): &(usize, &Budget)| !all[..*i].contains(budget);
    Ok(all.iter().enumerate().filter(is_first).map(|(_, budget)| *budget).collect())
}

/// Reads all scenes of a comparison before the first measurement, so that an error in the last scene is found at
/// once. Returns the record of each scene, and the first scene with its volume.
fn read_all(
    scenes: Vec<SceneSettings>,
    paths: &[PathBuf],
    each_light: bool,
) -> Result<(Vec<RecordedScene>, Loaded)> {
    let (mut recorded, mut names, mut first) = (Vec::new(), Vec::new(), None);
    let several = scenes.len() > 1 || each_light;
    for (i, settings) in scenes.into_iter().enumerate() {
        let loaded = load_scene(&settings)?;
        let of_file = || paths.get(i).filter(|path| !is_standard_stream(path)).map(|path| stem(path));
        let name = settings.name.clone().or_else(of_file);
        let name = unused_name(name.unwrap_or_else(|| scene_name(&loaded.volume, &loaded.tf)), &names);
        names.push(name.clone());
        let tf_text = function_text(&loaded)?;
        recorded.push(RecordedScene::of(settings.clone(), &loaded, tf_text.clone(), &name, several)?);
        for (light, source) in loaded.scene.lights_apart().into_iter().filter(|_| each_light) {
            let name = unused_name(format!("{name} light {light}"), &names);
            let alone = SceneSettings { light: Some(vec![source]), ..settings.clone() };
            let mut alone = RecordedScene::of(alone, &loaded, tf_text.clone(), &name, several)?;
            alone.record.light = Some(light);
            names.push(name);
            recorded.push(alone);
        }
        first.get_or_insert(loaded);
    }
    if each_light && recorded.iter().all(|scene| scene.record.light.is_none()) {
        return Err(Error::input(
            "bad command line",
            "--each-light",
            "no scene has several lights that are not black",
        ));
    }
    let none = || Error::input("bad command line", "--scene", "no scene");
    Ok((recorded, first.ok_or_else(none)?))
}

/// Writes the files of a finished comparison of shadow methods, prints its table, and lists the files.
fn publish(made: Made, output: &RunFlags, folder: &Path, layout: &Layout) -> Result<Vec<Row>> {
    let all = &made.comparison;
    all.notes.iter().for_each(|note| print_message("note", note));
    for (name, e) in &all.failures {
        print_message("warning", &format_args!("{name} failed: {e}"));
    }
    if output.explain {
        for c in &all.compared {
            c.left_out.iter().for_each(|o| print_message("plan", &format_args!("{}: {o}", c.slug)));
        }
    }
    let rows = all.rows();
    let json = table_json(&rows, &made.run)?;
    let files = made.write(folder, layout)?;
    files.budgets.iter().for_each(|path| print_message("budgets", &path.display()));
    files.ablations.iter().for_each(|path| print_message("ablation", &path.display()));
    if output.json {
        print_result(&json)?;
    } else {
        print_result(&summary(&rows, layout))?;
    }
    list_files(&files);
    Ok(rows)
}

/// Prints to stderr the names of the files that a comparison of shadow methods wrote.
pub fn list_files(files: &Files) {
    files.remarks.iter().for_each(|remark| print_message("note", remark));
    let report = [files.report.clone()];
    for (what, paths) in [
        ("tables", &files.tables[..]),
        ("plots", &files.plots),
        ("pictures", &files.pictures),
        ("report", &report),
    ] {
        let names: Vec<_> = paths.iter().map(|p| p.display().to_string()).collect();
        print_message(what, &names.join(" "));
    }
}

/// Graphics adapter, and limit on its memory, that the scene files select. Fails if they select different ones, since times
/// measured on different adapters are not comparable.
fn one_device(requests: &[SceneRequest]) -> Result<RunFlags> {
    let of = |run: &RunFlags| (run.adapter.clone(), run.device_memory);
    let Some(first) = requests.first() else { return Ok(RunFlags::default()) };
    if requests.iter().any(|request| of(&request.run) != of(&first.run)) {
        let why = "scene files name different ones, and a table has one";
        return Err(Error::input("cannot choose graphics adapter", "--scene", why)
            .hint("--adapter and --device-memory win over all of them"));
    }
    Ok(first.run.clone())
}

/// Fails if the measurement of a row of the comparison table failed; the error states the reason for the first such
/// row.
fn verdict(rows: &[Row], folder: &Path) -> Result<()> {
    let mut failed = rows.iter().filter(|r| r.has_failed()).peekable();
    let Some(first) = failed.peek() else { return Ok(()) };
    let why = format!("{} {}: {}", first.method, first.params, first.note);
    let count = failed.count();
    let what = format!("{count} of {} rows failed", rows.len());
    Err(Error::runtime(what, folder.join("compare.csv").display(), why))
}

/// Returns the name of a scene file without folder and extension.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Makes a scene name unique: appends a number if another scene has this name, or a name that leads to the same file
/// names.
fn unused_name(name: String, used: &[String]) -> String {
    let taken = |name: &str| used.iter().any(|u| file_name_part(u) == file_name_part(name));
    let numbered = (2..).map(|n| format!("{name}-{n}"));
    std::iter::once(name.clone()).chain(numbered).find(|n| !taken(n)).unwrap_or(name)
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
