//! Opens strand files, and creates error messages that name a byte or line of a strand file.

use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage, Watched};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Beginning of every error message about a strand file that cannot be read.
pub(super) const WHAT: &str = "cannot read strands";

/// Opens a strand file, which must be a regular file, and returns a reader and the file's length in bytes. `loading`
/// shows progress and can cancel the reading.
///
/// # Errors
/// The path is no regular file, or cannot be opened.
pub(super) fn open<'a>(path: &Path, loading: &'a Loading) -> Result<(BufReader<Watched<'a, File>>, u64)> {
    loading.begin(ReadingStage::ReadingStrands);
    let refuse = |e: io::Error| Error::input(WHAT, path.display(), e);
    // Checked before opening: opening a pipe waits for a writer for ever.
    if !std::fs::metadata(path).map_err(refuse)?.is_file() {
        return Err(Error::input(WHAT, path.display(), "it is not a regular file"));
    }
    let file = File::open(path).map_err(refuse)?;
    let length = file.metadata().map_err(refuse)?.len();
    Ok((BufReader::new(Watched::new(file, length, loading)), length))
}

/// Reads all bytes of a strand file of at most `length` bytes.
///
/// # Errors
/// The input cannot be read, or memory does not hold it.
pub(super) fn read_whole(input: &mut dyn Read, length: u64, source: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let reserved = usize::try_from(length).ok().and_then(|n| bytes.try_reserve_exact(n).ok());
    if reserved.is_none() {
        return Err(Error::input(WHAT, source, format!("there is not enough memory for its {length} bytes")));
    }
    input.take(length).read_to_end(&mut bytes).map_err(|e| Error::input(WHAT, source, e))?;
    Ok(bytes)
}

/// Returns an error about a strand file as a whole, without the file's path; [`Error::at`] adds the path later.
pub(super) fn in_file(why: impl ToString) -> Error {
    Error::input(WHAT, "", why)
}

/// Returns an error about invalid data at a byte offset (from 0) of a strand file.
pub(super) fn at_byte(byte: usize, why: impl ToString) -> Error {
    Error::input(WHAT, format!("byte {byte}"), why)
}

/// Returns an error about invalid text in a line (from 1) of a strand file.
pub(super) fn in_line(line: usize, why: impl ToString) -> Error {
    Error::input(WHAT, format!("line {line}"), why)
}
