//! `umbravox benchmark`: ranks shadow methods within equal budgets, in the cells of the frozen benchmark.

use super::console::{StepDisplay, print_message, print_result};
use super::interrupt::Interrupt;
use crate::benchmark::Run;
use crate::benchmark::definition::{Cell, Definition};
use crate::benchmark::external::External;
use crate::benchmark::folder::{Conditions, Folder};
use crate::benchmark::pages;
use crate::error::{Error, Result};
use crate::files::output::check_output_dir;
use crate::gpu::Gpu;
use crate::measure::budget::Budget;
use crate::measure::facts::Facts;
use crate::measure::progress::{Status, Step, StepKind};
use crate::render::Renderer;
use crate::report::run::Shard;
use crate::shadow::{Entry, METHODS, SearchSpace};
use clap::Args;
use itertools::Itertools as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rank shadow methods within equal budgets: search the best settings of each in every cell of a frozen benchmark.
///
/// A cell is a volume, a transfer function, a light and a view. A run that was ended resumes when the same command is
/// given again.
#[derive(Debug, Args)]
pub struct BenchmarkArgs {
    /// Folder for the results; a folder of the same benchmark is continued
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["list", "hashes", "export"])]
    pub output: Option<PathBuf>,
    /// Cells to measure: patterns of names VOLUME-FUNCTION-LIGHT-VIEW, separated by commas; * stands for any text
    #[arg(long, value_name = "PATTERNS", default_value = "*")]
    pub cells: String,
    /// Names of shadow methods to measure, separated by commas [default: all with settings to search]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Budgets of memory (bytes=512KiB,2MiB) or of build plus frame time (ms=50; frames=3: in frames without shadows); may
    /// be given several times
    #[arg(long, value_name = "BUDGET", default_value = "bytes=512KiB,2MiB")]
    pub budget: Vec<String>,
    /// Measure the methods in FOLDER, an earlier result, with the settings found there, without a search
    #[arg(long, value_name = "FOLDER")]
    pub settings: Option<PathBuf>,
    /// Rank an external program too, which answers the same points; may be given several times
    #[arg(long, value_name = "NAME=COMMAND", value_parser = str::parse::<External>)]
    pub external: Vec<External>,
    /// Folder of the volumes that are files
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub data: PathBuf,
    /// Measure only part I of N (a shard) of the volumes and transfer functions, I from 1 to N; shards share one folder
    #[arg(long, value_name = "I/N", value_parser = str::parse::<Shard>)]
    pub shard: Option<Shard>,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Print the names of the selected cells and end
    #[arg(long)]
    pub list: bool,
    /// Print the hashes of the exact transmittances of the selected cells and end
    #[arg(long, conflicts_with_all = ["list", "output", "methods", "budget", "settings", "external"])]
    pub hashes: bool,
    /// Write volumes, scene files, visible points and exact transmittances of the selected cells to DIR and end
    #[arg(long, value_name = "DIR", conflicts_with_all = ["list", "output", "hashes", "methods", "budget", "settings", "external"])]
    pub export: Option<PathBuf>,
}

/// Runs the `benchmark` command: measures the cells that the folder lacks, then writes tables and plots of all.
///
/// # Errors
/// Bad input, a failure of the device or disk, or an interruption.
pub fn run(args: &BenchmarkArgs) -> Result<()> {
    let definition = Definition::frozen()?;
    let cells = definition.cells_like(&args.cells)?;
    let own: Vec<Cell> =
        cells.iter().filter(|cell| is_of_shard(cell, args.shard, &definition)).cloned().collect();
    if args.list {
        return print_result(&own.iter().map(|cell| format!("{}\n", cell.name)).collect::<String>());
    }
    let methods = methods(&args.methods)?;
    let budgets = budgets(&args.budget)?;
    if let Some(twice) = args.external.iter().map(|e| &e.name).duplicates().next() {
        return Err(Error::input(
            "bad command line",
            "--external",
            format!("two programs are named {twice}"),
        ));
    }
    if let Some(folder) = args.output.as_ref().or(args.export.as_ref()) {
        check_output_dir(folder)?;
    }
    let settings = args.settings.as_deref().map(|path| earlier(path, &definition)).transpose()?;
    let run = Run {
        definition: &definition,
        cells: &own,
        methods: &methods,
        budgets: &budgets,
        externals: &args.external,
        data: args.data.clone(),
        settings: settings.as_ref().map(|(folder, _)| folder),
    };
    run.check()?;
    let renderer = Arc::new(Renderer::new(Gpu::open(args.adapter.as_deref())?));
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("results of finished cells remain");
    let mut done = 0;
    let mut watch = |step: &str| {
        // Searches may begin with a cell of another shard.
        done = own.iter().position(|cell| step.starts_with(&cell.name)).unwrap_or(done);
        let is_new_cell = own.get(done).is_some_and(|cell| cell.name == step);
        let kind = if is_new_cell { StepKind::Case } else { StepKind::Trial };
        let running = Step::new(kind, "");
        bar.show(&Status { step: &running, what: step, done, total: own.len(), left_s: None });
        if interrupt.is_requested() { Err(Error::cancelled(step)) } else { Ok(()) }
    };
    if let Some(folder) = &args.export {
        run.export(folder, &renderer, &mut watch)?;
        bar.finish_and_clear();
        return print_result(&format_args!("{}: {} cells\n", folder.display(), own.len()));
    }
    let Some(output) = &args.output else {
        let hashes = run.hashes(&renderer, &mut watch)?;
        bar.finish_and_clear();
        return print_result(&hashes);
    };
    let facts = Facts::of(renderer.gpu());
    let conditions = Conditions {
        version: definition.version,
        points: definition.points,
        methods: methods.iter().map(|entry| entry.name.to_owned()).collect(),
        budgets: budgets.iter().map(Budget::to_string).collect(),
        externals: args.external.iter().map(|e| format!("{}={}", e.name, e.command)).collect(),
        adapter: facts.adapter.clone(),
        driver: facts.driver.clone(),
        revision: facts.revision.into(),
        settings_revision: settings.as_ref().map(|(_, of)| of.revision.clone()),
    };
    let folder = Folder::open(output, &conditions)?;
    let measured = run.measure(&folder, &renderer, &mut watch);
    bar.finish_and_clear();
    measured.map_err(|e| if e.is_cancelled() { interrupted(output) } else { e })?;
    match args.shard {
        Some(shard) => print_result(&format_args!("shard {shard}: {} cells are measured\n", own.len())),
        None => publish(&cells, &folder, &facts),
    }
}

