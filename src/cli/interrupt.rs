//! Handling of interrupts: Ctrl-C, and the signals by which a batch system ends a job.

use super::console::print_message;
use crate::error::{Error, Result};
use crate::files::output::abandon_and;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

static COUNT: AtomicU32 = AtomicU32::new(0);
static HANDLER: OnceLock<Result<(), String>> = OnceLock::new();
/// Message that tells the user what happens to finished results, such as pictures or table rows, when an interrupt
/// ends the command.
static OUTCOME: OnceLock<&str> = OnceLock::new();

/// Interrupt handling of a command: the first interrupt (Ctrl-C) ends the command after its current step; a second
/// one ends the program at once.
pub struct Interrupt(());

impl Interrupt {
    /// Makes an interrupt (Ctrl-C) end the command after its current step. `outcome` tells the user what happens to
    /// finished results.
    pub fn between_steps(outcome: &'static str) -> Self {
        // A command sets one outcome; a second call has no effect.
        let _ = OUTCOME.set(outcome);
        Self(())
    }

    /// Whether an interrupt (Ctrl-C or a signal) has arrived.
    pub fn is_requested(&self) -> bool {
        COUNT.load(Ordering::SeqCst) > 0
    }
}

/// Installs the handler of interrupts (SIGINT, SIGTERM, SIGHUP). Unless the command created an [`Interrupt`], an
/// interrupt removes unfinished files and ends the program at once.
///
/// # Errors
/// The system refuses the handler.
pub fn listen() -> Result<()> {
    let handler = || match (COUNT.fetch_add(1, Ordering::SeqCst), OUTCOME.get()) {
        (0, Some(outcome)) => {
            print_message(
                "note",
                &format_args!("ending after this step; {outcome} (once more ends at once)"),
            );
        }
        _ => abandon_and(system::end),
    };
    let listens = HANDLER.get_or_init(|| system::set_handler(handler).map_err(|e| e.to_string()));
    listens.clone().map_err(|why| Error::runtime("cannot listen for interrupts", "signals", why))
}

#[cfg(unix)]
mod system {
    use nix::sys::signal::{SigHandler, Signal, raise, signal};

    /// Installs a handler of interrupt signals. Signals that `nohup` or a shell's background job already ignores stay
    /// ignored.
    pub fn set_handler(handler: impl FnMut() + Send + 'static) -> Result<(), ctrlc::Error> {
        let handled = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
        // SAFETY: an ignored signal runs no code.
        let ignore = |s| unsafe { signal(s, SigHandler::SigIgn) };
        let ignored = handled.map(|s| matches!(ignore(s), Ok(SigHandler::SigIgn)));
        let set = ctrlc::set_handler(handler);
        for (s, _) in handled.into_iter().zip(ignored).filter(|(_, ignored)| *ignored) {
            // The call succeeded just before.
            let _ = ignore(s);
        }
        set
    }

    /// Ends the program by raising SIGINT itself, so that a shell loop that calls the program also ends.
    pub fn end() -> ! {
        // SAFETY: the default handler runs no code of the program.
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
