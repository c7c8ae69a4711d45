//! Readers and writers of other programs' transfer-function files. A format is one file here and one entry of
//! [`TRANSFER_FORMATS`].
//!
//! The content of a file decides its format, or else the file's name. Features that a [`TransferFunction`] lacks are
//! approximated if the error can be stated, and skipped otherwise. Each such feature causes a warning.

mod color_space;
mod curve;
mod import;
mod inviwo;
mod json;
mod niivue;
mod paraview;
mod quantity;
mod sampling;
mod slicer;
#[cfg(test)]
mod tests;
mod write;

pub use import::{FRACTION, Imported};
pub use quantity::with_quantity_of;
pub use write::{Written, has_fractions};

use super::TransferFunction;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use serde_json::Value;
use std::path::Path;

/// Text of a transfer-function file, with its parsed JSON value if the text is JSON.
struct FormatInput<'a> {
    text: &'a str,
    json: Option<Value>,
}

impl FormatInput<'_> {
    fn json(&self) -> Result<&Value, String> {
        self.json.as_ref().ok_or_else(|| "it is not JSON".into())
    }

    fn is_json(&self, recognise: fn(&Value) -> bool) -> bool {
        self.json.as_ref().is_some_and(recognise)
    }
}

/// Function that writes a transfer function as the text of one file format.
pub type Write = fn(&TransferFunction) -> Result<Written, String>;

/// File format of transfer functions: its name, file extension, reader and writer.
#[derive(Debug)]
pub struct TransferFormat {
    /// Name of the transfer-function format for `tf convert --to` and in messages.
    pub name: &'static str,
    /// Description of the transfer-function format in one line.
    pub about: &'static str,
    /// File-name extension of the transfer-function format, without the first dot.
    pub ending: &'static str,
    recognise: fn(&FormatInput<'_>) -> bool,
    read: fn(&FormatInput<'_>) -> Result<Imported, String>,
    /// Writer of the transfer-function format; `None` if it can only be read.
    pub write: Option<Write>,
}

/// Size of the largest transfer-function file that is read, bytes. Parsed JSON takes far more memory than its text.
const MOST_BYTES: usize = 16 << 20;

/// List of all transfer-function file formats. A file is read by the first format that recognises its text.
pub const TRANSFER_FORMATS: &[TransferFormat] = &[
    TransferFormat {
        name: "paraview",
        about: "ParaView colour maps",
        ending: "json",
        recognise: |source| source.is_json(paraview::is_one),
        read: |source| paraview::read(source.json()?),
        write: Some(write::paraview),
    },
    TransferFormat {
        name: "vp.json",
        about: "3D Slicer volume properties in JSON",
        ending: "vp.json",
        recognise: |source| source.is_json(slicer::is_json),
        read: |source| slicer::read_json(source.json()?),
        write: None,
    },
    TransferFormat {
        name: "niivue",
        about: "MRIcroGL and NiiVue colour maps",
        ending: "json",
        recognise: |source| source.is_json(niivue::is_one),
        read: |source| niivue::read(source.json()?),
        write: None,
    },
    TransferFormat {
        name: OWN,
        about: "this program's own",
        ending: "json",
        recognise: |source| source.text.trim_start().starts_with(['{', '[']),
        read: |source| {
            let tf = TransferFunction::from_json(source.text)?;
            Ok(Imported { tf, warnings: Vec::new(), format: OWN })
        },
        write: Some(|tf| Ok(Written { text: tf.to_json() + "\n", warnings: Vec::new() })),
    },
    TransferFormat {
        name: "inviwo",
        about: "Inviwo transfer functions",
        ending: "itf",
        recognise: |source| inviwo::is_one(source.text),
        read: |source| inviwo::read(source.text),
        write: None,
    },
    TransferFormat {
        name: "vp",
        about: "3D Slicer volume properties",
        ending: "vp",
        recognise: |source| slicer::is_vp(source.text),
        read: |source| slicer::read_vp(source.text),
        write: Some(write::vp),
    },
];

const OWN: &str = "umbravox";

/// File extensions of all transfer-function formats for file dialogs; for `.vp.json` it lists only `json`.
pub fn endings() -> Vec<&'static str> {
    let mut all: Vec<&str> =
        TRANSFER_FORMATS.iter().map(|f| f.ending.rsplit('.').next().unwrap_or(f.ending)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Whether a file name has the extension of a transfer-function format.
pub fn has_ending(path: &Path) -> bool {
    path.extension().is_some_and(|e| endings().iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Reads a transfer function from the text of a file. `file_name` decides the file format if the content does not.
///
/// # Errors
/// The text breaks the rules of its file format; the reason is one line.
pub fn from_text(text: &str, file_name: &str) -> Result<Imported, String> {
    if text.len() > MOST_BYTES {
        return Err("it is longer than any transfer function".into());
    }
    let source = FormatInput { text, json: serde_json::from_str(text).ok() };
    let name = file_name.to_ascii_lowercase();
    let by_name = || TRANSFER_FORMATS.iter().filter(|f| name.ends_with(&format!(".{}", f.ending)));
    let format = (TRANSFER_FORMATS.iter().find(|f| (f.recognise)(&source)))
        .or_else(|| by_name().max_by_key(|f| (f.ending.len(), f.name == OWN)))
        .or_else(|| TRANSFER_FORMATS.iter().find(|f| f.name == OWN))
        .ok_or("there is no format")?;
    (format.read)(&source).map_err(|why| {
        // Parsers quote the text, including its line ends.
        let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
        if format.name == OWN { why } else { format!("{why} ({})", format.about) }
    })
}

/// Reads a transfer-function file of any known format.
///
/// # Errors
/// The file cannot be read, or is no transfer function.
pub fn read(path: &Path) -> Result<Imported> {
    const WHAT: &str = "cannot read transfer function";
    let text = read_text(path, WHAT)?;
    let file_name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut imported = from_text(&text, &file_name).map_err(|why| Error::input(WHAT, path.display(), why))?;
    if imported.tf.name.is_empty() {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        imported.tf.name = stem.strip_suffix(".vp").unwrap_or(&stem).to_owned();
    }
    Ok(imported)
}
