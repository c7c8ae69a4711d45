//! The `.hair` format of Cem Yuksel, read and written whole.
//!
//! 128 bytes of header, little-endian: `HAIR`; number of strands, number of points (u32); flags (u32: 1 segments, 2
//! points, 4 thickness, 8 transparency, 16 colours); default segments (u32), thickness, transparency (f32), colour
//! (3 f32); 88 bytes of information. Then the arrays that the flags name, in that order: u16 a strand for segments,
//! f32 a point for the others (three for points and colours), and nothing after them.
//!
//! Source: <http://www.cemyuksel.com/research/hairmodels/>, "HAIR file format".

use super::super::{Attribute, Flaw, Part, StrandArrays, Strands};
use super::input::{WHAT, open};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::{check_output, write_whole};
use std::io::{self, Read, Write};
use std::path::Path;

/// Size of the header.
pub const HEADER_BYTES: u64 = 128;

/// File-name ending of the format.
pub const HAIR_EXTENSIONS: &[&str] = &["hair"];

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"HAIR";

/// What the format counts the segments of a strand with.
const MOST_SEGMENTS: u32 = u16::MAX as u32;

const SEGMENTS: u32 = 1;
const POINTS: u32 = 2;
const THICKNESS: u32 = 4;
const TRANSPARENCY: u32 = 8;
const COLORS: u32 = 16;

/// Elements converted at a time.
const CHUNK: usize = 1 << 16;

/// Every array with its flag, name and bytes: one element a strand or one a point.
const ARRAYS: [(u32, Part, &str, u64); 5] = [
    (SEGMENTS, Part::Segments, "segment", 2),
    (POINTS, Part::Points, "point", 12),
    (THICKNESS, Part::Thickness, "thickness", 4),
    (TRANSPARENCY, Part::Transparency, "transparency", 4),
    (COLORS, Part::Color, "colour", 12),
];

/// The header as it stands in the file.
struct Header {
    strands: u32,
    points: u32,
    flags: u32,
    default_segments: u32,
    default_thickness: f32,
    default_transparency: f32,
    default_color: [f32; 3],
    info: [u8; 88],
}

impl Header {
    fn from_bytes(bytes: &[u8; HEADER_BYTES as usize]) -> Self {
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let (integer, float) = (|at| u32::from_le_bytes(word(at)), |at| f32::from_le_bytes(word(at)));
        let mut info = [0; 88];
        info.copy_from_slice(&bytes[40..]);
        Self {
            strands: integer(4),
            points: integer(8),
            flags: integer(12),
            default_segments: integer(16),
            default_thickness: float(20),
            default_transparency: float(24),
            default_color: [float(28), float(32), float(36)],
            info,
        }
    }

    /// First byte of an array, or of the end where `part` is `None`; at most 2^37.
    fn offset(&self, part: Option<Part>) -> u64 {
        let before = ARRAYS.iter().take_while(|(_, p, ..)| Some(*p) != part);
        let present = before.filter(|(flag, ..)| self.flags & flag != 0);
        HEADER_BYTES + present.map(|(flag, .., bytes)| self.entries(*flag) * bytes).sum::<u64>()
    }

    fn entries(&self, flag: u32) -> u64 {
        u64::from(if flag == SEGMENTS { self.strands } else { self.points })
    }

    /// The byte that a flaw is at.
    fn place(&self, flaw: &Flaw) -> u64 {
        let default = match flaw.part {
            Part::Count | Part::Points => 8,
            Part::Segments => 16,
            Part::Thickness => 20,
            Part::Transparency => 24,
            Part::Color => 28,
        };
        let bytes = ARRAYS.iter().find(|(_, p, ..)| *p == flaw.part).map_or(0, |a| a.3);
        flaw.entry.map_or(default, |entry| self.offset(Some(flaw.part)) + entry as u64 * bytes)
    }
}

/// Reads a `.hair` file. Nothing is allocated before the file has been seen to be as long as its header says.
///
/// # Errors
/// The file cannot be read, is cut short or longer than its header says, or holds numbers that mean
/// nothing; the error names the byte.
pub fn read_hair(path: &Path) -> Result<Strands> {
    read_hair_with(path, &Loading::default())
}

/// As [`read_hair`], watched and ended early through `loading`.
pub fn read_hair_with(path: &Path, loading: &Loading) -> Result<Strands> {
    let (mut input, length) = open(path, loading)?;
    parse(&mut input, length, &path.display().to_string())
}

