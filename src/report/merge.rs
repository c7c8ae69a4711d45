//! Merges the result folders of a comparison measured in parts (shards) into one table, without new measurements.
//!
//! The folders must agree in program, scenes (settings, and SHA-256 of input files), number of samples and budgets.
//! Rows of several graphics adapters are not mixed: each adapter has its own Pareto front, plots and colour scale.

use super::Start;
use super::made::{Made, ReferencePicture};
use super::make::{Files, node_map};
use super::names;
use super::run::{RowRecord, Run};
use super::tables::Layout;
use super::writers::table_json;
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::files::picture::read_exr;
use crate::measure::comparison::{Compared, take_differences};
use crate::measure::pareto::mark_pareto;
use crate::measure::row_measurements::set_frames;
use crate::measure::table::Row;
use crate::shadow::NodeMap;
use itertools::Itertools as _;
use ndarray::Array2;
use ndarray_npy::read_npy;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

const WHAT: &str = "cannot merge";
/// Largest number of missing table rows that the error message of a merge names.
const MOST_NAMED: usize = 3;
/// Number of nodes that no texel of a deep shadow map reaches.
const MOST_NODES: i32 = 1 << 20;

/// Result folder of one shard (part of a comparison), to be merged with others into one table.
struct Part {
    folder: PathBuf,
    run: Run,
    /// Measured rows of the comparison table in this folder, in the order of `run.json`.
    rows: Vec<Row>,
    /// Settings of shadow methods that this folder's search within a budget tried, one measured row each.
    trials: Vec<Row>,
}

/// Comparison merged from several result folders and not yet written.
pub struct Merged {
    made: Made,
    /// Picture files to copy from the merged folders into the output folder, with their new names.
    copies: Vec<(PathBuf, String)>,
    tf_texts: Vec<Option<String>>,
}

/// Row of the merged comparison table, and the result folder from which it comes.
struct Place<'a> {
    part: &'a Part,
    record: &'a RowRecord,
    row: &'a Row,
}

impl<'a> Place<'a> {
    /// Scene index and shadow method that identify a row of the merged table.
    fn wanted(&self) -> (usize, &'a str) {
        (self.record.scene, &self.record.method)
    }
}

/// Reads result folders and merges their comparison tables. With `partial`, rows that no folder contains may be
/// missing.
///
/// # Errors
/// A folder contains no finished table, two folders are not from one comparison, or a row is in two folders or in
/// none.
pub fn merge(folders: &[PathBuf], partial: bool) -> Result<Merged> {
    let parts = folders.iter().map(|folder| Part::read(folder)).collect::<Result<Vec<_>>>()?;
    let [first, others @ ..] = &parts[..] else {
        return Err(Error::input(WHAT, "command line", "no folder is given"));
    };
    others.iter().try_for_each(|other| agree(first, other))?;

    let rows = parts.iter().flat_map(|part| &part.run.rows);
    let wanted: Vec<(usize, &str)> = rows.map(|row| (row.scene, row.method.as_str())).unique().collect();
    let adapters: Vec<String> = parts.iter().map(|part| part.run.adapter.clone()).unique().collect();
    let places = places(&parts, &adapters, &wanted)?;
    let missing: Vec<_> = wanted.iter().filter(|w| places.iter().all(|p| p.wanted() != **w)).collect();
    if !partial && !missing.is_empty() {
        let named = missing.iter().take(MOST_NAMED).map(|(_, method)| method).join(", ");
        let more = if missing.len() > MOST_NAMED { ", ..." } else { "" };
        let why = format!("{} of {} rows are in none of them: {named}{more}", missing.len(), wanted.len());
        return Err(Error::input(WHAT, folders.iter().map(|f| f.display()).join(", "), why)
            .hint("measure the missing shards, or merge what there is with --partial"));
    }
    assemble(&parts, adapters, &places, missing.len())
}

