//! The render thread: it owns volume, tables and shadow maps, and draws the newest wanted picture into textures of the
//! device that the window shares. The window never waits for it.

use super::difference::{DifferenceRequest, Differences};
use super::engine::Engine;
use super::jobs::{Export, Exported, ProbeRequest, ProbeResult};
use super::method_choice::MethodChoice;
use super::open::Opened;
use super::presets::{Thumbnail, ThumbnailRequest};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::{DisplayTexture, Omission, Work};
use crate::scene::Scene;
use crate::shadow::{Bound, BuildReport};
use crate::transfer::TransferFunction;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The picture that the window wants to show.
#[derive(Debug, Clone)]
pub struct Wanted {
    pub tf: Arc<TransferFunction>,
    pub method: MethodChoice,
    /// A second method, for the picture on the other side of the split.
    pub other: Option<MethodChoice>,
    /// Its width and height are the view's, in pixels.
    pub scene: Scene,
    /// When the hand did what this picture answers.
    pub since: Instant,
    /// Rises with everything that is wanted.
    pub revision: u64,
}

/// One method's part of a frame.
#[derive(Debug, Clone)]
pub struct Side {
    pub texture: Arc<DisplayTexture>,
    /// The method as drawn, which is coarser than the one wanted while a hand moves.
    pub spec: String,
    pub report: BuildReport,
    pub bound: Option<Bound>,
    pub left_out: Vec<Omission>,
    pub frame_ms: f64,
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Frame {
    pub main: Side,
    pub other: Option<Side>,
    /// Of full quality: nothing finer follows.
    pub whole: bool,
    pub work: Work,
    /// From the hand's movement to the finished picture, ms.
    pub latency_ms: f64,
    /// The longest that one submission kept the queue, ms.
    pub longest_band_ms: f64,
    /// Of what was wanted.
    pub revision: u64,
}

/// What the render thread has to say.
pub enum Event {
    Opened(Box<Opened>),
    Frame(Box<Frame>),
    /// The change reached no picture: no voxel has the values that it concerns.
    Unchanged {
        revision: u64,
    },
    Probed(Box<ProbeResult>),
    Differences(Box<Differences>),
    /// Something else came before the comparison was done.
    DifferenceUnfinished(Arc<DifferenceRequest>),
    Thumbnail(Box<Thumbnail>),
    /// Share of the export that is done.
    ExportProgress(f32),
    Exported(Exported),
    /// Something failed; what was shown before stays.
    Failed(Error),
}

/// Work besides pictures, in order.
pub enum Job {
    Upload(Box<Opened>),
    Probe(ProbeRequest),
    Difference(Arc<DifferenceRequest>),
    Thumbnail(Box<ThumbnailRequest>),
    Export(Export),
}

#[derive(Default)]
struct Slots {
    wanted: Option<Wanted>,
    jobs: VecDeque<Job>,
    quit: bool,
}

/// What lies between the window and the render thread.
#[derive(Default)]
pub struct Mailbox {
    slots: Mutex<Slots>,
    changed: Condvar,
    pub cancel_export: AtomicBool,
}

/// What to do next.
pub enum Next {
    Draw(Wanted),
    Job(Job),
    Quit,
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        // A panic elsewhere leaves plain data that is as good as before.
        self.slots.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Whether something waits that makes a refinement pointless.
    pub fn interrupted(&self) -> bool {
        let slots = self.lock();
        slots.wanted.is_some() || slots.quit || !slots.jobs.is_empty()
    }

    /// Waits for `time`, or until something new is wanted: whether it is.
    pub fn wait_for_news(&self, time: Duration) -> bool {
        let until = Instant::now() + time;
        let mut slots = self.lock();
        loop {
            if slots.wanted.is_some() || slots.quit || !slots.jobs.is_empty() {
                return true;
            }
            let Some(left) = until.checked_duration_since(Instant::now()).filter(|d| !d.is_zero()) else {
                return false;
            };
            slots = self.changed.wait_timeout(slots, left).unwrap_or_else(|e| e.into_inner()).0;
        }
    }

    /// Puts an unfinished wish back, unless there is a newer one.
    fn want_again(&self, wanted: Wanted) {
        self.lock().wanted.get_or_insert(wanted);
    }

