//! Background task of the comparison window: measures shadow methods on a separate thread and graphics device.

use crate::engine::task::{Task, Wake};
use crate::error::Result;
use crate::files::hash::sha256;
use crate::files::output::prepare_output_dir;
use crate::measure::facts::Facts;
use crate::measure::job::Effort;
use crate::measure::journal::Journal;
use crate::measure::progress::{Progress, Status, StepKind, Watch};
use crate::measure::table::Row;
use crate::open::{RunFlags, SceneSettings};
use crate::render::Renderer;
use crate::report::Start;
use crate::report::make::{Files, Order, Subject, make, scene_name};
use crate::report::run::{Run, SceneRecord};
use crate::report::tables::Layout;
use crate::shadow::Method;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;

/// Note on the timings of a comparison of shadow methods that was measured while the viewer window was open.
pub const REMARK: &str = "timed while the window was open, which draws with the same processor";
/// File name of the transfer function in the output folder of a comparison of shadow methods.
const TRANSFER_FUNCTION: &str = "transfer_function.json";

/// Inputs of a comparison of shadow methods, copied when the comparison starts.
pub struct TableRequest {
    /// Choice of the graphics adapter on which the shadow methods are compared, and the limit on its memory.
    pub device: RunFlags,
    /// Volume, transfer function and scene on which the shadow methods are compared. The scene has the picture size
    /// entered in the comparison form.
    pub subject: Subject,
    /// Settings of the scene on which the shadow methods are compared, as in a scene file but without the transfer
    /// function.
    pub settings: SceneSettings,
    pub methods: Vec<Box<dyn Method>>,
    pub effort: Effort,
    pub folder: PathBuf,
    /// Whether the comparison of shadow methods resumes from the measurements recorded in its output folder.
    pub resume: bool,
}

/// Finished comparison of shadow methods: rows of its table, notes, and paths of the written files.
#[derive(Debug, Clone)]
pub struct FinishedTable {
    pub rows: Vec<Row>,
    pub notes: Vec<String>,
    pub files: Files,
}

/// Current measurement in a comparison of shadow methods, with the progress of the whole comparison.
pub struct CurrentStep {
    pub kind: StepKind,
    pub what: String,
    /// Completed fraction of the comparison of shadow methods, 0 to 1.
    pub share: f32,
    /// Estimated remaining time of the comparison of shadow methods, s; `None` while unknown.
    pub left_s: Option<f64>,
}

/// Message to the comparison window from the background thread that measures the shadow methods.
pub enum Update {
    Step(CurrentStep),
    /// Finished row of the table that compares shadow methods, with the index of the row.
    Row(usize, Box<Row>),
    Ended(Result<Box<FinishedTable>>),
}

/// Starts a comparison of shadow methods on a background thread.
///
/// # Errors
/// The system cannot start a thread.
pub fn start(request: TableRequest, wake: Wake) -> Result<Task<Update>> {
    Task::start("compare", wake, |sender, cancelled| {
        let watcher = Watcher { sender: sender.clone(), cancel: Arc::clone(cancelled) };
        let _ = sender.send(Update::Ended(run(request, watcher).map(Box::new)));
    })
}

/// Forwards the progress of a comparison of shadow methods to the window. It does not wake the window, because
/// drawing would disturb the timings.
struct Watcher {
    sender: Sender<Update>,
    cancel: Arc<AtomicBool>,
}

impl Watch for Watcher {
    fn starts(&mut self, status: &Status) {
        let (kind, what) = (status.step.kind, status.what.to_owned());
        let step = CurrentStep { kind, what, share: status.share(), left_s: status.left_s };
        let _ = self.sender.send(Update::Step(step));
    }

    fn row(&mut self, place: usize, row: &Row) {
        let _ = self.sender.send(Update::Row(place, Box::new(row.clone())));
    }

    fn goes_on(&self) -> bool {
        !self.cancel.load(Ordering::Relaxed)
    }
}

fn run(request: TableRequest, watcher: Watcher) -> Result<FinishedTable> {
    let TableRequest { device, subject, mut settings, methods, effort, folder, resume } = request;
    let Subject { volume, tf, scene, .. } = &subject;
    let renderer = Arc::new(Renderer::new(device.gpu()?));
    prepare_output_dir(&folder)?;
    let (start, tf_text) = (if resume { Start::Resume } else { Start::Overwrite }, tf.to_json());
    let facts = Facts::of(renderer.gpu());
    let texts: Vec<_> = methods.iter().map(|m| facts.row("", [1, 1], m.as_ref()).spec()).collect();
    settings.name = Some(scene_name(volume, tf));
    settings.tf = Some(TRANSFER_FUNCTION.into());
    settings.sha256 = settings.spec().sha256()?;
    let record = SceneRecord {
        name: settings.name.clone().unwrap_or_default(),
        file: String::new(),
        settings: settings.to_toml()?,
        volume_sha256: settings.sha256.clone(),
        tf: tf.name.clone(),
        tf_file: TRANSFER_FUNCTION.into(),
        tf_sha256: sha256(tf_text.as_bytes()),
        size: [scene.width, scene.height],
        light: None,
    };
    let mut run = Run::new(&facts, effort, &texts.join(";"), &methods, vec![record], None);
    let hint = "choose another folder, or do not resume: that removes all files of the table in the folder";
    run.check(&folder, start).map_err(|e| e.hint(hint))?;
    let mut journal = Journal::open(&folder, resume)?;
    run.begin(&folder, start, &[Some(tf_text)])?;
    let mut progress = Progress::watched(watcher);
    progress.check("opening the device")?;
    let methods = [methods];
    let order = Order { methods: &methods, budgets: &[], remark: REMARK };
    let mut read = |_| Ok(subject.clone());
    let made = make(&order, &run, &mut read, &renderer, &mut journal, &mut progress)?;
    let (rows, notes) = (made.comparison.rows(), made.comparison.notes.clone());
    Ok(FinishedTable { rows, notes, files: made.write(&folder, &Layout::default())? })
}
