//! Readers of strand files (hair, fibre tracks, polylines). A new format is one entry of [`STRAND_FORMATS`].

mod hair;
mod input;
mod lines;
mod number;
mod obj;
mod tck;
mod trk;
mod trk_space;
mod vtk;
mod vtp;

pub use hair::{HAIR_EXTENSIONS, HEADER_BYTES, write_hair};

use super::Strands;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use input::{WHAT, open};
use lines::{Polylines, read_by};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Number of bytes at the beginning of a strand file that are used to recognise its format.
const HEAD_BYTES: u64 = 1024;

/// File format of strands: its name, file-name extension and reader.
#[derive(Debug)]
pub struct StrandFormat {
    /// Name of the strand file format for messages.
    pub name: &'static str,
    /// File-name extension of the strand file format, without the dot.
    pub ending: &'static str,
    /// Whether files of this strand format can store a thickness of the strands.
    pub has_thickness: bool,
    /// Returns whether a file with these first bytes has this strand format; `None` if only the file name can tell.
    recognise: fn(&[u8]) -> Option<bool>,
    reader: Reader,
}

/// Function that reads strands from one strand file format.
#[derive(Debug)]
enum Reader {
    Hair,
    /// Parser of a strand file format that stores polylines without a thickness.
    Polylines(fn(&[u8]) -> Result<Polylines>),
}

/// Creates the description of a strand file format that stores polylines without a thickness.
const fn polylines(
    name: &'static str,
    ending: &'static str,
    recognise: fn(&[u8]) -> Option<bool>,
    parse: fn(&[u8]) -> Result<Polylines>,
) -> StrandFormat {
    StrandFormat { name, ending, has_thickness: false, recognise, reader: Reader::Polylines(parse) }
}

/// List of all file formats of strands that can be read.
pub const STRAND_FORMATS: &[StrandFormat] = &[
    StrandFormat {
        name: "Cem Yuksel's hair",
        ending: "hair",
        has_thickness: true,
        recognise: |head| head.starts_with(hair::MAGIC).then_some(true),
        reader: Reader::Hair,
    },
    polylines("MRtrix tracks", "tck", |head| head.starts_with(tck::MAGIC).then_some(true), tck::parse),
    polylines("TrackVis tracks", "trk", |head| head.starts_with(trk::MAGIC).then_some(true), trk::parse),
    polylines("VTK polygonal data", "vtk", vtk::recognise, vtk::parse),
    polylines("VTK polygonal data in XML", "vtp", vtp::recognise, vtp::parse),
    polylines("Wavefront polylines", "obj", |_| None, obj::parse),
];

/// List of the file-name extensions of all strand file formats.
pub const STRAND_EXTENSIONS: &[&str] = &["hair", "tck", "trk", "vtk", "vtp", "obj"];

impl StrandFormat {
    /// Finds the format of a strand file by its first bytes, or else by its file name.
    fn of(head: &[u8], path: &Path) -> Option<&'static Self> {
        let named = |f: &&Self| {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case(f.ending))
                && (f.recognise)(head).is_none()
        };
        let by_content = STRAND_FORMATS.iter().find(|f| (f.recognise)(head) == Some(true));
        by_content.or_else(|| STRAND_FORMATS.iter().find(named))
    }

    /// Reads strands of this file format from an input of `length` bytes; `source` is its path or name for messages.
    fn read(&self, input: &mut dyn Read, length: u64, source: &str) -> Result<Strands> {
        match self.reader {
            Reader::Hair => hair::parse(input, length, source),
            Reader::Polylines(parse) => read_by(parse, input, length, source),
        }
    }

    /// Finds the format of a strand file from its first bytes. If the file cannot be opened, only its name decides.
    pub fn of_file(path: &Path) -> Option<&'static Self> {
        let mut head = Vec::new();
        // Opening a pipe waits for a writer for ever.
        if std::fs::metadata(path).is_ok_and(|meta| meta.is_file()) {
            // The reader reports errors.
            let _ = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
        }
        Self::of(&head, path)
    }
}

/// Reads a strand file of any known format; `loading` shows progress and can cancel the reading.
///
/// # Errors
/// The file cannot be read, has no known format, breaks its format (the error names the byte or line), or was
/// cancelled.
pub fn read_strands(path: &Path, loading: &Loading) -> Result<Strands> {
    let source = path.display().to_string();
    let format = StrandFormat::of_file(path).ok_or_else(|| unknown(&source))?;
    let (mut input, length) = open(path, loading)?;
    format.read(&mut input, length, &source)
}

/// Reads strands from the bytes of a strand file; the file name helps to find its format.
///
/// # Errors
/// The bytes have no known format or break it.
pub fn strands_of_bytes(bytes: &[u8], name: &str) -> Result<Strands> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    let format = StrandFormat::of(head, Path::new(name)).ok_or_else(|| unknown(name))?;
    format.read(&mut &bytes[..], bytes.len() as u64, name)
}

fn unknown(source: &str) -> Error {
    let formats: Vec<String> = STRAND_FORMATS.iter().map(|f| format!(".{} ({})", f.ending, f.name)).collect();
    Error::input(WHAT, source, "it is of no format of strands")
        .hint(format!("there are {}", formats.join(", ")))
}
