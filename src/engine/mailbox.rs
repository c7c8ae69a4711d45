//! What lies between the window and the render thread: the newest wish, work in order, and the way back.

use super::messages::{Event, Job, Wanted};
use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

#[derive(Default)]
struct Slots {
    wanted: Option<Wanted>,
    jobs: VecDeque<Job>,
    quit: bool,
}

impl Slots {
    fn has_news(&self) -> bool {
        self.wanted.is_some() || self.quit || !self.jobs.is_empty()
    }
}

/// What is to be done, written by the window and read by the render thread.
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
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        // A panic elsewhere leaves plain data that is as good as before.
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks for a picture; one that was asked for before and not begun is forgotten.
    pub fn want(&self, wanted: Wanted) {
        self.lock().wanted = Some(wanted);
        self.changed.notify_all();
    }

    /// Asks for something else, done before the next picture.
    pub fn push(&self, job: Job) {
        {
            let mut slots = self.lock();
            // The newest place, and the newest answer, is the one of interest.
            if matches!(job, Job::Probe(_) | Job::Difference(_)) {
                let kind = std::mem::discriminant(&job);
                slots.jobs.retain(|j| std::mem::discriminant(j) != kind);
            }
            slots.jobs.push_back(job);
        }
        self.changed.notify_all();
    }

    /// Ends the thread when it looks next.
    pub fn quit(&self) {
        self.lock().quit = true;
        self.changed.notify_all();
    }

    /// Whether something waits that makes a refinement pointless.
    pub fn interrupted(&self) -> bool {
        self.lock().has_news()
    }

    /// Waits for `time`, or until something new is wanted: whether it is.
    pub fn wait_for_news(&self, time: Duration) -> bool {
        let until = Instant::now() + time;
        let mut slots = self.lock();
        while !slots.has_news() {
            let Some(left) = until.checked_duration_since(Instant::now()).filter(|d| !d.is_zero()) else {
                return false;
            };
            slots = self.changed.wait_timeout(slots, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    /// Puts an unfinished wish back, unless there is a newer one.
    pub fn want_again(&self, wanted: Wanted) {
        self.lock().wanted.get_or_insert(wanted);
    }

    /// Waits for something to do; `None`: the window has gone.
    pub fn next(&self) -> Option<Next> {
        let mut slots = self.lock();
        loop {
            if slots.quit {
                return None;
            }
            if let Some(job) = slots.jobs.pop_front() {
                return Some(Next::Job(job));
            }
            if let Some(wanted) = slots.wanted.take() {
                return Some(Next::Draw(wanted));
            }
            slots = self.changed.wait(slots).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// How another thread tells the window that there is something to take.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// The render thread's mouth.
pub struct Speaker {
    pub send: Sender<Event>,
    pub wake: Wake,
}

impl Speaker {
    pub fn say(&self, event: Event) {
        // A window that has gone needs no news.
        let _ = self.send.send(event);
        (self.wake)();
    }
}