    fn next(&self) -> Next {
        let mut slots = self.lock();
        loop {
            if slots.quit {
                return Next::Quit;
            }
            if let Some(job) = slots.jobs.pop_front() {
                return Next::Job(job);
            }
            if let Some(wanted) = slots.wanted.take() {
                return Next::Draw(wanted);
            }
            slots = self.changed.wait(slots).unwrap_or_else(|e| e.into_inner());
        }
    }
}

/// How the render thread tells the window that there is something to take.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// The window's end.
pub struct Worker {
    mailbox: Arc<Mailbox>,
    events: Receiver<Event>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread on a device.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(gpu: Gpu, wake: Wake) -> Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let (send, events) = channel();
        let theirs = Arc::clone(&mailbox);
        let thread = std::thread::Builder::new()
            .name("render".into())
            .spawn(move || run(gpu, &theirs, &Speaker { send, wake }))
            .map_err(|e| Error::runtime("cannot start the render thread", "window", e))?;
        Ok(Self { mailbox, events, thread: Some(thread) })
    }

    /// Asks for a picture; one that was asked for before and not begun is forgotten.
    pub fn want(&self, wanted: Wanted) {
        self.mailbox.lock().wanted = Some(wanted);
        self.mailbox.changed.notify_all();
    }

    /// Asks for something else, done before the next picture.
    pub fn push(&self, job: Job) {
        {
            let mut slots = self.mailbox.lock();
            // The newest place, and the newest answer, is the one of interest.
            if matches!(job, Job::Probe(_) | Job::Difference(_)) {
                let kind = std::mem::discriminant(&job);
                slots.jobs.retain(|j| std::mem::discriminant(j) != kind);
            }
            slots.jobs.push_back(job);
        }
        self.mailbox.changed.notify_all();
    }

    /// Ends the export that is running, soon.
    pub fn cancel_export(&self) {
        self.mailbox.cancel_export.store(true, Ordering::Relaxed);
    }

    /// What has been said since the last time.
    pub fn events(&self) -> impl Iterator<Item = Event> + '_ {
        self.events.try_iter()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.mailbox.lock().quit = true;
        self.cancel_export();
        self.mailbox.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The render thread's mouth.
pub struct Speaker {
    send: Sender<Event>,
    wake: Wake,
}

impl Speaker {
    pub fn say(&self, event: Event) {
        // A window that has gone needs no news.
        let _ = self.send.send(event);
        (self.wake)();
    }
}

fn run(gpu: Gpu, mailbox: &Mailbox, speaker: &Speaker) {
    let mut engine = Engine::new(gpu);
    loop {
        let next = mailbox.next();
        let done = catch_unwind(AssertUnwindSafe(|| match next {
            Next::Quit => Ok(false),
            Next::Draw(wanted) => {
                if !engine.show(&wanted, mailbox, speaker)? {
                    mailbox.want_again(wanted);
                }
                Ok(true)
            }
            Next::Job(Job::Upload(opened)) => engine.upload(*opened, speaker).map(|()| true),
            Next::Job(Job::Probe(request)) => engine.probe(&request, speaker).map(|()| true),
            Next::Job(Job::Difference(request)) => {
                engine.difference(&request, || !mailbox.interrupted(), speaker).map(|()| true)
            }
            Next::Job(Job::Thumbnail(request)) => engine.thumbnail(*request, speaker).map(|()| true),
            Next::Job(Job::Export(export)) => {
                mailbox.cancel_export.store(false, Ordering::Relaxed);
                let result =
                    engine.export(&export, speaker, || !mailbox.cancel_export.load(Ordering::Relaxed));
                speaker.say(Event::Exported(Exported { path: export.path, result }));
                Ok(true)
            }
        }));
        match done {
            Ok(Ok(true)) => {}
            Ok(Ok(false)) => break,
            Ok(Err(error)) => speaker.say(Event::Failed(error)),
            Err(_) => {
                let why =
                    "the picture's thread met a fault of the program; the volume has to be opened again";
                speaker.say(Event::Failed(Error::runtime("cannot draw", "render thread", why)));
                engine.forget();
            }
        }
    }
}
