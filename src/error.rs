//! Error type of the crate: states the failed action, the file or setting concerned, the reason and a hint.

/// Kind of a failure, which decides the exit status of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Failure caused by an input file or the command line (exit status 2).
    Input,
    /// Failure while the program runs, such as a lost graphics device or a full disk (exit status 1).
    Runtime,
    /// Cancellation of an operation by the user (exit status 1).
    Cancelled,
}

/// Error with a message of one line, `WHAT (WHERE): WHY`, and an optional hint on a second line.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what} ({place}): {why}")]
pub struct Error {
    /// Kind of the failure: input, runtime or cancellation.
    pub fault: Fault,
    /// Action that failed, as the error message states it, e.g. `cannot read volume`.
    pub what: String,
    /// File, command-line flag or setting to which the error refers.
    pub place: String,
    /// Reason why the action failed, as one line of the error message.
    pub why: String,
    /// Hint how to avoid the error, printed below the message as a `hint:` line.
    pub hint: Option<String>,
}

/// `Result` with the error type of this crate as default.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Creates an error that an input file or the command line caused.
    pub fn input(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Input, what, place, why)
    }

    /// Creates an error that happened while the program was running.
    pub fn runtime(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Runtime, what, place, why)
    }

    /// Creates the error of an operation that the user cancelled; `place` names the cancelled step.
    pub fn cancelled(place: impl ToString) -> Self {
        Self::new(Fault::Cancelled, "cancelled", place, "it was ended on request")
    }

    /// Returns whether the error is a cancellation by the user.
    pub fn is_cancelled(&self) -> bool {
        self.fault == Fault::Cancelled
    }

    fn new(fault: Fault, what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        // Messages of libraries and files may contain line ends, and control characters that act on a terminal.
        let one_line = |s: String| {
            let joined = s.split_whitespace().collect::<Vec<_>>().join(" ");
            joined.replace(char::is_control, "\u{fffd}")
        };
        let [what, place, why] = [what.to_string(), place.to_string(), why.to_string()].map(one_line);
        Self { fault, what, place, why, hint: None }
    }

    /// Adds a hint how to avoid the problem to an error.
    #[must_use]
    pub fn hint(mut self, hint: impl ToString) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Prefixes the location in an error message with the flag or file that contains it: `--methods: LOCATION`.
    #[must_use]
    pub fn at(mut self, outer: impl std::fmt::Display) -> Self {
        self.place =
            if self.place.is_empty() { outer.to_string() } else { format!("{outer}: {}", self.place) };
        self
    }

    /// Exit status of the program for an error: 2 for errors in input files or the command line, 1 for all others.
    pub fn exit_status(&self) -> u8 {
        match self.fault {
            Fault::Input => 2,
            Fault::Runtime | Fault::Cancelled => 1,
        }
    }
}
