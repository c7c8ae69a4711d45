//! Work that lets other Python threads run, and that Ctrl-C ends.

use crate::fault::{Fault, Outcome};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Between two times that Python is asked whether it was interrupted.
const LISTENING: Duration = Duration::from_millis(25);

/// Whether work is to end, for those who do it.
#[derive(Default)]
pub struct Ending(AtomicBool);

impl Ending {
    /// Whether to go on.
    pub fn goes_on(&self) -> bool {
        !self.0.load(Ordering::Relaxed)
    }
}

/// Does `work` on a thread of its own, with the interpreter free for others; this thread hears what the work says and of
/// interrupts. Where `hear` fails, or Python was interrupted, `end` is called, and that error comes back once the work has
/// ended.
pub fn attended<T: Send, N: Send>(
    py: Python<'_>,
    end: impl Fn(),
    mut hear: impl FnMut(Python<'_>, N) -> PyResult<()>,
    work: impl FnOnce(&Ending, &Sender<N>) -> umbravox::Result<T> + Send,
) -> Outcome<T> {
    refuse_forked()?;
    let ending = Ending::default();
    let (say, mut said) = channel();
    let mut raised = None;
    let outcome = std::thread::scope(|scope| {
        let ending = &ending;
        // The sender goes with the thread: that it is gone says that the work is done.
        let worker = scope.spawn(move || {
            let outcome = work(ending, &say);
            drop(say);
            outcome
        });
        while let Some(news) = next(py, &mut said) {
            let heard = match news {
                Some(news) if raised.is_none() => hear(py, news),
                _ => Ok(()),
            };
            if let Err(e) = heard.and_then(|()| py.check_signals()) {
                raised.get_or_insert(e);
                ending.0.store(true, Ordering::Relaxed);
                end();
            }
        }
        py.detach(|| worker.join())
    });
    match (raised, outcome) {
        (Some(e), _) => Err(Fault::Raised(e)),
        (None, Ok(outcome)) => outcome.map_err(Fault::Ours),
        (None, Err(panic)) => std::panic::resume_unwind(panic),
    }
}

/// A process that was forked has none of the threads that work here, and would wait for them for ever.
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

/// As [`attended`], for work that says nothing.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    end: impl Fn(),
    work: impl FnOnce(&Ending) -> umbravox::Result<T> + Send,
) -> Outcome<T> {
    attended(py, end, |_, ()| Ok(()), |ending, _| work(ending))
}

/// What is said next; `Some(None)` where nothing is for a while, `None` once the work is done.
fn next<N: Send>(py: Python<'_>, said: &mut Receiver<N>) -> Option<Option<N>> {
    py.detach(move || match said.recv_timeout(LISTENING) {
        Ok(news) => Some(Some(news)),
        Err(RecvTimeoutError::Timeout) => Some(None),
        Err(RecvTimeoutError::Disconnected) => None,
    })
}
