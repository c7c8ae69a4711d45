//! Transfer functions of other programs, read and written: a format is a file here and an entry of [`TRANSFER_FORMATS`].
//!
//! What is read is told by its content first and by its name second. What a format has and a [`TransferFunction`] has not
//! is approximated where that can be said with a figure, else left out; each such thing is a warning.

mod alike;
mod carried;
mod color_space;
mod curve;
mod inviwo;
mod niivue;
mod numbers;
mod paraview;
mod pieces;
mod slicer;
#[cfg(test)]
mod tests;
mod write;

pub use alike::{alike, are_alike};
pub use carried::{Carried, FRACTION};
pub use write::{Written, is_of_fractions};

use super::TransferFunction;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use serde_json::Value;
use std::path::Path;

/// A text to be read, and what it is as JSON.
struct Source<'a> {
    text: &'a str,
    json: Option<Value>,
}

/// What makes a file's text of a function.
pub type Write = fn(&TransferFunction) -> Result<Written, String>;

/// A format of transfer functions.
pub struct TransferFormat {
    /// What `tf convert --to` calls it, and reports say.
    pub name: &'static str,
    /// One line for help and documentation.
    pub about: &'static str,
    /// Ending of its files.
    pub ending: &'static str,
    is_one: fn(&Source<'_>) -> bool,
    read: fn(&Source<'_>) -> Result<Carried, String>,
    /// The text of a file, where it can be written.
    pub write: Option<Write>,
}

/// Text longer than this is no other program's: it is read as our own alone, which takes less memory.
const MOST_FOREIGN_BYTES: usize = 16 << 20;

/// Every format, in the order in which a content is held against them.
pub const TRANSFER_FORMATS: &[TransferFormat] = &[
    TransferFormat {
        name: "paraview",
        about: "ParaView colour maps",
        ending: "json",
        is_one: |source| source.json.as_ref().is_some_and(paraview::is_one),
        read: |source| paraview::read(json(source)?),
        write: Some(write::paraview),
    },
    TransferFormat {
        name: "vp.json",
        about: "3D Slicer volume properties in JSON",
        ending: "vp.json",
        is_one: |source| source.json.as_ref().is_some_and(slicer::is_json),
        read: |source| slicer::read_json(json(source)?),
        write: None,
    },
    TransferFormat {
        name: "niivue",
        about: "MRIcroGL and NiiVue colour maps",
        ending: "json",
        is_one: |source| source.json.as_ref().is_some_and(niivue::is_one),
        read: |source| niivue::read(json(source)?),
        write: None,
    },
    TransferFormat {
        name: "umbravox",
        about: "this program's own",
        ending: "json",
        is_one: |source| source.text.trim_start().starts_with(['{', '[']),
        read: |source| {
            let tf = TransferFunction::from_json(source.text)?;
            Ok(Carried { tf, warnings: Vec::new(), format: "umbravox" })
        },
        write: Some(|tf| Ok(Written { text: tf.to_json() + "\n", warnings: Vec::new() })),
    },
    TransferFormat {
        name: "inviwo",
        about: "Inviwo transfer functions",
        ending: "itf",
        is_one: |source| inviwo::is_one(source.text),
        read: |source| inviwo::read(source.text),
        write: None,
    },
    TransferFormat {
        name: "vp",
        about: "3D Slicer volume properties",
        ending: "vp",
        is_one: |source| slicer::is_vp(source.text),
        read: |source| slicer::read_vp(source.text),
        write: Some(write::vp),
    },
];

fn json<'a>(source: &'a Source<'_>) -> Result<&'a Value, String> {
    source.json.as_ref().ok_or_else(|| "it is not JSON".into())
}

/// Endings of files that are read, each once.
pub fn endings() -> Vec<&'static str> {
    // The last part alone: dialogs know no more.
    let mut all: Vec<&str> =
        TRANSFER_FORMATS.iter().map(|f| f.ending.rsplit('.').next().unwrap_or(f.ending)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Whether a name ends as those of files that are read do.
pub fn has_ending(path: &Path) -> bool {
    path.extension().is_some_and(|e| endings().iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Reads a text; `file_name` decides where its content does not.
///
/// # Errors
/// Why it is no transfer function of the format that it seems to be, in one line.
pub fn from_text(text: &str, file_name: &str) -> Result<Carried, String> {
    let json = if text.len() <= MOST_FOREIGN_BYTES { serde_json::from_str(text).ok() } else { None };
    let source = Source { text, json };
    let by_content = TRANSFER_FORMATS.iter().find(|f| (f.is_one)(&source));
    let name = file_name.to_ascii_lowercase();
    let by_name = || TRANSFER_FORMATS.iter().filter(|f| name.ends_with(&format!(".{}", f.ending)));
    let format = by_content.or_else(|| by_name().max_by_key(|f| (f.ending.len(), f.name == "umbravox")));
    let own = || TRANSFER_FORMATS.iter().find(|f| f.name == "umbravox");
    let format = format.or_else(own).ok_or("there is no format")?;
    if source.text.len() > MOST_FOREIGN_BYTES && format.name != "umbravox" {
        return Err("it is longer than any transfer function".into());
    }
    (format.read)(&source).map_err(|why| {
        // Parsers quote what they found, line ends too.
        let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
        if format.name == "umbravox" { why } else { format!("{why} ({})", format.about) }
    })
}

/// Reads a file of any format.
///
/// # Errors
/// The file cannot be read, or is none; the error says why.
pub fn read(path: &Path) -> Result<Carried> {
    const WHAT: &str = "cannot read transfer function";
    let text = read_text(path, WHAT)?;
    let file_name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut carried = from_text(&text, &file_name).map_err(|why| Error::input(WHAT, path.display(), why))?;
    if carried.tf.name.is_empty() {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        carried.tf.name = stem.strip_suffix(".vp").unwrap_or(&stem).to_owned();
    }
    Ok(carried)
}
