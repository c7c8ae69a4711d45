//! Render thread of the viewer: owns the volume, transfer-function tables and shadow maps, and renders into textures
//! that the window shows.
//!
//! The window never waits for it.

use super::mailbox::{EventSender, Mailbox, Next};
use super::messages::{Event, Exported, FrameRequest, Job};
use super::progressive::ProgressiveRenderer;
use super::task::Wake;
use super::{heat_map, jobs};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

/// Handle of the render thread, through which the window sends requests and receives results.
pub struct RenderThread {
    mailbox: Arc<Mailbox>,
    events: Receiver<Event>,
    thread: Option<JoinHandle<()>>,
}

impl RenderThread {
    /// Starts the render thread on a graphics device. The thread calls `wake` for each result.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(gpu: Gpu, wake: Wake) -> Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let (sender, events) = channel();
        let requests = Arc::clone(&mailbox);
        let thread = std::thread::Builder::new()
            .name("render".into())
            .spawn(move || run(gpu, &requests, &EventSender { sender, wake }))
            .map_err(|e| Error::runtime("cannot start the render thread", "window", e))?;
        Ok(Self { mailbox, events, thread: Some(thread) })
    }

    /// Requests a picture from the render thread. It replaces an earlier picture request that has not started.
    pub fn request_frame(&self, request: FrameRequest) {
        self.mailbox.request_frame(request);
    }

    /// Adds a job to the render thread's queue. Jobs run in order, before the next picture.
    pub fn push(&self, job: Job) {
        self.mailbox.push(job);
    }

    /// Returns the render thread's messages (results, progress, errors) since the last call.
    pub fn events(&self) -> Vec<Event> {
        self.events.try_iter().collect()
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        self.mailbox.quit();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn run(gpu: Gpu, mailbox: &Mailbox, events: &EventSender) {
    let mut renderer = ProgressiveRenderer::new(gpu);
    while let Some(next) = mailbox.next() {
        match catch_unwind(AssertUnwindSafe(|| handle(&mut renderer, next, mailbox, events))) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => events.send(Event::Failed(error)),
            Err(_) => {
                let why = "an internal error occurred in the render thread; open the volume again";
                events.send(Event::Failed(Error::runtime("cannot draw", "render thread", why)));
                renderer.reset();
            }
        }
    }
}

fn handle(
    renderer: &mut ProgressiveRenderer,
    next: Next,
    mailbox: &Mailbox,
    events: &EventSender,
) -> Result<()> {
    let job = match next {
        Next::Draw(request) => {
            if !renderer.show(&request, mailbox, events)? {
                mailbox.restore(request);
            }
            return Ok(());
        }
        Next::Job(job) => job,
    };
    let session = &mut renderer.session;
    match job {
        Job::Upload(opened) => renderer.upload(opened, events),
        Job::Probe(request) => jobs::probe(session, &request, events),
        Job::Difference(request) => heat_map::compare(session, &request, || !mailbox.has_requests(), events),
        Job::Thumbnail(request) => {
            let copy = renderer.reduced.ready().map(|copy| &*copy);
            jobs::thumbnail((session, copy), *request, events)
        }
        Job::Export(export) => {
            let proceed = || !export.cancelled.load(Ordering::Relaxed) && !mailbox.has_quit();
            let result = jobs::export(session, &export, events, proceed);
            events.send(Event::Exported(Exported { path: export.path, result }));
            Ok(())
        }
    }
}
