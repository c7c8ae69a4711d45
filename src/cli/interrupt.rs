//! Ctrl-C, and the signals by which a batch system ends a job.

use super::console::print_message;
use crate::error::{Error, Result};
use crate::files::output::abandon_and;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

static COME: AtomicU32 = AtomicU32::new(0);
static LISTENS: OnceLock<Result<(), String>> = OnceLock::new();
/// What becomes of the work, where it is ended between two steps.
static OUTCOME: OnceLock<&str> = OnceLock::new();

/// A command that is ended between two steps: its first interrupt is to do that, the second ends the program at once.
pub struct Interrupt(());

impl Interrupt {
    /// From now on steps are heard of; `outcome` tells the user what becomes of the work that is done by then.
    pub fn between_steps(outcome: &'static str) -> Self {
        // The first outcome holds: a command has one.
        let _ = OUTCOME.set(outcome);
        Self(())
    }

    /// Whether one has come.
    pub fn has_come(&self) -> bool {
        COME.load(Ordering::SeqCst) > 0
    }
}

/// Hears interrupts (SIGINT, SIGTERM, SIGHUP) from now on: one that no [`Interrupt`] is made for ends the program at once,
/// and leaves no half-written file either.
///
/// # Errors
/// The system does not let it.
pub fn listen() -> Result<()> {
    let heard = || match (COME.fetch_add(1, Ordering::SeqCst), OUTCOME.get()) {
        (0, Some(outcome)) => {
            print_message(
                "note",
                &format_args!("ending after this step; {outcome} (once more ends at once)"),
            );
        }
        _ => abandon_and(system::end),
    };
    let listens = LISTENS.get_or_init(|| system::set_handler(heard).map_err(|e| e.to_string()));
    listens.clone().map_err(|why| Error::runtime("cannot listen for interrupts", "signals", why))
}

#[cfg(unix)]
mod system {
    use nix::sys::signal::{SigHandler, Signal, raise, signal};

    /// Has them handled but those that `nohup`, or a shell with a job in the background, lets the program ignore.
    pub fn set_handler(heard: impl FnMut() + Send + 'static) -> Result<(), ctrlc::Error> {
        let handled = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
        // SAFETY: a signal that is ignored runs no code.
        let ignore = |s| unsafe { signal(s, SigHandler::SigIgn) };
        let ignored = handled.map(|s| matches!(ignore(s), Ok(SigHandler::SigIgn)));
        let set = ctrlc::set_handler(heard);
        for (s, _) in handled.into_iter().zip(ignored).filter(|(_, ignored)| *ignored) {
            // The same call has just been answered.
            let _ = ignore(s);
        }
        set
    }

    /// Ends the program as an interrupt by itself would, so that a shell ends its loop too.
    pub fn end() -> ! {
        // SAFETY: the system's own way runs no code of the program.
        let _ = unsafe { signal(Signal::SIGINT, SigHandler::SigDfl) }.and_then(|_| raise(Signal::SIGINT));
        std::process::exit(128 + Signal::SIGINT as i32)
    }
}

#[cfg(not(unix))]
mod system {
    pub use ctrlc::set_handler;

    pub fn end() -> ! {
        std::process::exit(1)
    }
}