impl Part {
    fn read(folder: &Path) -> Result<Self> {
        let refuse = |why: String| Error::input(WHAT, folder.display(), why);
        let run = Run::read(folder)?
            .ok_or_else(|| refuse("it holds no table of `compare`: run.json is missing".into()))?;
        if !run.finished {
            return Err(refuse("its table is not finished".into())
                .hint("the command line that began it, with --resume, goes on with it"));
        }
        if run.merged.len() > 1 && run.adapters.len() > 1 {
            return Err(refuse("it is merged from several adapters".into()).hint("merge its parts instead"));
        }
        let table = folder.join("compare.csv");
        let rows = read_rows(&table)?;
        let records: Vec<_> = run.rows.iter().filter(|r| r.here).collect();
        let fits = |(row, record): (&Row, &&RowRecord)| {
            record.is_of(row) && run.scenes.get(record.scene).is_some_and(|s| s.name == row.scene)
        };
        if rows.len() != records.len() || !rows.iter().zip(&records).all(fits) {
            return Err(Error::input(WHAT, table.display(), "its rows are not those that run.json names"));
        }
        let trials = folder.join("trials.csv");
        // `trials.csv` does not exist if nothing was tuned.
        let tuned = !run.budgets.is_empty() && trials.is_file();
        let trials = if tuned { read_rows(&trials)? } else { Vec::new() };
        Ok(Self { folder: folder.into(), run, rows, trials })
    }
}

/// Reads the rows of a comparison table from a CSV file.
fn read_rows(path: &Path) -> Result<Vec<Row>> {
    let broken = |why: &dyn fmt::Display| Error::input(WHAT, path.display(), why);
    let mut reader = csv::Reader::from_path(path).map_err(|e| broken(&e))?;
    let row = |line: csv::Result<_>| {
        let texts = line.map_err(|e| broken(&e))?;
        Row::from_texts(&texts).map_err(|column| broken(&format!("`{column}` has no such value")))
    };
    reader.deserialize().map(row).collect()
}

/// Returns an error if two result folders differ in program, scenes, number of samples, budgets or driver of the same
/// adapter.
fn agree(first: &Part, other: &Part) -> Result<()> {
    let (a, b) = (&first.run, &other.run);
    let refuse = |why: String| {
        Err(Error::input(WHAT, other.folder.display(), format!("{why} (against {})", first.folder.display())))
    };
    let program = |run: &Run| format!("{} {} {}", run.version, run.revision, run.profile);
    if program(a) != program(b) {
        return refuse(format!("it was measured by {}, not {}", program(b), program(a)));
    }
    if a.budgets != b.budgets {
        let said = |run: &Run| match run.budgets.join(", ") {
            none if none.is_empty() => "nothing".into(),
            budgets => budgets,
        };
        return refuse(format!("it is tuned within {}, not {}", said(b), said(a)));
    }
    if let Some(why) = a.sweep_differs(b) {
        return refuse(why);
    }
    if a.adapter == b.adapter && a.driver != b.driver {
        return refuse(format!("its driver of {} is {}, not {}", a.adapter, b.driver, a.driver));
    }
    Ok(())
}

/// Sorts the rows of all merged comparison tables by scene, then by graphics adapter, then by shadow method. Returns
/// an error if two folders contain the same row.
fn places<'a>(parts: &'a [Part], adapters: &[String], wanted: &[(usize, &str)]) -> Result<Vec<Place<'a>>> {
    let of = |part: &'a Part| {
        let records = part.run.rows.iter().filter(|r| r.here);
        records.zip(&part.rows).map(move |(record, row)| Place { part, record, row })
    };
    let mut places: Vec<Place> = parts.iter().flat_map(of).collect();
    let key = |p: &Place| {
        let adapter = adapters.iter().position(|a| *a == p.part.run.adapter);
        (p.record.scene, adapter, wanted.iter().position(|w| *w == p.wanted()))
    };
    places.sort_by_key(key);
    match places.iter().tuple_windows().find(|(a, b)| key(a) == key(b)) {
        Some((first, second)) => {
            let why = format!("{} is in {} too", second.record.method, first.part.folder.display());
            Err(Error::input(WHAT, second.part.folder.display(), why))
        }
        None => Ok(places),
    }
}

