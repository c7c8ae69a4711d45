//! Shards put together: folders of one sweep become one table, without measuring anything.
//!
//! They must agree in program, scenes (setting by setting, and by the SHA-256 of what was read), effort and budgets. Rows from
//! several adapters stay apart: each adapter has its own front, plots and scale.

use super::Start;
use super::made::{Made, ReferencePicture, take_differences};
use super::make::{Files, node_map};
use super::names;
use super::run::{RowRecord, Run, scenes_differ};
use super::tables::Layout;
use super::writers::table_json;
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::files::picture::read_exr;
use crate::measure::budget::Trial;
use crate::measure::comparison::Compared;
use crate::measure::job::Effort;
use crate::measure::table::{Row, mark_pareto};
use crate::shadow::{Method, ShadowRays};
use ndarray::Array2;
use ndarray_npy::ReadNpyExt;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

const WHAT: &str = "cannot merge";
/// So many missing rows are named.
const MOST_NAMED: usize = 3;

/// A folder that is read.
struct Part {
    folder: PathBuf,
    run: Run,
    /// Measured rows of this folder, in the order of their records.
    rows: Vec<Row>,
    /// Trials of the folder's searches within budgets.
    trials: Vec<Trial>,
}

/// Tables that have been put together, not yet written.
pub struct Merged {
    made: Made,
    /// Files to be taken over, and what they are called.
    copies: Vec<(PathBuf, String)>,
    tf_texts: Vec<Option<String>>,
}

/// A row's place in the merged table.
struct Place<'a> {
    scene: usize,
    adapter: usize,
    row: usize,
    part: &'a Part,
    record: &'a RowRecord,
    values: &'a Row,
}

/// Reads folders and puts their rows together; with `partial`, rows that none of them has may be missing.
///
/// # Errors
/// A folder that holds no finished table, two that do not belong together, a row that is in two of them or in none.
pub fn merge(folders: &[PathBuf], partial: bool) -> Result<Merged> {
    let parts = folders.iter().map(|folder| Part::read(folder)).collect::<Result<Vec<_>>>()?;
    let [first, others @ ..] = &parts[..] else {
        return Err(Error::input(WHAT, "command line", "no folder is given"));
    };
    others.iter().try_for_each(|other| agree(first, other))?;

    let mut adapters: Vec<String> = Vec::new();
    let mut wanted: Vec<(usize, &str)> = Vec::new();
    for part in &parts {
        if !adapters.contains(&part.run.adapter) {
            adapters.push(part.run.adapter.clone());
        }
        for row in &part.run.rows {
            if !wanted.contains(&(row.scene, row.method.as_str())) {
                wanted.push((row.scene, &row.method));
            }
        }
    }
    let places = places(&parts, &adapters, &wanted)?;
    let missing: Vec<_> = wanted
        .iter()
        .filter(|w| !places.iter().any(|p| (p.record.scene, &*p.record.method) == **w))
        .collect();
    if !partial && !missing.is_empty() {
        let named: Vec<_> = missing.iter().take(MOST_NAMED).map(|(_, method)| *method).collect();
        let more = if missing.len() > MOST_NAMED { ", ..." } else { "" };
        let why = format!(
            "{} of {} rows are in none of them: {}{more}",
            missing.len(),
            wanted.len(),
            named.join(", ")
        );
        return Err(Error::input(WHAT, shown(folders), why)
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
        let broken = |why: String| Error::input(WHAT, table.display(), why);
        let mut reader = csv::Reader::from_path(&table).map_err(|e| broken(e.to_string()))?;
        let mut rows = Vec::new();
        for line in reader.deserialize::<BTreeMap<String, String>>() {
            let texts = line.map_err(|e| broken(e.to_string()))?;
            let row = Row::from_texts(&texts).map_err(|c| broken(format!("`{c}` has no such value")))?;
            rows.push(row);
        }
        let records: Vec<_> = run.rows.iter().filter(|r| r.here).collect();
        let fits = |(row, record): (&Row, &&RowRecord)| {
            record.is_of(row) && run.scenes.get(record.scene).is_some_and(|s| s.name == row.scene)
        };
        if rows.len() != records.len() || !rows.iter().zip(&records).all(fits) {
            return Err(broken("its rows are not those that run.json names".into()));
        }
        let trials = if run.budgets.is_empty() { Vec::new() } else { trials(&folder.join("trials.csv"))? };
        Ok(Self { folder: folder.into(), run, rows, trials })
    }
}

/// Reads the trials of searches within budgets; empty if the file does not exist, since nothing was tuned.
fn trials(path: &Path) -> Result<Vec<Trial>> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let broken = |e: csv::Error| Error::input(WHAT, path.display(), e);
    let mut reader = csv::Reader::from_path(path).map_err(broken)?;
    reader.deserialize().collect::<Result<_, _>>().map_err(broken)
}

