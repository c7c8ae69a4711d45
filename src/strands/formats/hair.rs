//! Lossless reader and writer of Cem Yuksel's `.hair` files (hair strands).
//!
//! The header has 128 bytes, little-endian: `HAIR`; number of strands, number of points (u32); flags (u32: 1
//! segments, 2 points, 4 thickness, 8 transparency, 16 colours); default values for segments (u32), thickness,
//! transparency (f32) and colour (3 f32); 88 bytes of information text. One array for each set flag follows, in the
//! order of the flags. The segments array holds one u16 for each strand. The others hold one f32 for each point, or
//! three for points and colours. The file ends behind the last array.
//!
//! Source: <http://www.cemyuksel.com/research/hairmodels/>, "HAIR file format".

use super::super::{Attribute, Flaw, StrandArrays, StrandQuantity, Strands};
use super::input::WHAT;
use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use bytemuck::{Pod, Zeroable};
use std::io::{self, Read, Write};
use std::path::Path;

/// Size of the header of a `.hair` file, bytes.
pub const HEADER_BYTES: u64 = size_of::<HairHeader>() as u64;

/// File-name extensions of the `.hair` format of strands.
pub const HAIR_EXTENSIONS: &[&str] = &["hair"];

/// First four bytes of every `.hair` file.
pub(super) const MAGIC: &[u8; 4] = b"HAIR";

/// Largest number of segments of one strand in a `.hair` file, which stores it as a u16.
const MOST_SEGMENTS: u32 = u16::MAX as u32;

/// Number of bytes of a `.hair` file that are read at a time.
const CHUNK_BYTES: usize = 1 << 18;

/// Byte offset of the number of points in the header of a `.hair` file.
const POINT_COUNT: u64 = 8;

/// Arrays that a `.hair` file may contain, in the order of their flags: quantity, name, bytes of one entry, and byte
/// offset of the default value in the header.
const ARRAYS: [(StrandQuantity, &str, u64, u64); 5] = [
    (StrandQuantity::Segments, "segment", 2, 16),
    (StrandQuantity::Points, "point", 12, POINT_COUNT),
    (StrandQuantity::Thickness, "thickness", 4, 20),
    (StrandQuantity::Transparency, "transparency", 4, 24),
    (StrandQuantity::Color, "colour", 12, 28),
];

/// Header of a `.hair` file in its binary layout.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct HairHeader {
    magic: [u8; 4],
    strands: u32,
    points: u32,
    flags: u32,
    default_segments: u32,
    default_thickness: f32,
    default_transparency: f32,
    default_color: [f32; 3],
    /// Information text of the `.hair` file, 88 bytes.
    info: [[u8; 8]; 11],
}

#[cfg(target_endian = "big")]
compile_error!("the header and arrays of .hair files are read as they lie in memory, little-endian");

impl HairHeader {
    /// Returns the arrays that the `.hair` file contains: quantity, name, and byte offsets of the array's begin and
    /// end (exclusive, at most 2^37).
    fn arrays(&self) -> impl Iterator<Item = (StrandQuantity, &'static str, u64, u64)> {
        let mut end = HEADER_BYTES;
        let present = ARRAYS.into_iter().filter(|(part, ..)| self.has(*part));
        present.map(move |(part, name, bytes, _)| {
            let start = end;
            end += bytes * self.entries(part) as u64;
            (part, name, start, end)
        })
    }

    fn has(&self, part: StrandQuantity) -> bool {
        ARRAYS.iter().position(|(p, ..)| *p == part).is_some_and(|bit| self.flags >> bit & 1 == 1)
    }

    fn entries(&self, part: StrandQuantity) -> usize {
        (if part == StrandQuantity::Segments { self.strands } else { self.points }) as usize
    }

    /// Returns the byte offset of the invalid number that an error reports in the `.hair` file.
    fn place(&self, flaw: &Flaw) -> u64 {
        let array = ARRAYS.into_iter().find(|(part, ..)| *part == flaw.part);
        let (_, _, bytes, default) = array.unwrap_or((flaw.part, "", 0, POINT_COUNT));
        let start = self.arrays().find(|(part, ..)| *part == flaw.part).map_or(0, |array| array.2);
        flaw.entry.map_or(default, |entry| start + entry as u64 * bytes)
    }

    /// Returns an error if the length of a `.hair` file differs from the length that its header implies, or if the
    /// header contradicts itself.
    fn check_length(&self, length: u64) -> Result<(), (u64, String)> {
        let Self { strands, default_segments, points, .. } = *self;
        let wanted = u64::from(strands) * (u64::from(default_segments) + 1);
        if !self.has(StrandQuantity::Segments) && wanted != u64::from(points) {
            let why = format!(
                "{strands} strands of {default_segments} segments have {wanted} points, not {points}"
            );
            return Err((POINT_COUNT, why));
        }
        let mut all = HEADER_BYTES;
        for (_, name, start, end) in self.arrays() {
            if length < end {
                let why = format!("the file ends there; the {name} array is bytes {start} to {end}");
                return Err((length, why));
            }
            all = end;
        }
        match length - all {
            0 => Ok(()),
            more => Err((all, format!("the arrays end there, but {more} bytes follow"))),
        }
    }

