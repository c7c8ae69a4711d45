//! Notes and warnings that the program shows about accepted inputs, such as volume files.

/// Severity of a message about an accepted input file or setting: note or warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Level {
    Note,
    Warning,
}

impl Level {
    /// Prefix of a note or warning on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
        }
    }
}

/// Note or warning for the user about an accepted input file or setting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Severity of the message: note or warning.
    pub level: Level,
    /// Text of the note or warning, one line.
    pub message: String,
}

impl Diagnostic {
    /// Creates a note, which tells the user an assumption about an input file or setting.
    pub fn note(message: String) -> Self {
        Self { level: Level::Note, message }
    }

    /// Creates a warning, which tells the user a probable mistake in an input file or setting.
    pub fn warning(message: String) -> Self {
        Self { level: Level::Warning, message }
    }
}
