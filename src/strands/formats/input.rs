//! Opening files of strands, and what is said of those that are wrong.

use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// How errors of reading begin.
pub(super) const WHAT: &str = "cannot read strands";

/// Opens a regular file, watched through `loading`; with its length in bytes.
///
/// # Errors
/// It is no regular file, or cannot be opened.
pub(super) fn open<'a>(path: &Path, loading: &'a Loading) -> Result<(BufReader<Watched<'a, File>>, u64)> {
    loading.begin(ReadingStage::ReadingStrands);
    let refuse = |e: io::Error| Error::input(WHAT, path.display(), e);
    // Asked before it is opened: a pipe would wait for a writer for ever.
    if !std::fs::metadata(path).map_err(refuse)?.is_file() {
        return Err(Error::input(WHAT, path.display(), "it is not a regular file"));
    }
    let file = File::open(path).map_err(refuse)?;
    let length = file.metadata().map_err(refuse)?.len();
    Ok((BufReader::new(Watched::new(file, length, loading)), length))
}

/// The whole of an input, which has no more than `length` bytes.
///
/// # Errors
/// It cannot be read, or memory does not hold it.
pub(super) fn whole(input: &mut dyn Read, length: u64, source: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let room = usize::try_from(length).ok().and_then(|n| bytes.try_reserve_exact(n).ok());
    if room.is_none() {
        return Err(Error::input(WHAT, source, format!("there is not enough memory for its {length} bytes")));
    }
    input.take(length).read_to_end(&mut bytes).map_err(|e| Error::input(WHAT, source, e))?;
    Ok(bytes)
}

/// Where in a file something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spot {
    File,
    Byte(usize),
    Line(usize),
}

/// What is wrong with a file.
#[derive(Debug)]
pub(super) struct Trouble {
    spot: Spot,
    why: String,
    hint: Option<&'static str>,
}

impl Trouble {
    /// Of the file as a whole.
    pub fn of_file(why: impl Into<String>) -> Self {
        Self { spot: Spot::File, why: why.into(), hint: None }
    }

    /// At a byte, from 0.
    pub fn at_byte(byte: usize, why: impl Into<String>) -> Self {
        Self { spot: Spot::Byte(byte), why: why.into(), hint: None }
    }

    /// In a line, from 1.
    pub fn in_line(line: usize, why: impl Into<String>) -> Self {
        Self { spot: Spot::Line(line), why: why.into(), hint: None }
    }

    /// With a way out.
    pub fn hint(self, hint: &'static str) -> Self {
        Self { hint: Some(hint), ..self }
    }

    /// As an error about a source.
    pub fn into_error(self, source: &str) -> Error {
        let place = match self.spot {
            Spot::File => source.to_owned(),
            Spot::Byte(byte) => format!("{source}: byte {byte}"),
            Spot::Line(line) => format!("{source}: line {line}"),
        };
        let error = Error::input(WHAT, place, self.why);
        match self.hint {
            Some(hint) => error.hint(hint),
            None => error,
        }
    }
}