    /// Reads one array of a `.hair` file; `None` if the file does not contain it.
    fn read<T: Pod>(&self, part: StrandQuantity, input: &mut dyn Read) -> io::Result<Option<Vec<T>>> {
        if !self.has(part) {
            return Ok(None);
        }
        let mut values = Vec::new();
        values.try_reserve_exact(self.entries(part)).map_err(|_| io::ErrorKind::OutOfMemory)?;
        values.resize(self.entries(part), T::zeroed());
        let mut pieces = bytemuck::cast_slice_mut(&mut values).chunks_mut(CHUNK_BYTES);
        pieces.try_for_each(|piece| input.read_exact(piece))?;
        Ok(Some(values))
    }
}

/// Parses a `.hair` file of `length` bytes. It allocates memory only after the length agrees with the header.
///
/// # Errors
/// The input is cut short or longer than its header claims, or holds invalid numbers; the error names the byte.
pub(super) fn parse(input: &mut dyn Read, length: u64, source: &str) -> Result<Strands> {
    let at = |byte: u64, why: String| Error::input(WHAT, format!("{source}: byte {byte}"), why);
    let refuse = |e: io::Error| Error::input(WHAT, source, e);
    if length < HEADER_BYTES {
        return Err(at(length, format!("the file ends within the header of {HEADER_BYTES} bytes")));
    }
    let mut header = HairHeader::zeroed();
    input.read_exact(bytemuck::bytes_of_mut(&mut header)).map_err(refuse)?;
    if header.magic != *MAGIC {
        return Err(at(0, "it does not begin with `HAIR`".into()));
    }
    if header.flags >> ARRAYS.len() != 0 {
        return Err(at(12, format!("flags {:#x} name arrays that the format does not have", header.flags)));
    }
    if !header.has(StrandQuantity::Points) {
        return Err(at(12, "there is no array of points".into()));
    }
    header.check_length(length).map_err(|(byte, why)| at(byte, why))?;
    let read_arrays = |input: &mut dyn Read| {
        let segments: Option<Vec<u16>> = header.read(StrandQuantity::Segments, input)?;
        Ok(StrandArrays {
            strands: header.strands,
            segments: Attribute {
                default: header.default_segments,
                values: segments.map(|counts| counts.into_iter().map(u32::from).collect()),
            },
            points: header.read(StrandQuantity::Points, input)?.unwrap_or_default(),
            thickness_mm: Attribute {
                default: header.default_thickness,
                values: header.read(StrandQuantity::Thickness, input)?,
            },
            transparency: Attribute {
                default: header.default_transparency,
                values: header.read(StrandQuantity::Transparency, input)?,
            },
            color: Attribute {
                default: header.default_color,
                values: header.read(StrandQuantity::Color, input)?,
            },
            info: std::array::from_fn(|i| header.info[i / 8][i % 8]),
        })
    };
    Strands::new(source, read_arrays(input).map_err(refuse)?)
        .map_err(|flaw| at(header.place(&flaw), flaw.why))
}

/// Writes strands as a `.hair` file, completely or not at all. A `.hair` file that was read is written back byte for
/// byte.
///
/// # Errors
/// The name does not end in `.hair`, a strand has too many segments for the format, or the file cannot be written.
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
    let StrandArrays { segments, points, thickness_mm, transparency, color, .. } = arrays;
    let counts = segments.values.as_ref().map(|counts| counts.iter().map(|n| *n as u16).collect::<Vec<_>>());
    let data: [Option<&[u8]>; 5] = [
        counts.as_deref().map(bytemuck::cast_slice),
        Some(bytemuck::cast_slice(points)),
        thickness_mm.values.as_deref().map(bytemuck::cast_slice),
        transparency.values.as_deref().map(bytemuck::cast_slice),
        color.values.as_deref().map(bytemuck::cast_slice),
    ];
    let flags = (0..).zip(&data).map(|(bit, array)| u32::from(array.is_some()) << bit).sum();
    let header = HairHeader {
        magic: *MAGIC,
        strands: arrays.strands,
        // `Strands` refuses more points than a u32 counts.
        points: points.len() as u32,
        flags,
        default_segments: segments.default,
        default_thickness: thickness_mm.default,
        default_transparency: transparency.default,
        default_color: color.default,
        info: std::array::from_fn(|i| std::array::from_fn(|j| arrays.info[8 * i + j])),
    };
    out.write_all(bytemuck::bytes_of(&header))?;
    data.into_iter().flatten().try_for_each(|bytes| out.write_all(bytes))
}