/// Builds the merged comparison from its sorted table rows: run description, notes, pictures, and picture files to
/// copy.
fn assemble(parts: &[Part], adapters: Vec<String>, places: &[Place], missing: usize) -> Result<Merged> {
    let mut run = parts[0].run.clone();
    run.shard = None;
    run.merged = parts.iter().map(|p| p.folder.display().to_string()).collect();
    run.adapter = adapters.join("; ");
    run.driver = parts.iter().map(|p| &p.run.driver).unique().join("; ");
    run.methods = places.iter().map(|p| &p.record.method).unique().join(";");
    run.conditions = conditions(parts);
    run.adapters = if adapters.len() > 1 { adapters } else { Vec::new() };
    (run.command, run.rows) = (Vec::new(), Vec::new());
    let mut merged = Merged { made: Made::default(), copies: Vec::new(), tf_texts: tf_texts(parts)? };
    let made = &mut merged.made;
    made.comparison.notes = parts.iter().flat_map(|p| p.run.notes.clone()).unique().collect();
    made.comparison.notes.push(format!("merged from {} runs: times are from each in turn", parts.len()));
    if missing > 0 {
        made.comparison.notes.push(format!("{missing} rows of the sweep are missing"));
    }
    let unmerged = [(run.ablate, "ablation tables"), (run.pages, "pages for browsers")];
    let unmerged = unmerged.into_iter().filter(|(made, _)| *made);
    made.comparison.notes.extend(unmerged.map(|(_, name)| format!("{name} of the parts are not merged")));
    (run.ablate, run.pages) = (false, false);
    made.comparison.trials = parts.iter().flat_map(|p| p.trials.clone()).collect();
    for place in places {
        let source = |name: String| place.part.folder.join(name);
        let adapter_part = match run.adapters.len() {
            0 => String::new(),
            _ => names::adapter_prefix("", &place.part.run.adapter),
        };
        let slug = format!("{adapter_part}{}", place.record.slug);
        let [from, to] = [&place.record.slug, &slug].map(|slug| names::picture(slug));
        let exr = source(format!("{from}.exr"));
        let picture = if exr.is_file() { Some(read_exr(&exr)?) } else { None };
        if picture.is_none() && !place.row.has_failed() {
            return Err(Error::input(WHAT, exr.display(), "the picture is missing"));
        }
        let copied = ["png", "exr"].into_iter().filter(|_| picture.is_some());
        merged.copies.extend(copied.map(|e| (source(format!("{from}.{e}")), format!("{to}.{e}"))));
        let nodes = source(names::nodes(&place.record.slug));
        let nodes = if nodes.is_file() { Some(read_nodes(&nodes)?) } else { None };
        run.rows.push(RowRecord { slug: slug.clone(), here: true, ..place.record.clone() });
        made.comparison.compared.push(Compared {
            row: place.row.clone(),
            method: place.record.method.clone(),
            slug,
            picture,
            difference: None,
            left_out: Vec::new(),
            nodes,
        });
    }
    made.run = run;
    differences(made, parts)?;
    set_frames(made.comparison.compared.iter_mut().map(|c| &mut c.row));
    mark_pareto(made.comparison.compared.iter_mut().map(|c| &mut c.row));
    Ok(merged)
}

/// Reads the nodes of each texel of a deep shadow map.
///
/// # Errors
/// The file is unreadable, or a number in it is impossible.
fn read_nodes(path: &Path) -> Result<NodeMap> {
    let broken = |why: String| Error::input(WHAT, path.display(), why);
    let signed: Array2<i32> = read_npy(path).map_err(|e| broken(e.to_string()))?;
    let is_possible = signed.iter().all(|n| (-1..MOST_NODES).contains(n));
    is_possible.then(|| node_map(&signed)).ok_or_else(|| broken("it has impossible numbers of nodes".into()))
}

