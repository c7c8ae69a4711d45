//! The one error type: what failed, where, why, and a way out where there is one.

/// Whose fault a failure is; it decides the exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The input or the command line is at fault (exit status 2).
    Input,
    /// Something failed while running: device lost, disk full (exit status 1).
    Runtime,
    /// Nobody's: whoever waited asked for it to end (exit status 1).
    Cancelled,
}

/// A failure as one line, `WHAT (WHERE): WHY`, with an optional hint on a second line.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what} ({place}): {why}")]
pub struct Error {
    /// Whose fault it is.
    pub fault: Fault,
    /// What could not be done, e.g. `cannot read volume`.
    pub what: String,
    /// The file, flag or key concerned.
    pub place: String,
    /// The reason, in one line.
    pub why: String,
    /// A way out, printed as a `hint:` line.
    pub hint: Option<String>,
}

/// Result of everything fallible in this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// The input or the command line is at fault.
    pub fn input(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Input, what, place, why)
    }

    /// Something failed while running.
    pub fn runtime(what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        Self::new(Fault::Runtime, what, place, why)
    }

    /// What was being done was ended on request; `place` says at which step.
    pub fn cancelled(place: impl ToString) -> Self {
        Self::new(Fault::Cancelled, "cancelled", place, "it was ended on request")
    }

    /// Whether it was only ended on request.
    pub fn is_cancelled(&self) -> bool {
        self.fault == Fault::Cancelled
    }

    fn new(fault: Fault, what: impl ToString, place: impl ToString, why: impl ToString) -> Self {
        // An error is one line whatever a library's message looks like.
        // ... and holds nothing that a terminal would take for a command.
        let shown = |c: char| if c.is_control() { '\u{fffd}' } else { c };
        let one_line = |s: String| {
            s.split_whitespace().collect::<Vec<_>>().join(" ").chars().map(shown).collect::<String>()
        };
        Self {
            fault,
            what: one_line(what.to_string()),
            place: one_line(place.to_string()),
            why: one_line(why.to_string()),
            hint: None,
        }
    }

    /// Adds a way out.
    #[must_use]
    pub fn hint(mut self, hint: impl ToString) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Says which flag or file the place is in: `--methods: PLACE`.
    #[must_use]
    pub fn at(mut self, outer: impl std::fmt::Display) -> Self {
        self.place = format!("{outer}: {}", self.place);
        self
    }

    /// The process exit status: 2 where the input or the command line is at fault, 1 for all else.
    pub fn exit_status(&self) -> u8 {
        match self.fault {
            Fault::Input => 2,
            Fault::Runtime | Fault::Cancelled => 1,
        }
    }
}
