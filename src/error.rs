//! Error type of the crate: what failed, where, why, and a hint.

/// Cause of a failure; it decides the exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The input or the command line is at fault (exit status 2).
    Input,
    /// Something failed while running: device lost, disk full (exit status 1).
    Runtime,
    /// The user ended the work (exit status 1).
    Cancelled,
}

/// A failure as one line, `WHAT (WHERE): WHY`, with an optional hint on a second line.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what} ({place}): {why}")]
pub struct Error {
    /// Cause of the failure.
    pub fault: Fault,
    /// Action that failed, e.g. `cannot read volume`.
    pub what: String,
    /// File, flag or key concerned.
    pub place: String,
    /// Reason, in one line.
    pub why: String,
    /// Way out, printed as a `hint:` line.
    pub hint: Option<String>,
}

/// Result with the error type of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Error that the input or the command line caused.
    pub fn input(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Input, what, place, why)
    }

    /// Error that happened while the program was running.
    pub fn runtime(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Runtime, what, place, why)
    }

    /// Error of work that the user ended; `place` names the step.
    pub fn cancelled(place: impl ToString) -> Self {
        Self::new(Fault::Cancelled, "cancelled", place, "it was ended on request")
    }

    /// Whether the user ended the work.
    pub fn is_cancelled(&self) -> bool {
        self.fault == Fault::Cancelled
    }

    fn new(fault: Fault, what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        // Messages of libraries and files may hold line ends, and control characters that a terminal would obey.
        let one_line = |s: String| {
            let joined = s.split_whitespace().collect::<Vec<_>>().join(" ");
            joined.replace(char::is_control, "\u{fffd}")
        };
        let [what, place, why] = [what.to_string(), place.to_string(), why.to_string()].map(one_line);
        Self { fault, what, place, why, hint: None }
    }

    /// Adds a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl ToString) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Puts the flag or file that contains the place before it: `--methods: PLACE`.
    #[must_use]
    pub fn at(mut self, outer: impl std::fmt::Display) -> Self {
        self.place =
            if self.place.is_empty() { outer.to_string() } else { format!("{outer}: {}", self.place) };
        self
    }

    /// Exit status of the process: 2 for faults of the input or the command line, 1 for all others.
    pub fn exit_status(&self) -> u8 {
        match self.fault {
            Fault::Input => 2,
            Fault::Runtime | Fault::Cancelled => 1,
        }
    }
}
