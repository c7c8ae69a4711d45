//! Long computations that run without Python's interpreter lock and that Ctrl-C interrupts.

use crate::fault::{Fault, Outcome};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Interval between two checks whether Ctrl-C was pressed.
const SIGNAL_CHECK_INTERVAL: Duration = Duration::from_millis(25);

/// Flag that asks a running computation to end.
#[derive(Default)]
pub struct Cancellation(AtomicBool);

impl Cancellation {
    /// Whether the running computation may continue; false after a request to end.
    pub fn goes_on(&self) -> bool {
        !self.0.load(Ordering::Relaxed)
    }
}

/// Runs the computation `work` on its own thread without Python's interpreter lock. The calling thread passes the
/// messages of `work` to `on_message` and checks for Ctrl-C. If `on_message` fails or Python is interrupted, `end` is
/// called, and the error returns once the computation has ended.
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

/// Returns an error if this process was forked from one that used umbravox. It lacks the worker threads of its
/// parent, and would wait for them forever.
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

/// Runs a computation without progress messages; Ctrl-C interrupts it (see [`run_reporting`]).
pub fn interruptible<T: Send>(
    py: Python<'_>,
    end: impl Fn(),
    work: impl FnOnce(&Cancellation) -> umbravox::Result<T> + Send,
) -> Outcome<T> {
    run_reporting(py, end, |_, ()| Ok(()), |cancellation, _| work(cancellation))
}

/// Returns the next message of a running computation; `Some(None)` after an interval without one, `None` at its end.
fn next<N: Send>(py: Python<'_>, messages: &mut Receiver<N>) -> Option<Option<N>> {
    py.detach(move || match messages.recv_timeout(SIGNAL_CHECK_INTERVAL) {
        Ok(message) => Some(Some(message)),
        Err(RecvTimeoutError::Timeout) => Some(None),
        Err(RecvTimeoutError::Disconnected) => None,
    })
}
