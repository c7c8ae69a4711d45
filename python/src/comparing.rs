//! Comparison of shadow methods on one scene (error, time and memory), returned to Python as dictionaries.

use crate::arguments::Request;
use crate::fault::{Fault, Outcome};
use crate::interrupts::Cancellation;
use crate::volume::InputVolume;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList, PyString};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use umbravox::Error;
use umbravox::error::Result;
use umbravox::files::output::{check_output_dir, prepare_output_dir};
use umbravox::measure::budget::Budget;
use umbravox::measure::facts::Facts;
use umbravox::measure::job::{Checked, Effort};
use umbravox::measure::journal::Journal;
use umbravox::measure::progress::{Progress, Status, Watch};
use umbravox::measure::table::{COLUMNS, Cell, Row};
use umbravox::open::Loaded;
use umbravox::open::provenance::{RecordedScene, function_text};
use umbravox::render::Renderer;
use umbravox::report::Start;
use umbravox::report::make::{Order, Subject, make, scene_name};
use umbravox::report::run::{Run, SceneRecord};
use umbravox::report::tables::Layout;
use umbravox::scene::Scene;
use umbravox::shadow::{COMPARED, parse_distinct};
use umbravox::transfer::TransferFunction;

/// Progress of a long computation, reported to Python: finished and total steps, the running step, and the time left.
pub struct Step {
    done: usize,
    total: usize,
    what: String,
    left_s: Option<f64>,
}

impl Step {
    /// Creates a progress report for Python: `done` of `total` steps are finished, and the step `what` is running.
    pub fn of(done: usize, total: usize, what: &str) -> Self {
        Self { done, total, what: what.to_owned(), left_s: None }
    }
}

/// Receiver of progress reports: a Python callable, or the progress line on stderr of `progress=True`.
pub struct ProgressListener(Option<Py<PyAny>>);

/// Creates the receiver of progress reports from the Python argument `progress`.
pub fn progress_listener(py: Python<'_>, progress: Option<&Bound<'_, PyAny>>) -> PyResult<ProgressListener> {
    let Some(given) = progress else { return Ok(ProgressListener(None)) };
    Ok(ProgressListener(match given.cast::<PyBool>() {
        Ok(on) if on.is_true() => Some(py.import("umbravox._progress")?.getattr("Line")?.call0()?.unbind()),
        Ok(_) => None,
        Err(_) => Some(given.clone().unbind()),
    }))
}

impl ProgressListener {
    /// Reports the progress of a long computation to the Python callable.
    pub fn report(&self, py: Python<'_>, step: Step) -> PyResult<()> {
        let Some(callable) = &self.0 else { return Ok(()) };
        let dict = PyDict::new(py);
        dict.set_item("done", step.done)?;
        dict.set_item("total", step.total)?;
        dict.set_item("what", step.what)?;
        dict.set_item("left_s", step.left_s)?;
        callable.call1(py, (dict,)).map(|_| ())
    }
}

/// Settings of a measured comparison table of shadow methods. Fields have the names of `umbravox compare` flags.
pub struct Table {
    pub methods: Option<String>,
    pub budgets: Option<String>,
    pub effort: Effort,
    pub output: Option<PathBuf>,
    pub overwrite: bool,
    pub resume: bool,
}

/// Scene on which a comparison table measures the shadow methods.
pub struct ComparedScene {
    subject: Subject,
    record: SceneRecord,
    /// Text of the scene's transfer function file; `None` for a preset.
    tf_text: Option<String>,
}

/// Results of a comparison of shadow methods: measured table rows, notes, and failures.
pub struct Rows {
    rows: Vec<Row>,
    /// Notes for the reader of the comparison table of shadow methods.
    pub notes: Vec<String>,
    /// Names of the comparison table's rows that could not be measured, with reasons.
    failures: Vec<String>,
}

/// Creates the measurement settings of a comparison table from the numbers of repeats, sample points, light rays,
/// depths, and steps over which flicker is measured.
pub fn effort(given: [Option<i64>; 5], check: &str) -> Outcome<Effort> {
    let all = [Checked::Sample, Checked::All, Checked::Points];
    let Some(check) = all.into_iter().find(|extent| extent.name() == check) else {
        let why = format!("`{check}` is not sample, all or points");
        return Err(Fault::input("bad argument", "check", why));
    };
    let mut effort = Effort { check, ..Effort::default() };
    if given[0].is_some() {
        effort.short_repeats = 0;
    }
    let fields = [
        ("repeats", Effort::REPEATS, &mut effort.repeats),
        ("points", Effort::POINTS, &mut effort.points),
        ("rays", Effort::RAYS, &mut effort.rays),
        ("depths", Effort::DEPTHS, &mut effort.depths),
        ("flicker", Effort::FLICKER, &mut effort.flicker),
    ];
    for (given, (name, range, value)) in given.into_iter().zip(fields) {
        let Some(n) = given else { continue };
        if !range.contains(&n) {
            let why = format!("{n} is not in {}..={}", range.start(), range.end());
            return Err(Fault::input("bad argument", name, why));
        }
        *value = n as usize;
    }
    Ok(effort)
}

/// Returns the text of a Python string, or of a list of strings joined by `joint`.
pub fn texts(given: Option<&Bound<'_, PyAny>>, name: &str, joint: &str) -> Outcome<Option<String>> {
    let Some(given) = given else { return Ok(None) };
    if let Ok(text) = given.cast::<PyString>() {
        return Ok(Some(text.extract()?));
    }
    let texts: Vec<String> = given
        .extract()
        .map_err(|_| Fault::input("bad argument", name, "expected a text, or a list of texts"))?;
    Ok(Some(texts.join(joint)))
}

