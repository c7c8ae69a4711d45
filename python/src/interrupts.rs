//! Work without the interpreter lock, which Ctrl-C interrupts.

use crate::fault::{Fault, Outcome};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Interval between checks for an interrupt.
const SIGNAL_CHECK_INTERVAL: Duration = Duration::from_millis(25);

/// Flag that asks work to end.
#[derive(Default)]
pub struct Cancellation(AtomicBool);

impl Cancellation {
    /// Whether the work continues.
    pub fn goes_on(&self) -> bool {
        !self.0.load(Ordering::Relaxed)
    }
}

/// Runs `work` on its own thread without the interpreter lock. This thread passes its messages to `on_message` and checks for
/// interrupts. If `on_message` fails or Python is interrupted, `end` is called, and the error returns once the work has ended.
pub fn run_reporting<T: Send, N: Send>(
    py: Python<'_>,
    end: impl Fn(),
    mut on_message: impl FnMut(Python<'_>, N) -> PyResult<()>,
    work: impl FnOnce(&Cancellation, &Sender<N>) -> umbravox::Result<T> + Send,
) -> Outcome<T> {
    refuse_forked()?;
    let cancellation = Cancellation::default();
    let (sender, mut messages) = channel();
    let mut raised = None;
    let outcome = std::thread::scope(|scope| {
        let cancellation = &cancellation;
        // Dropping the sender marks the end of the work.
        let worker = scope.spawn(move || {
            let outcome = work(cancellation, &sender);
            drop(sender);
            outcome
        });
        while let Some(message) = next(py, &mut messages) {
            let handled = match message {
                Some(message) if raised.is_none() => on_message(py, message),
                _ => Ok(()),
            };
            if let Err(e) = handled.and_then(|()| py.check_signals()) {
                raised.get_or_insert(e);
                cancellation.0.store(true, Ordering::Relaxed);
                end();
            }
        }
        py.detach(|| worker.join())
    });
    match (raised, outcome) {
        (Some(e), _) => Err(Fault::Raised(e)),
        (None, Ok(outcome)) => outcome.map_err(Fault::Library),
        (None, Err(panic)) => std::panic::resume_unwind(panic),
    }
}

/// Refuses a forked process: it lacks the worker threads, and would wait for them forever.
fn refuse_forked() -> Outcome<()> {
    static FIRST: AtomicU32 = AtomicU32::new(0);
    let here = std::process::id();
    match FIRST.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != here => {
            let why = "the process was forked from one that has used umbravox, whose threads it lacks";
            Err(umbravox::Error::runtime("cannot work here", "multiprocessing", why)
                .hint("multiprocessing.get_context(\"spawn\") starts processes that have their own")
                .into())
        }
        _ => Ok(()),
    }
}

/// Runs work without messages; see [`run_reporting`].
pub fn interruptible<T: Send>(
    py: Python<'_>,
    end: impl Fn(),
    work: impl FnOnce(&Cancellation) -> umbravox::Result<T> + Send,
) -> Outcome<T> {
    run_reporting(py, end, |_, ()| Ok(()), |cancellation, _| work(cancellation))
}

/// Next message; `Some(None)` after an interval without one, `None` at the end of the work.
fn next<N: Send>(py: Python<'_>, messages: &mut Receiver<N>) -> Option<Option<N>> {
    py.detach(move || match messages.recv_timeout(SIGNAL_CHECK_INTERVAL) {
        Ok(message) => Some(Some(message)),
        Err(RecvTimeoutError::Timeout) => Some(None),
        Err(RecvTimeoutError::Disconnected) => None,
    })
}
