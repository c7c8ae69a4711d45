//! Queue between the viewer window and the render thread: the newest picture request, jobs in order, and events back.

use super::messages::{Event, FrameRequest, Job};
use super::task::Wake;
use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

#[derive(Default)]
struct Slots {
    frame: Option<FrameRequest>,
    jobs: VecDeque<Job>,
    quit: bool,
}

impl Slots {
    fn has_requests(&self) -> bool {
        self.frame.is_some() || self.quit || !self.jobs.is_empty()
    }
}

/// Queue of requests from the viewer window to the render thread.
#[derive(Default)]
pub struct Mailbox {
    slots: Mutex<Slots>,
    changed: Condvar,
}

/// Next request for the render thread: a picture to render, or another job.
pub enum Next {
    Draw(FrameRequest),
    Job(Job),
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        // The slots are plain data and stay valid after a panic elsewhere.
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests a picture from the render thread. It replaces an earlier picture request that has not started.
    pub fn request_frame(&self, request: FrameRequest) {
        self.lock().frame = Some(request);
        self.changed.notify_all();
    }

    /// Adds a job to the render thread's queue. Jobs run in order, before the next picture.
    pub fn push(&self, job: Job) {
        {
            let mut slots = self.lock();
            // Only the newest probe and the newest comparison matter.
            if matches!(job, Job::Probe(_) | Job::Difference(_)) {
                let kind = std::mem::discriminant(&job);
                slots.jobs.retain(|j| std::mem::discriminant(j) != kind);
            }
            slots.jobs.push_back(job);
        }
        self.changed.notify_all();
    }

    /// Ends the render thread after its current request.
    pub fn quit(&self) {
        self.lock().quit = true;
        self.changed.notify_all();
    }

    /// Whether [`Self::quit`] was called.
    pub fn has_quit(&self) -> bool {
        self.lock().quit
    }

    /// Whether a request waits for the render thread, so that the refinement of a picture should stop.
    pub fn has_requests(&self) -> bool {
        self.lock().has_requests()
    }

    /// Waits until a request for the render thread arrives, for at most `time`. Returns whether one arrived.
    pub fn wait_for_request(&self, time: Duration) -> bool {
        let idle = |slots: &mut Slots| !slots.has_requests();
        let waited = self.changed.wait_timeout_while(self.lock(), time, idle);
        waited.unwrap_or_else(PoisonError::into_inner).0.has_requests()
    }

    /// Puts an interrupted picture request back into the render thread's queue, unless a newer picture request is
    /// waiting.
    pub fn restore(&self, request: FrameRequest) {
        self.lock().frame.get_or_insert(request);
    }

    /// Waits for the next request to the render thread; returns `None` after [`Self::quit`].
    pub fn next(&self) -> Option<Next> {
        let idle = |slots: &mut Slots| !slots.has_requests();
        let mut slots = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        if slots.quit {
            return None;
        }
        slots.jobs.pop_front().map(Next::Job).or_else(|| slots.frame.take().map(Next::Draw))
    }
}

/// Sender of the render thread's events, which also wakes the viewer window.
pub struct EventSender {
    pub sender: Sender<Event>,
    pub wake: Wake,
}

impl EventSender {
    pub fn send(&self, event: Event) {
        // Sending fails only if the window is closed.
        let _ = self.sender.send(event);
        (self.wake)();
    }
}
