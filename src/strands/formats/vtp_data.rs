//! The bytes of an array of a `.vtp` file, within its text or appended.

use crate::files::vtk_xml::{Coding, array_bytes};
use roxmltree::Node;
use std::io::Read;

/// All arrays of a file together have no more numbers than this, which take 1 GiB.
pub(super) const MOST_NUMBERS: u64 = 1 << 27;

/// Data behind the mark of `AppendedData`.
#[derive(Clone, Copy)]
pub(super) struct Appended<'a> {
    /// Up to the end of the file.
    pub bytes: &'a [u8],
    /// In base64 otherwise.
    pub raw: bool,
}

/// The bytes of an array, at most so many.
///
/// # Errors
/// They are not there, broken, or more than that.
pub(super) fn bytes_of(
    array: Node,
    coding: &Coding,
    appended: Option<Appended>,
    most: u64,
) -> Result<Vec<u8>, String> {
    let (input, is_raw) = match array.attribute("format") {
        Some("binary") => (array.text().unwrap_or_default().trim().as_bytes(), false),
        Some("appended") => {
            let text = array.attribute("offset").unwrap_or_default();
            let Appended { bytes, raw } = appended.ok_or("the file has no appended data")?;
            let offset = text.trim().parse::<usize>().map_err(|_| format!("its offset is `{text}`"))?;
            let bytes =
                bytes.get(offset..).ok_or_else(|| format!("its offset {offset} is beyond the file"))?;
            (bytes, raw)
        }
        other => return Err(format!("its format is {}", other.unwrap_or("not said"))),
    };
    let mut array = array_bytes(input, is_raw, coding, |bytes| refuse_above(bytes, most))?;
    let mut all = Vec::new();
    array.read_to_end(&mut all).map_err(|e| e.to_string())?;
    match all.len() as u64 == array.bytes {
        true => Ok(all),
        false => Err(format!("{} bytes are said to follow, but it ends before", array.bytes)),
    }
}

fn refuse_above(bytes: u64, most: u64) -> Result<(), String> {
    match bytes > most {
        true => {
            let limit = format!(
                "arrays of {MOST_NUMBERS} numbers in all are read, and {most} bytes are left of that"
            );
            Err(format!("it is of {bytes} bytes; {limit}"))
        }
        false => Ok(()),
    }
}