/// Reads an input of `length` bytes.
pub(super) fn parse(input: &mut dyn Read, length: u64, source: &str) -> Result<Strands> {
    let at = |byte: u64, why: String| Error::input(WHAT, format!("{source}: byte {byte}"), why);
    let refuse = |e: io::Error| Error::input(WHAT, source, e);
    if length < HEADER_BYTES {
        return Err(at(length, format!("the file ends within the header of {HEADER_BYTES} bytes")));
    }
    let mut bytes = [0; HEADER_BYTES as usize];
    input.read_exact(&mut bytes).map_err(refuse)?;
    if &bytes[..4] != MAGIC {
        return Err(at(0, "it does not begin with `HAIR`".into()));
    }
    let header = Header::from_bytes(&bytes);
    if header.flags >> ARRAYS.len() != 0 {
        return Err(at(12, format!("flags {:#x} name arrays that the format does not have", header.flags)));
    }
    if header.flags & POINTS == 0 {
        return Err(at(12, "there is no array of points".into()));
    }
    check_length(&header, length).map_err(|(byte, why)| at(byte, why))?;

    let segments = read_array(input, &header, SEGMENTS, u16::from_le_bytes).map_err(refuse)?;
    let points = read_array(input, &header, POINTS, triple).map_err(refuse)?.unwrap_or_default();
    let thickness = read_array(input, &header, THICKNESS, f32::from_le_bytes).map_err(refuse)?;
    let transparency = read_array(input, &header, TRANSPARENCY, f32::from_le_bytes).map_err(refuse)?;
    let color = read_array(input, &header, COLORS, triple).map_err(refuse)?;
    let widened = |counts: Vec<u16>| counts.into_iter().map(u32::from).collect();
    let arrays = StrandArrays {
        strands: header.strands,
        segments: Attribute { default: header.default_segments, values: segments.map(widened) },
        points,
        thickness_mm: Attribute { default: header.default_thickness, values: thickness },
        transparency: Attribute { default: header.default_transparency, values: transparency },
        color: Attribute { default: header.default_color, values: color },
        info: header.info,
    };
    Strands::new(source, arrays).map_err(|flaw| at(header.place(&flaw), flaw.why))
}

/// Refuses a file that is not exactly as long as its header says, or a header whose own numbers disagree.
fn check_length(header: &Header, length: u64) -> Result<(), (u64, String)> {
    if header.flags & SEGMENTS == 0 {
        let wanted = u64::from(header.strands) * (u64::from(header.default_segments) + 1);
        if wanted != u64::from(header.points) {
            let Header { strands, default_segments, points, .. } = header;
            let why = format!(
                "{strands} strands of {default_segments} segments have {wanted} points, not {points}"
            );
            return Err((8, why));
        }
    }
    for (flag, part, name, bytes) in ARRAYS.into_iter().filter(|(flag, ..)| header.flags & flag != 0) {
        let start = header.offset(Some(part));
        let end = start + header.entries(flag) * bytes;
        if length < end {
            return Err((length, format!("the file ends there; the {name} array is bytes {start} to {end}")));
        }
    }
    let end = header.offset(None);
    if length > end {
        return Err((end, format!("the arrays end there, but {} bytes follow", length - end)));
    }
    Ok(())
}

fn triple(bytes: [u8; 12]) -> [f32; 3] {
    [0, 4, 8].map(|i| f32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]))
}

/// The array of a flag, where the header names it.
fn read_array<T, const N: usize>(
    input: &mut dyn Read,
    header: &Header,
    flag: u32,
    convert: impl Fn([u8; N]) -> T,
) -> io::Result<Option<Vec<T>>> {
    if header.flags & flag == 0 {
        return Ok(None);
    }
    let count = usize::try_from(header.entries(flag)).map_err(|_| io::ErrorKind::OutOfMemory)?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| io::ErrorKind::OutOfMemory)?;
    let mut bytes = vec![0; N * count.min(CHUNK)];
    while values.len() < count {
        let piece = &mut bytes[..N * (count - values.len()).min(CHUNK)];
        input.read_exact(piece)?;
        values.extend(piece.as_chunks::<N>().0.iter().map(|&b| convert(b)));
    }
    Ok(Some(values))
}

/// Writes strands as a `.hair` file, whole or not at all; what was read comes back byte by byte.
///
/// # Errors
/// The name does not end in `.hair`, a strand has more segments than the format counts, or the file cannot be written.
pub fn write_hair(strands: &Strands, path: &Path) -> Result<()> {
    check_output(path, HAIR_EXTENSIONS)?;
    let counts = strands.arrays().segments.values.iter().flatten();
    if let Some(many) = counts.max().filter(|count| **count > MOST_SEGMENTS) {
        let why = format!("a strand has {many} segments, and the format ends at {MOST_SEGMENTS}");
        return Err(Error::input("cannot write strands", path.display(), why));
    }
    write_whole(path, |file| write_all(strands.arrays(), file))
}

fn write_all(arrays: &StrandArrays, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    let flag = |bit: u32, present: bool| if present { bit } else { 0 };
    let flags = POINTS
        | flag(SEGMENTS, arrays.segments.values.is_some())
        | flag(THICKNESS, arrays.thickness_mm.values.is_some())
        | flag(TRANSPARENCY, arrays.transparency.values.is_some())
        | flag(COLORS, arrays.color.values.is_some());
    out.write_all(MAGIC)?;
    // `Strands` refuses more points than a u32 counts.
    for integer in [arrays.strands, arrays.points.len() as u32, flags, arrays.segments.default] {
        out.write_all(&integer.to_le_bytes())?;
    }
    let [r, g, b] = arrays.color.default;
    for float in [arrays.thickness_mm.default, arrays.transparency.default, r, g, b] {
        out.write_all(&float.to_le_bytes())?;
    }
    out.write_all(&arrays.info)?;
    for count in arrays.segments.values.iter().flatten() {
        // Checked before.
        out.write_all(&(*count as u16).to_le_bytes())?;
    }
    let mut floats = |values: &[f32]| values.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()));
    floats(arrays.points.as_flattened())?;
    floats(arrays.thickness_mm.values.as_deref().unwrap_or_default())?;
    floats(arrays.transparency.values.as_deref().unwrap_or_default())?;
    floats(arrays.color.values.as_deref().unwrap_or_default().as_flattened())
}
