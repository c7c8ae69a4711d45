//! Notes and warnings about accepted inputs.

/// Severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Level {
    Note,
    Warning,
}

impl Level {
    /// Prefix on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
        }
    }
}

/// Note or warning about an accepted input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Severity.
    pub level: Level,
    /// One line.
    pub message: String,
}

impl Diagnostic {
    /// Note: an assumption.
    pub fn note(message: String) -> Self {
        Self { level: Level::Note, message }
    }

    /// Warning: a probable mistake.
    pub fn warning(message: String) -> Self {
        Self { level: Level::Warning, message }
    }
}