/// Opens earlier results, whose settings are measured again.
///
/// # Errors
/// The folder has no results of this benchmark.
fn earlier<'a>(path: &'a Path, definition: &Definition) -> Result<(Folder<'a>, Conditions)> {
    let refuse = |why: String| Error::input("cannot use --settings", path.display(), why);
    let (folder, of) =
        Folder::archived(path)?.ok_or_else(|| refuse("it has no results of the benchmark".into()))?;
    let is_same = of.version == definition.version;
    is_same.then_some((folder, of)).ok_or_else(|| refuse("its results are of another version".into()))
}

/// Writes tables and plots of all selected cells that the folder has results of.
fn publish(cells: &[Cell], folder: &Folder, facts: &Facts) -> Result<()> {
    let mut results = Vec::new();
    for cell in cells {
        results.extend(folder.result(cell)?);
    }
    let revisions = results.iter().map(|result| &*result.revision).unique().join(", ");
    let made_by = format!(
        "Adapter {} ({}), {} threads, revision {revisions}; {} of {} cells.",
        facts.adapter,
        facts.driver,
        facts.threads,
        results.len(),
        cells.len()
    );
    let (files, page) = pages::write(&results, &made_by, folder.path())?;
    print_result(&page)?;
    files.iter().for_each(|path| print_message("file", &path.display()));
    Ok(())
}

fn interrupted(output: &Path) -> Error {
    Error::runtime("interrupted", output.display(), "measured cells are recorded")
        .hint("the same command line continues")
}

/// Returns the methods with these names in the order of the registry, or all that have settings to search.
fn methods(names: &[String]) -> Result<Vec<&'static Entry>> {
    let tunable: Vec<&'static Entry> =
        METHODS.iter().copied().filter(|e| SearchSpace::of(e).is_some()).collect();
    let find = |name: &String| {
        let entry = tunable.iter().copied().find(|entry| entry.name == name.trim());
        entry.ok_or_else(|| {
            let all = tunable.iter().map(|entry| entry.name).join(", ");
            Error::input("unknown method", format!("--methods {name}"), format!("there are {all}"))
        })
    };
    let named = names.iter().map(find).collect::<Result<Vec<_>>>()?;
    let is_named = |entry: &&Entry| names.is_empty() || named.iter().any(|own| std::ptr::eq(*own, *entry));
    Ok(tunable.iter().copied().filter(|entry| is_named(entry)).collect())
}

/// Parses the budgets, and sorts them by kind and amount.
fn budgets(texts: &[String]) -> Result<Vec<Budget>> {
    let parse = |text: &String| Budget::parse_list(text).map_err(|e| e.at("--budget"));
    let all = texts.iter().map(parse).collect::<Result<Vec<_>>>()?.concat();
    Ok(all.into_iter().sorted_by(Budget::order).dedup().collect())
}

/// Whether a shard measures a cell. All cells of one volume and transfer function belong to one shard.
fn is_of_shard(cell: &Cell, shard: Option<Shard>, definition: &Definition) -> bool {
    let cells = definition.cells();
    let group = |cell: &Cell| cells.iter().dedup_by(|a, b| a.is_beside(b)).position(|c| c.is_beside(cell));
    shard.is_none_or(|shard| group(cell).is_some_and(|group| shard.holds(group)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_sorted_and_methods_are_known() {
        let texts = ["ms=50,bytes=4MiB".to_owned(), "bytes=1MiB,4MiB".to_owned()];
        let sorted = budgets(&texts).unwrap();
        assert_eq!(sorted, [Budget::Bytes(1 << 20), Budget::Bytes(4 << 20), Budget::Ms(50.0)]);
        assert!(methods(&[]).unwrap().len() >= 9);
        assert_eq!(methods(&["osm".into(), "dsm".into(), "osm".into()]).unwrap().len(), 2);
        assert_eq!(methods(&["none".into()]).err().map(|e| e.exit_status()), Some(2));
    }

    #[test]
    fn every_cell_belongs_to_one_shard_with_the_cells_beside_it() {
        let definition = Definition::frozen().unwrap();
        let shard = |index: u32| Some(Shard { index, of: 5 });
        for cell in definition.cells() {
            let shards: Vec<u32> = (1..=5).filter(|i| is_of_shard(&cell, shard(*i), &definition)).collect();
            assert_eq!(shards.len(), 1, "{}", cell.name);
            let first = definition.cells().iter().find(|c| c.is_beside(&cell)).cloned().unwrap();
            assert!(is_of_shard(&first, shard(shards[0]), &definition));
        }
    }
}