impl Table {
    /// Copies the scene that the comparison table measures, so that it does not depend on the Python object.
    pub fn compared_scene(
        &self,
        loaded: &Loaded,
        request: &Request,
        scene: Scene,
        input: &InputVolume,
    ) -> Result<ComparedScene> {
        let name = request.settings.name.clone().unwrap_or_else(|| scene_name(&loaded.volume, &loaded.tf));
        let (record, tf_text) = match (&self.output, input.is_of_files()) {
            (None, _) => {
                let size = [scene.width, scene.height];
                (SceneRecord { name, size, ..SceneRecord::default() }, None)
            }
            (Some(_), false) => {
                let why = "the volume is an array, from which the results could not be reproduced";
                return Err(Error::input("cannot write table", "output", why)
                    .hint("save the volume to a file, and make the scene of that"));
            }
            (Some(_), true) => {
                let own = request.function.as_ref().map(TransferFunction::to_json);
                let tf_text = own.map_or_else(|| function_text(loaded), |text| Ok(Some(text)))?;
                let recorded = RecordedScene::of(request.settings.clone(), loaded, tf_text, &name, false)?;
                (recorded.record, recorded.tf_text)
            }
        };
        let subject = Subject {
            volume: Arc::clone(&loaded.volume),
            tf: loaded.tf.clone(),
            strands: loaded.strands.clone(),
            scene,
            forced: request.settings.disabled_optimizations(),
        };
        Ok(ComparedScene { subject, record, tf_text })
    }

    /// Measures all rows of the comparison table of shadow methods, and writes its files if there is an output
    /// folder.
    pub fn measured(
        &self,
        compared: ComparedScene,
        renderer: &Arc<Renderer>,
        cancellation: &Cancellation,
        sender: &Sender<Step>,
    ) -> Result<Rows> {
        let list = self.methods.as_deref().unwrap_or(&COMPARED);
        let methods = parse_distinct(list).map_err(|e| e.at("methods"))?;
        let budgets = self.budgets.as_deref().map(Budget::parse_list).transpose();
        let budgets = budgets.map_err(|e| e.at("budget"))?.unwrap_or_default();
        Budget::check_methods(&budgets, &methods).map_err(|e| e.at("methods"))?;
        let ComparedScene { subject, record, tf_text } = compared;
        let facts = Facts::of(renderer.gpu());
        let mut run = Run::new(&facts, self.effort, list, &methods, vec![record], None);
        run.budgets = budgets.iter().map(Budget::to_string).collect();
        let start = match (self.resume, self.overwrite) {
            (true, _) => Start::Resume,
            (_, true) => Start::Overwrite,
            _ => Start::New,
        };
        let mut journal = match &self.output {
            Some(folder) => {
                check_output_dir(folder)?;
                run.check(folder, start)?;
                prepare_output_dir(folder)?;
                let journal = Journal::open(folder, self.resume)?;
                run.begin(folder, start, &[tf_text])?;
                journal
            }
            None => Journal::nowhere(),
        };
        let methods = [methods];
        let order = Order { methods: &methods, budgets: &budgets, remark: "" };
        let mut subject = Some(subject);
        let gone = || Error::runtime("cannot compare", "scene", "it was measured already");
        let mut read = |_| subject.take().ok_or_else(gone);
        let mut progress = Progress::watched(Watcher { cancellation, sender });
        let made = make(&order, &run, &mut read, renderer, &mut journal, &mut progress)?;
        let comparison = &made.comparison;
        let failures = comparison.failures.iter().map(|(name, e)| format!("{name} failed: {e}")).collect();
        let (notes, rows) = (comparison.notes.clone(), comparison.rows());
        if let Some(folder) = &self.output {
            made.write(folder, &Layout::default())?;
        }
        Ok(Rows { rows, notes, failures })
    }
}

/// Observer of a measurement that reports its progress to Python and stops it at an interrupt.
struct Watcher<'a> {
    cancellation: &'a Cancellation,
    sender: &'a Sender<Step>,
}

impl Watch for Watcher<'_> {
    fn starts(&mut self, status: &Status) {
        let Status { what, done, total, left_s, .. } = *status;
        // The send fails if nobody listens to the progress.
        let _ = self.sender.send(Step { done, total, what: what.to_owned(), left_s });
    }

    fn goes_on(&self) -> bool {
        self.cancellation.goes_on()
    }
}

impl Rows {
    /// Issues a Python warning for each row of the comparison table that failed.
    pub fn warn(&self, py: Python<'_>) -> PyResult<()> {
        for remark in &self.failures {
            py.import("warnings")?.call_method1("warn", (remark,))?;
        }
        Ok(())
    }

    /// Returns one dictionary for each row of the comparison table, with every column of `compare.csv`; `None` for
    /// empty cells.
    pub fn as_dicts<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyList>> {
        let rows = PyList::empty(py);
        for row in &self.rows {
            let dict = PyDict::new(py);
            for (column, cell) in COLUMNS.iter().zip(row.cells()) {
                match cell {
                    Cell::Empty => dict.set_item(column.name, py.None())?,
                    Cell::Text(text) => dict.set_item(column.name, text)?,
                    Cell::Integer(n) => dict.set_item(column.name, n)?,
                    Cell::Real(x) => dict.set_item(column.name, x)?,
                    Cell::Flag(yes) => dict.set_item(column.name, yes)?,
                }
            }
            rows.append(dict)?;
        }
        Ok(rows)
    }
}
