//! Background threads that send messages to the viewer window.

use crate::error::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Callback by which a background thread makes the viewer window look for new messages.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Background thread that sends messages of type `T`. Dropping the task asks the thread to stop.
pub struct Task<T> {
    messages: Receiver<T>,
    cancelled: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl<T: Send + 'static> Task<T> {
    /// Starts a background thread that runs the function `work` and calls `wake` at the end. `work` should return
    /// soon after its cancel flag is set.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(
        name: &str,
        wake: Wake,
        work: impl FnOnce(&Sender<T>, &Arc<AtomicBool>) + Send + 'static,
    ) -> Result<Self> {
        let (sender, messages) = channel();
        let cancelled = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&cancelled);
        let run = move || {
            // The receiver detects a panic by the missing message.
            let _ = catch_unwind(AssertUnwindSafe(|| work(&sender, &flag)));
            drop(sender);
            wake();
        };
        let thread = Builder::new().name(name.into()).spawn(run);
        let thread = thread.map_err(|e| Error::runtime("cannot start a thread", name, e))?;
        Ok(Self { messages, cancelled, thread })
    }

    /// Returns the next message of the background thread.
    ///
    /// # Errors
    /// No message is available now, or the thread has ended.
    pub fn poll(&self) -> Result<T, TryRecvError> {
        self.messages.try_recv()
    }
}

impl<T> Task<T> {
    /// Asks the background thread to stop.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the background thread was asked to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Asks the background thread to stop, and waits until it has ended, for at most `most`.
    pub fn end_within(&self, most: Duration) {
        self.cancel();
        let start = Instant::now();
        while !self.thread.is_finished() && start.elapsed() < most {
            sleep(Duration::from_millis(5));
        }
    }
}

impl<T> Drop for Task<T> {
    fn drop(&mut self) {
        self.cancel();
    }
}
