//! `umbravox verify`: measures an archived result folder again and compares what does not depend on times.

use super::console::{StepDisplay, load_scene, print_message, print_result};
use super::{claims, stability};
use crate::benchmark::Run as BenchmarkRun;
use crate::benchmark::definition::Definition;
use crate::benchmark::folder::{Conditions, Folder};
use crate::benchmark::verify::verify_tables;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::measure::job::Effort;
use crate::measure::journal::Journal;
use crate::measure::progress::{Progress, Step, StepKind};
use crate::open::{Loaded, SceneRequest, SceneSettings};
use crate::render::Renderer;
use crate::report::make::{Order, Subject, make};
use crate::report::run::Run;
use crate::report::verify::{Archive, Difference, Verified};
use crate::shadow::{Method, MethodSpec};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of differences that are printed.
const MOST_PRINTED: usize = 20;

/// Measure a result folder again, without times, and compare its values; exit status 1 if one differs
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Result folder of `compare`, `benchmark`, `claims` or `stability`
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Folder of the volumes that are files, if they have moved
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub data: PathBuf,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// Runs the `verify` command. On the adapter and driver of the folder, recorded and new values must have the same digits,
/// the first five with another revision of the program. On other adapters and drivers they may differ by 2 %.
///
/// # Errors
/// The folder holds no finished result, a volume is missing, the device fails, or a value differs.
pub fn run(args: &VerifyArgs) -> Result<()> {
    let bar = StepDisplay::new()?;
    let mut progress = Progress::new(|status| bar.show(status));
    let verified = verify(args, &mut progress);
    drop(progress);
    bar.finish_and_clear();
    let Verified { values, differences, not_compared } = verified?;
    if not_compared > 0 {
        let text = "values are not compared: they depend on times, revision, adapter or driver";
        print_message("note", &format_args!("{not_compared} {text}"));
    }
    if values == 0 {
        let why = "it has no values that can be compared";
        return Err(Error::input("cannot verify", args.folder.display(), why));
    }
    if differences.is_empty() {
        return print_result(&format_args!("{}: {values} values are confirmed\n", args.folder.display()));
    }
    for Difference { row, column, recorded, measured } in differences.iter().take(MOST_PRINTED) {
        print_message("difference", &format_args!("{row}: {column} is {measured}, recorded {recorded}"));
    }
    let why = format!("{} of {values} values differ", differences.len());
    Err(Error::runtime("cannot confirm result", args.folder.display(), why))
}

/// Measures each table of a result folder again.
fn verify(args: &VerifyArgs, progress: &mut Progress) -> Result<Verified> {
    let (folder, adapter) = (&args.folder, args.adapter.as_deref());
    let has = |table: &str| folder.join(table).is_file();
    if let Some((folder, conditions)) = Folder::archived(folder)? {
        return verify_benchmark(args, &folder, &conditions, progress);
    }
    let mut verified = Verified::default();
    let has_other = has("claims.csv") || has("stability.csv");
    if has("compare.csv") || !has_other {
        verified = verify_comparison(args, &Archive::read(folder)?, progress)?;
    }
    if has("claims.csv") {
        verified = verified.and(claims::verify(folder, adapter, progress)?);
    }
    if has("stability.csv") {
        verified = verified.and(stability::verify(folder, adapter, progress)?);
    }
    Ok(verified)
}

fn verify_benchmark(
    args: &VerifyArgs,
    folder: &Folder,
    conditions: &Conditions,
    progress: &mut Progress,
) -> Result<Verified> {
    let definition = Definition::frozen()?;
    if (definition.version, definition.points) != (conditions.version, conditions.points) {
        let why =
            format!("it is of version {} of the benchmark, not {}", conditions.version, definition.version);
        return Err(Error::input("cannot verify", args.folder.display(), why));
    }
    let (mut cells, mut results) = (Vec::new(), Vec::new());
    for cell in definition.cells() {
        if let Some(result) = folder.result(&cell)? {
            cells.push(cell);
            results.push(result);
        }
    }
    let (definition, data) = (&definition, args.data.clone());
    let run = BenchmarkRun {
        definition,
        cells: &cells,
        methods: &[],
        budgets: &[],
        externals: &[],
        data,
        settings: None,
    };
    run.check()?;
    let renderer = Arc::new(Renderer::new(Gpu::open(args.adapter.as_deref())?));
    let step = Step::new(StepKind::Case, "");
    progress.expect(step.clone(), cells.len());
    let mut verified =
        run.verify(folder, conditions, &renderer, &mut |cell| progress.begin(step.clone(), cell))?;
    verify_tables(&results, &args.folder, &mut verified)?;
    Ok(verified)
}

fn verify_comparison(args: &VerifyArgs, archive: &Archive, progress: &mut Progress) -> Result<Verified> {
    let Run { scenes, effort, .. } = &archive.run;
    let mut methods: Vec<Vec<Box<dyn Method>>> = scenes.iter().map(|_| Vec::new()).collect();
    for record in archive.records() {
        methods[record.scene].push(record.method.parse::<MethodSpec>()?.method()?);
    }
    let settings = scenes
        .iter()
        .map(|scene| settings(&args.folder, &scene.file, &args.data))
        .collect::<Result<Vec<_>>>()?;
    let renderer = Arc::new(Renderer::new(Gpu::open(args.adapter.as_deref())?));
    let run = Run {
        effort: Effort { repeats: 1, short_repeats: 0, ..*effort },
        ablate: false,
        ..archive.run.clone()
    };
    let order = Order { methods: &methods, budgets: &[], remark: "" };
    let mut read = |i: usize| {
        let Loaded { volume, strands, tf, scene, .. } = load_scene(&settings[i])?;
        Ok(Subject { volume, tf, strands, scene, forced: settings[i].disabled_optimizations() })
    };
    let made = make(&order, &run, &mut read, &renderer, &mut Journal::nowhere(), progress)?;
    Ok(archive.compare(&made.comparison.rows()))
}

/// Reads a scene file of a result folder. A volume that has moved is looked for in the folder `data`.
fn settings(folder: &Path, file: &str, data: &Path) -> Result<SceneSettings> {
    let mut settings = SceneRequest::read(&folder.join(file))?.settings;
    if let Some(volume) =
        settings.volume.as_mut().filter(|v| !v.starts_with("phantom:") && !Path::new(v).exists())
    {
        let name = Path::new(volume).file_name().unwrap_or_default();
        let moved = data.join(name);
        if !moved.exists() {
            let error = Error::input("cannot read volume", moved.display(), "there is no such file");
            return Err(error.hint("--data names the folder of the volumes"));
        }
        *volume = moved.display().to_string();
    }
    Ok(settings)
}
