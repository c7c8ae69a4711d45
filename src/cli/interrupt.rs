//! Ctrl-C, and the signals by which a batch system ends a job.

use super::told::say;
use crate::error::{Error, Result};
use crate::files::output::abandon_and_exit;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

static COME: AtomicU32 = AtomicU32::new(0);
static LISTENS: OnceLock<Result<(), String>> = OnceLock::new();
/// What becomes of the work, where it is ended between two steps.
static OUTCOME: OnceLock<&str> = OnceLock::new();

/// Exit status of what a signal ended, as shells have it: 128 and the number of SIGINT.
const ENDED: i32 = 130;

/// Hears interrupts (SIGINT, SIGTERM, SIGHUP) from when it is made: the first is to end the work between two steps, the
/// second ends the program at once, and leaves no half-written file either.
pub struct Interrupt(());

impl Interrupt {
    /// Starts to listen; `outcome` tells the user what becomes of the work that is done by then.
    ///
    /// # Errors
    /// The system does not let it.
    pub fn listen(outcome: &'static str) -> Result<Self> {
        // The first outcome holds: a command has one.
        let _ = OUTCOME.set(outcome);
        leave_nothing()?;
        Ok(Self(()))
    }

    /// Whether one has come.
    pub fn has_come(&self) -> bool {
        COME.load(Ordering::SeqCst) > 0
    }
}

/// From now on an interrupt that nothing else hears ends the program at once and leaves no half-written file.
///
/// # Errors
/// The system does not let it.
pub fn leave_nothing() -> Result<()> {
    let listens = LISTENS.get_or_init(|| {
        let heard = || match (COME.fetch_add(1, Ordering::SeqCst), OUTCOME.get()) {
            (0, Some(outcome)) => {
                say("note", &format_args!("ending after this step; {outcome} (once more ends at once)"));
            }
            _ => abandon_and_exit(ENDED),
        };
        ctrlc::set_handler(heard).map_err(|e| e.to_string())
    });
    listens.clone().map_err(|why| Error::runtime("cannot listen for interrupts", "signals", why))
}
