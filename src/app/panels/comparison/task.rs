//! A comparison on a thread and a device of its own, beside the window.

use crate::engine::mailbox::Wake;
use crate::error::{Error, Result};
use crate::files::hash::sha256;
use crate::files::output::prepare_output_dir;
use crate::gpu::Gpu;
use crate::measure::facts::Facts;
use crate::measure::job::Effort;
use crate::measure::journal::Journal;
use crate::measure::progress::{Progress, Status, StepKind, Watch};
use crate::measure::table::Row;
use crate::open::SceneSettings;
use crate::render::{DisabledOptimizations, Renderer};
use crate::report::Start;
use crate::report::make::{Files, Order, Subject, make, scene_name};
use crate::report::run::{Run, SceneRecord};
use crate::report::tables::Layout;
use crate::scene::Scene;
use crate::shadow::Method;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What every row that is timed beside the window says.
pub const REMARK: &str = "timed while the window was open, which draws with the same processor";

/// The transfer function's file in the folder of the table.
const TRANSFER_FUNCTION: &str = "transfer_function.json";

/// A program that ends waits no longer for the step that is being done.
const LAST_STEP: Duration = Duration::from_secs(3);

/// What is compared, as it was when it was started.
pub struct Request {
    /// Its whole name.
    pub adapter: String,
    pub volume: Arc<Volume>,
    /// What it was made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
    pub tf: Arc<TransferFunction>,
    /// With the table's own picture size.
    pub scene: Scene,
    /// What a scene file would say of it, but for the transfer function.
    pub settings: SceneSettings,
    pub methods: Vec<Box<dyn Method>>,
    pub effort: Effort,
    pub folder: PathBuf,
    /// Go on with what the folder's journal holds.
    pub resume: bool,
}

/// A table that is done.
#[derive(Debug, Clone)]
pub struct Finished {
    pub rows: Vec<Row>,
    pub notes: Vec<String>,
    pub files: Files,
}

/// What the thread has to say.
pub enum News {
    Starts {
        stage: StepKind,
        what: String,
        share: f32,
        /// Seconds that what is left will take, as far as that can be told.
        left_s: Option<f64>,
    },
    Row {
        place: usize,
        row: Box<Row>,
    },
    Ended(Result<Box<Finished>>),
}

/// The window's end of a comparison that runs.
pub struct Task {
    cancel: Arc<AtomicBool>,
    news: Receiver<News>,
    thread: JoinHandle<()>,
}

impl Task {
    /// Starts the thread; `wake` is called when it has ended.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(wanted: Request, wake: Wake) -> Result<Self> {
        let cancel = Arc::new(AtomicBool::new(false));
        let (send, news) = channel();
        let watcher = Watcher { send: send.clone(), cancel: Arc::clone(&cancel) };
        let work = move || {
            let place = wanted.folder.display().to_string();
            let outcome = catch_unwind(AssertUnwindSafe(|| run(wanted, watcher))).unwrap_or_else(|_| {
                Err(Error::runtime("cannot compare", place, "the program met a fault while comparing"))
            });
            // A window that has gone needs no news.
            let _ = send.send(News::Ended(outcome.map(Box::new)));
            wake();
        };
        let thread = std::thread::Builder::new()
            .name("compare".into())
            .spawn(work)
            .map_err(|e| Error::runtime("cannot compare", "window", e))?;
        Ok(Self { cancel, news, thread })
    }

    /// Ends it when the step is done that is being done.
    pub fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    /// Whether it has been asked to end.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// What has been said since the last time.
    pub fn news(&self) -> Vec<News> {
        self.news.try_iter().collect()
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.cancel();
        let start = Instant::now();
        while !self.thread.is_finished() && start.elapsed() < LAST_STEP {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// What hears of the table's steps, on its thread.
struct Watcher {
    send: Sender<News>,
    cancel: Arc<AtomicBool>,
}

impl Watch for Watcher {
    fn starts(&mut self, status: &Status) {
        // The window looks by itself now and then: waking it at every step would take time from what is timed.
        let _ = self.send.send(News::Starts {
            stage: status.step.kind,
            what: status.what.to_owned(),
            share: status.share(),
            left_s: status.left_s,
        });
    }

    fn row(&mut self, place: usize, row: &Row) {
        let _ = self.send.send(News::Row { place, row: Box::new(row.clone()) });
    }

    fn goes_on(&self) -> bool {
        !self.cancel.load(Ordering::Relaxed)
    }
}

fn run(wanted: Request, watcher: Watcher) -> Result<Finished> {
    let Request { adapter, volume, strands, tf, scene, mut settings, methods, effort, folder, resume } =
        wanted;
    let renderer = Arc::new(Renderer::new(Gpu::open(Some(&adapter))?));
    prepare_output_dir(&folder)?;
    let (start, tf_text) = (if resume { Start::Resume } else { Start::Overwrite }, tf.to_json());
    let facts = Facts::of(renderer.gpu());
    let texts: Vec<_> = methods.iter().map(|m| facts.row("", [1, 1], m.as_ref()).spec()).collect();
    settings.name = Some(scene_name(&volume, &tf));
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
    let other = "choose another folder, or start anew: that removes all files of the table that it holds";
    run.check(&folder, start).map_err(|e| e.hint(other))?;
    let mut journal = Journal::open(&folder, resume)?;
    run.begin(&folder, start, &[Some(tf_text)])?;
    let mut progress = Progress::watched(watcher);
    progress.check("opening the device")?;
    let methods = [methods];
    let order = Order { methods: &methods, budgets: &[], remark: REMARK };
    let mut read = |_| {
        let (volume, tf, scene) = (Arc::clone(&volume), (*tf).clone(), scene.clone());
        let strands = strands.clone();
        Ok(Subject { volume, tf, strands, scene, forced: DisabledOptimizations::NONE })
    };
    let made = make(&order, &run, &mut read, &renderer, &mut journal, &mut progress)?;
    let (rows, notes) = (made.comparison.rows(), made.comparison.notes.clone());
    Ok(Finished { rows, notes, files: made.write(&folder, &Layout::default())? })
}