/// Refuses what is of another program, other scenes, another effort or another driver of the same adapter.
fn agree(first: &Part, other: &Part) -> Result<()> {
    let (a, b) = (&first.run, &other.run);
    let refuse = |why: String| {
        Err(Error::input(WHAT, other.folder.display(), format!("{why} (against {})", first.folder.display())))
    };
    let program = |run: &Run| format!("{} {} {}", run.version, run.revision, run.profile);
    if program(a) != program(b) {
        return refuse(format!("it was measured by {}, not {}", program(b), program(a)));
    }
    let effort = |run: &Run| Effort { repeats: 0, ..run.effort };
    if effort(a) != effort(b) {
        return refuse("its errors are of other numbers of points, rays or depths".into());
    }
    if a.budgets != b.budgets {
        let said = |run: &Run| match run.budgets.join(", ") {
            none if none.is_empty() => "nothing".into(),
            budgets => budgets,
        };
        return refuse(format!("it is tuned within {}, not {}", said(b), said(a)));
    }
    if let Some(why) = scenes_differ(&a.scenes, &b.scenes) {
        return refuse(why);
    }
    if a.adapter == b.adapter && a.driver != b.driver {
        return refuse(format!("its driver of {} is {}, not {}", a.adapter, b.driver, a.driver));
    }
    Ok(())
}

/// The rows in the order of the sweep: scene by scene, and in each adapter by adapter.
fn places<'a>(parts: &'a [Part], adapters: &[String], wanted: &[(usize, &str)]) -> Result<Vec<Place<'a>>> {
    let mut places: Vec<Place> = Vec::new();
    for part in parts {
        let adapter = adapters.iter().position(|a| *a == part.run.adapter).unwrap_or_default();
        for (record, values) in part.run.rows.iter().filter(|r| r.here).zip(&part.rows) {
            let key = (record.scene, record.method.as_str());
            let row = wanted.iter().position(|w| *w == key).unwrap_or_default();
            if let Some(twice) = places.iter().find(|p| (p.row, p.adapter) == (row, adapter)) {
                let why = format!("{} is in {} too", record.method, twice.part.folder.display());
                return Err(Error::input(WHAT, part.folder.display(), why));
            }
            places.push(Place { scene: record.scene, adapter, row, part, record, values });
        }
    }
    places.sort_by_key(|p| (p.scene, p.adapter, p.row));
    Ok(places)
}

/// The merged table of rows in their order.
fn assemble(parts: &[Part], adapters: Vec<String>, places: &[Place], missing: usize) -> Result<Merged> {
    let mut run = parts[0].run.clone();
    run.shard = None;
    run.merged = parts.iter().map(|p| p.folder.display().to_string()).collect();
    run.adapter = adapters.join("; ");
    let unique = |texts: &mut dyn Iterator<Item = String>| {
        let mut all: Vec<String> = Vec::new();
        texts.for_each(|text| {
            if !all.contains(&text) {
                all.push(text)
            }
        });
        all
    };
    run.driver = unique(&mut parts.iter().map(|p| p.run.driver.clone())).join("; ");
    run.methods = unique(&mut places.iter().map(|p| p.record.method.clone())).join(";");
    run.conditions = conditions(parts);
    run.adapters = if adapters.len() > 1 { adapters } else { Vec::new() };
    (run.command, run.rows) = (Vec::new(), Vec::new());
    let mut merged = Merged { made: Made::default(), copies: Vec::new(), tf_texts: tf_texts(parts)? };
    let made = &mut merged.made;
    made.comparison.notes = unique(&mut parts.iter().flat_map(|p| p.run.notes.clone()));
    made.comparison.notes.push(format!("merged from {} runs: times are from each in turn", parts.len()));
    if missing > 0 {
        made.comparison.notes.push(format!("{missing} rows of the sweep are missing"));
    }
    made.comparison.trials = parts.iter().flat_map(|p| p.trials.clone()).collect();
    for place in places {
        let source = |name: String| place.part.folder.join(name);
        let adapter_part = match run.adapters.len() {
            0 => String::new(),
            _ => names::adapter_prefix("", &place.part.run.adapter),
        };
        let slug = format!("{adapter_part}{}", place.record.slug);
        let exr = source(format!("{}.exr", names::picture(&place.record.slug)));
        let picture = if exr.is_file() { Some(read_exr(&exr)?) } else { None };
        if picture.is_none() && !place.values.has_failed() {
            return Err(Error::input(WHAT, exr.display(), "the picture is missing"));
        }
        if picture.is_some() {
            for ending in ["png", "exr"] {
                let from = source(format!("{}.{ending}", names::picture(&place.record.slug)));
                merged.copies.push((from, format!("{}.{ending}", names::picture(&slug))));
            }
        }
        made.nodes.push(match File::open(source(names::nodes(&place.record.slug))) {
            Ok(file) => Array2::<i32>::read_npy(file).ok().map(|signed| node_map(&signed)),
            Err(_) => None,
        });
        let row = place.values.clone();
        run.rows.push(RowRecord { slug: slug.clone(), here: true, ..place.record.clone() });
        made.comparison.compared.push(Compared {
            row,
            method: place.record.method.clone(),
            slug,
            picture,
            difference: None,
            left_out: Vec::new(),
        });
    }
    made.run = run;
    differences(made, parts)?;
    mark_pareto(&mut made.comparison.compared.iter_mut().map(|c| &mut c.row).collect::<Vec<_>>());
    Ok(merged)
}