/// Merges the measurement conditions of all result folders; differing values of one condition are joined with
/// semicolons.
fn conditions(parts: &[Part]) -> Vec<(String, String)> {
    let all = || parts.iter().flat_map(|p| &p.run.conditions);
    let values = |name| all().filter(|(n, _)| n == name).map(|(_, value)| value).unique().join("; ");
    all().map(|(name, _)| name).unique().map(|name| (name.clone(), values(name))).collect()
}

/// Returns the text of each scene's transfer-function file, from the first merged folder that contains it.
fn tf_texts(parts: &[Part]) -> Result<Vec<Option<String>>> {
    let of = |i: usize, file: &str| {
        let text = parts.iter().find_map(|p| fs::read_to_string(p.folder.join(file)).ok());
        let name = &parts[0].run.scenes[i].name;
        text.ok_or_else(|| Error::input(WHAT, file, format!("the transfer function of {name} is missing")))
    };
    let scenes = parts[0].run.scenes.iter().enumerate();
    scenes.map(|(i, s)| if s.tf_file.is_empty() { Ok(None) } else { of(i, &s.tf_file).map(Some) }).collect()
}

/// Computes the difference of each merged picture from the reference picture (one shadow ray per sample) of its scene
/// and graphics adapter. The reference belongs to a table row or is a file of its own in a merged folder.
fn differences(made: &mut Made, parts: &[Part]) -> Result<()> {
    let group = |c: &Compared| (c.row.scene.clone(), c.row.adapter.clone());
    let compared = &mut made.comparison.compared;
    for wanted in compared.iter().map(group).unique().collect::<Vec<_>>() {
        let (scene, adapter) = &wanted;
        let rays = compared.iter().find(|c| c.is_reference() && group(c) == wanted);
        let mut pixels = rays.and_then(|c| c.picture.clone());
        if pixels.is_none() {
            let prefix = names::prefix(scene, made.run.scenes.len() > 1);
            let file = format!("{}.exr", names::reference(&prefix));
            let own = parts.iter().filter(|part| part.run.adapter == *adapter);
            let drawn = own.map(|part| part.folder.join(&file)).find(|path| path.is_file());
            pixels = drawn.map(|path| read_exr(&path)).transpose()?;
            let (scene, adapter) = wanted.clone();
            made.references.extend(pixels.clone().map(|pixels| ReferencePicture { scene, adapter, pixels }));
        }
        if let Some(pixels) = pixels {
            let mut own: Vec<_> = compared.iter_mut().filter(|c| group(c) == wanted).collect();
            take_differences(&mut own, &pixels)?;
        }
    }
    Ok(())
}

impl Merged {
    /// Rows of the merged comparison table, in order.
    pub fn rows(&self) -> Vec<Row> {
        self.made.comparison.rows()
    }

    /// Returns the rows of the merged comparison table as the text of `compare.json`.
    ///
    /// # Errors
    /// See [`table_json`].
    pub fn json(&self) -> Result<String> {
        table_json(&self.rows(), &self.made.run)
    }

    /// Returns an error if the output folder already contains a comparison table and `start` does not allow to
    /// replace it.
    ///
    /// # Errors
    /// Input error: the folder contains a table.
    pub fn check(&self, folder: &Path, start: Start) -> Result<()> {
        self.made.run.check(folder, start)
    }

    /// Writes the merged table with its plots, pictures and report into an existing folder.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn write(mut self, folder: &Path, start: Start, layout: &Layout) -> Result<Files> {
        self.made.run.begin(folder, start, &self.tf_texts)?;
        for (from, name) in &self.copies {
            let bytes = fs::read(from).map_err(|e| Error::runtime("cannot read file", from.display(), e))?;
            write_whole(&folder.join(name), |file| file.write_all(&bytes))?;
        }
        self.made.write(folder, layout)
    }
}
