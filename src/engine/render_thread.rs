//! What draws: a thread that owns volume, tables and shadow maps, and draws the newest wanted picture into textures of
//! the device that the window shares. The window never waits for it.

use super::engine::Engine;
use super::mailbox::{Mailbox, Next, Speaker, Wake};
use super::messages::{Event, Exported, Job, Wanted};
use super::{heat_map, jobs};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

/// The window's end of the thread.
pub struct RenderThread {
    mailbox: Arc<Mailbox>,
    events: Receiver<Event>,
    thread: Option<JoinHandle<()>>,
}

impl RenderThread {
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
        self.mailbox.want(wanted);
    }

    /// Asks for something else, done before the next picture.
    pub fn push(&self, job: Job) {
        self.mailbox.push(job);
    }

    /// Ends the export that is running, soon.
    pub fn cancel_export(&self) {
        self.mailbox.cancel_export.store(true, Ordering::Relaxed);
    }

    /// What has been said since the last time.
    pub fn events(&self) -> Vec<Event> {
        self.events.try_iter().collect()
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        self.cancel_export();
        self.mailbox.quit();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn run(gpu: Gpu, mailbox: &Mailbox, speaker: &Speaker) {
    let mut engine = Engine::new(gpu);
    while let Some(next) = mailbox.next() {
        match catch_unwind(AssertUnwindSafe(|| work(&mut engine, next, mailbox, speaker))) {
            Ok(Ok(())) => {}
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

fn work(engine: &mut Engine, next: Next, mailbox: &Mailbox, speaker: &Speaker) -> Result<()> {
    let job = match next {
        Next::Draw(wanted) => {
            if !engine.show(&wanted, mailbox, speaker)? {
                mailbox.want_again(wanted);
            }
            return Ok(());
        }
        Next::Job(job) => job,
    };
    match job {
        Job::Upload(opened) => engine.upload(opened, speaker),
        Job::Probe(request) => jobs::probe(&mut engine.device, &request, speaker),
        Job::Difference(request) => {
            heat_map::compare(&mut engine.device, &request, || !mailbox.interrupted(), speaker)
        }
        Job::Thumbnail(request) => jobs::thumbnail(&engine.device, *request, speaker),
        Job::Export(export) => {
            mailbox.cancel_export.store(false, Ordering::Relaxed);
            let go_on = || !mailbox.cancel_export.load(Ordering::Relaxed);
            let result = jobs::export(&mut engine.device, &export, speaker, go_on);
            speaker.say(Event::Exported(Exported { path: export.path, result }));
            Ok(())
        }
    }
}
