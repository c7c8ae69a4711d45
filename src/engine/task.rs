//! Background threads that send messages to the window.

use crate::error::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Callback that makes the window look for events.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Running thread; dropping it cancels the work.
pub struct Task<T> {
    messages: Receiver<T>,
    cancelled: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl<T: Send + 'static> Task<T> {
    /// Starts `work`, which should end soon after its flag is set; `wake` is called at the end.
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
            // A panic is noticed by its missing message.
            let _ = catch_unwind(AssertUnwindSafe(|| work(&sender, &flag)));
            drop(sender);
            wake();
        };
        let thread = Builder::new().name(name.into()).spawn(run);
        let thread = thread.map_err(|e| Error::runtime("cannot start a thread", name, e))?;
        Ok(Self { messages, cancelled, thread })
    }

    /// Next message.
    ///
    /// # Errors
    /// There is none now, or the thread has ended.
    pub fn poll(&self) -> Result<T, TryRecvError> {
        self.messages.try_recv()
    }
}

impl<T> Task<T> {
    /// Asks the thread to end.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the thread was asked to end.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Cancels, and waits for the end of the thread for at most this time.
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