/// Merges the measurement conditions of all parts; differing values of a condition are joined with semicolons.
fn conditions(parts: &[Part]) -> Vec<(String, String)> {
    let mut all: Vec<(String, Vec<String>)> = Vec::new();
    for (name, value) in parts.iter().flat_map(|p| &p.run.conditions) {
        match all.iter_mut().find(|(n, _)| n == name) {
            Some((_, values)) if values.contains(value) => {}
            Some((_, values)) => values.push(value.clone()),
            None => all.push((name.clone(), vec![value.clone()])),
        }
    }
    all.into_iter().map(|(name, values)| (name, values.join("; "))).collect()
}

/// The transfer functions' files, scene by scene, from whichever folder has them.
fn tf_texts(parts: &[Part]) -> Result<Vec<Option<String>>> {
    let of = |i: usize, file: &str| {
        let text = parts.iter().find_map(|p| fs::read_to_string(p.folder.join(file)).ok());
        let name = &parts[0].run.scenes[i].name;
        text.ok_or_else(|| Error::input(WHAT, file, format!("the transfer function of {name} is missing")))
    };
    let scenes = parts[0].run.scenes.iter().enumerate();
    scenes.map(|(i, s)| if s.tf_file.is_empty() { Ok(None) } else { of(i, &s.tf_file).map(Some) }).collect()
}

/// Fills where pictures differ from that by `rays` of the same scene and adapter: a row, or what a part has drawn for it.
fn differences(made: &mut Made, parts: &[Part]) -> Result<()> {
    let group = |row: &Row| (row.scene.clone(), row.adapter.clone());
    let mut groups: Vec<_> = made.comparison.compared.iter().map(|c| group(&c.row)).collect();
    groups.dedup();
    for wanted in groups {
        let is_own = |c: &&mut Compared| group(&c.row) == wanted;
        let compared = &mut made.comparison.compared;
        let rays =
            compared.iter().find(|c| c.row.method == ShadowRays::default().name() && group(&c.row) == wanted);
        let pixels = match rays.and_then(|c| c.picture.clone()) {
            Some(pixels) => Some(pixels),
            None => {
                let of = |part: &&Part| part.run.adapter == wanted.1;
                let name = names::prefix(&wanted.0, made.run.scenes.len() > 1);
                let file = format!("{}.exr", names::reference(&name));
                let drawn = parts.iter().filter(of).map(|p| p.folder.join(&file)).find(|p| p.is_file());
                let pixels = drawn.map(|path| read_exr(&path)).transpose()?;
                made.references.extend(pixels.iter().map(|pixels| ReferencePicture {
                    scene: wanted.0.clone(),
                    adapter: wanted.1.clone(),
                    pixels: pixels.clone(),
                }));
                pixels
            }
        };
        if let Some(pixels) = pixels {
            let mut own: Vec<&mut Compared> = compared.iter_mut().filter(is_own).collect();
            take_differences(&mut own, &pixels)?;
        }
    }
    Ok(())
}

impl Merged {
    /// The rows, in their order.
    pub fn rows(&self) -> Vec<Row> {
        self.made.comparison.rows()
    }

    /// The rows as `compare.json` has them.
    ///
    /// # Errors
    /// See [`table_json`].
    pub fn json(&self) -> Result<String> {
        table_json(&self.rows(), &self.made.run)
    }

    /// Refuses an output folder that holds a table, unless that is to go.
    ///
    /// # Errors
    /// That, as a fault of the command line.
    pub fn check(&self, folder: &Path, start: Start) -> Result<()> {
        self.made.run.check(folder, start)
    }

    /// Writes the table with all that belongs to it into a folder that exists.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn write(mut self, folder: &Path, start: Start, layout: &Layout) -> Result<Files> {
        self.made.run.begin(folder, start, &self.tf_texts)?;
        for (from, name) in &self.copies {
            let bytes = fs::read(from).map_err(|e| Error::runtime("cannot read file", from.display(), e))?;
            write_whole(&folder.join(name), |file| file.write_all(&bytes))?;
        }
        self.made.write(folder, layout)
    }
}

fn shown(folders: &[PathBuf]) -> String {
    folders.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", ")
}
