//! The formats of strands that can be read: an entry of [`STRAND_FORMATS`] is all that one needs.

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
mod vtp_data;

pub use hair::{HAIR_EXTENSIONS, HEADER_BYTES, read_hair, read_hair_with, write_hair};

use super::Strands;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use input::{WHAT, open};
use lines::read_by;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that tell a format.
const HEAD_BYTES: u64 = 1024;

/// A format of strands.
#[derive(Debug)]
pub struct StrandFormat {
    /// What it is called.
    pub name: &'static str,
    /// The ending of its files, without the dot.
    pub ending: &'static str,
    /// Whether its files may say how thick strands are.
    pub has_thickness: bool,
    /// How a file begins; empty where nothing tells it but its name.
    magic: &'static [u8],
    /// Whether a beginning with `magic` is that of such a file after all.
    begins: fn(&[u8]) -> bool,
    /// Whether a beginning is known to be of a file of another kind, whatever its name.
    is_another: fn(&[u8]) -> bool,
    /// Reads an input of so many bytes; the text is its path or name for messages.
    read: fn(&mut dyn Read, u64, &str) -> Result<Strands>,
}

impl StrandFormat {
    /// What is not said of a format.
    const DEFAULT: Self = Self {
        name: "",
        ending: "",
        has_thickness: false,
        magic: b"",
        begins: |_| true,
        is_another: |_| false,
        read: |_, _, source| Err(Error::input(WHAT, source, "it is of no format")),
    };
}

/// Every format.
pub const STRAND_FORMATS: &[StrandFormat] = &[
    StrandFormat {
        name: "Cem Yuksel's hair",
        ending: "hair",
        has_thickness: true,
        magic: hair::MAGIC,
        read: hair::parse,
        ..StrandFormat::DEFAULT
    },
    StrandFormat {
        name: "MRtrix tracks",
        ending: "tck",
        magic: tck::MAGIC,
        read: |input, length, source| read_by(tck::parse, input, length, source),
        ..StrandFormat::DEFAULT
    },
    StrandFormat {
        name: "TrackVis tracks",
        ending: "trk",
        magic: trk::MAGIC,
        read: |input, length, source| read_by(trk::parse, input, length, source),
        ..StrandFormat::DEFAULT
    },
    StrandFormat {
        name: "VTK polygonal data",
        ending: "vtk",
        magic: vtk::MAGIC,
        begins: |head| !vtk::is_another(head),
        is_another: vtk::is_another,
        read: |input, length, source| read_by(vtk::parse, input, length, source),
        ..StrandFormat::DEFAULT
    },
    StrandFormat {
        name: "VTK polygonal data in XML",
        ending: "vtp",
        magic: b"<",
        begins: vtp::begins,
        is_another: vtp::is_another,
        read: |input, length, source| read_by(vtp::parse, input, length, source),
        ..StrandFormat::DEFAULT
    },
    StrandFormat {
        name: "Wavefront polylines",
        ending: "obj",
        read: |input, length, source| read_by(obj::parse, input, length, source),
        ..StrandFormat::DEFAULT
    },
];

/// The endings of all formats.
pub const STRAND_EXTENSIONS: &[&str] = &{
    let mut endings = [""; STRAND_FORMATS.len()];
    let mut place = 0;
    while place < endings.len() {
        endings[place] = STRAND_FORMATS[place].ending;
        place += 1;
    }
    endings
};

impl StrandFormat {
    /// The format of a file by its first bytes, or else by its name.
    fn of(head: &[u8], path: &Path) -> Option<&'static Self> {
        let by_content = |f: &&Self| !f.magic.is_empty() && head.starts_with(f.magic) && (f.begins)(head);
        let named = |f: &&Self| {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case(f.ending)) && !(f.is_another)(head)
        };
        STRAND_FORMATS.iter().find(by_content).or_else(|| STRAND_FORMATS.iter().find(named))
    }

    /// The format of a file; one that cannot be opened goes by its name alone.
    pub fn of_file(path: &Path) -> Option<&'static Self> {
        let mut head = Vec::new();
        // A pipe would wait for a writer for ever.
        if std::fs::metadata(path).is_ok_and(|meta| meta.is_file()) {
            let read = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
            // Whoever reads it in earnest says why not.
            let _ = read;
        }
        Self::of(&head, path)
    }
}

/// Reads a file of strands.
///
/// # Errors
/// The file cannot be read, is of no format, or is not as its format has it; the error names the byte or line.
pub fn read_strands(path: &Path) -> Result<Strands> {
    read_strands_with(path, &Loading::default())
}

/// As [`read_strands`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn read_strands_with(path: &Path, loading: &Loading) -> Result<Strands> {
    let source = path.display().to_string();
    let format = StrandFormat::of_file(path).ok_or_else(|| unknown(&source))?;
    let (mut input, length) = open(path, loading)?;
    (format.read)(&mut input, length, &source)
}

/// Reads the bytes of a file of strands of this name.
///
/// # Errors
/// As [`read_strands`].
pub fn strands_of_bytes(bytes: &[u8], name: &str) -> Result<Strands> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    let format = StrandFormat::of(head, Path::new(name)).ok_or_else(|| unknown(name))?;
    (format.read)(&mut &bytes[..], bytes.len() as u64, name)
}

fn unknown(source: &str) -> Error {
    let formats: Vec<String> = STRAND_FORMATS.iter().map(|f| format!(".{} ({})", f.ending, f.name)).collect();
    Error::input(WHAT, source, "it is of no format of strands")
        .hint(format!("there are {}", formats.join(", ")))
}
