//! MRtrix track files, `.tck`.
//!
//! A text header of `key: value` lines between `mrtrix tracks` and `END`; of its keys `datatype` (`Float32LE`, `Float32BE`,
//! `Float64LE`, `Float64BE`) and `file: . OFFSET` are needed, `count` is not. From that byte on points follow in scanner
//! coordinates, mm, RAS+; a point of three NaN ends a track, one of three infinities the file.
//!
//! Source: <https://mrtrix.readthedocs.io/en/latest/getting_started/image_data.html>, "Tracks file format". Read here: no
//! crate was found that does.

use super::input::Trouble;
use super::lines::Lines;
use super::number::Number;
use glam::DVec3;

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"mrtrix tracks";

/// How numbers are written, and whether their first byte is the highest.
fn number_of(datatype: &str) -> Option<(Number, bool)> {
    let lower = datatype.to_ascii_lowercase();
    // Without a byte order it is the writing machine's, which is little-endian almost everywhere.
    let (kind, big_endian) = match lower.strip_suffix("be") {
        Some(kind) => (kind, true),
        None => (lower.strip_suffix("le").unwrap_or(&lower), false),
    };
    match kind {
        "float32" => Some((Number::FLOAT32, big_endian)),
        "float64" => Some((Number::FLOAT64, big_endian)),
        _ => None,
    }
}

/// What the header says.
struct Header {
    number: Number,
    big_endian: bool,
    /// The first byte of the points.
    offset: usize,
    count: Option<u64>,
}

impl Header {
    fn of(bytes: &[u8]) -> Result<Self, Trouble> {
        let (mut datatype, mut file, mut count) = (None, None, None);
        let mut at = 0;
        for (place, line) in bytes.split_inclusive(|b| *b == b'\n').enumerate() {
            at += line.len();
            let text = String::from_utf8_lossy(line);
            let text = text.trim();
            match text.split_once(':') {
                _ if place == 0 && text.as_bytes() != MAGIC => {
                    return Err(Trouble::at_byte(0, "it does not begin with the line `mrtrix tracks`"));
                }
                _ if text == "END" => return Self::from_keys(datatype, file, count, at, bytes.len()),
                Some(("datatype", value)) => datatype = Some((place + 1, value.trim().to_owned())),
                Some(("file", value)) => file = Some((place + 1, value.trim().to_owned())),
                Some(("count", value)) => count = value.trim().parse().ok(),
                _ => {}
            }
        }
        Err(Trouble::of_file("its header does not come to the line `END`"))
    }

    /// Of the keys, each with its line, a header that ends before `end` in a file of `length` bytes.
    fn from_keys(
        datatype: Option<(usize, String)>,
        file: Option<(usize, String)>,
        count: Option<u64>,
        end: usize,
        length: usize,
    ) -> Result<Self, Trouble> {
        let missing = |key: &str| Trouble::of_file(format!("its header has no key `{key}`"));
        let (line, name) = datatype.ok_or_else(|| missing("datatype"))?;
        let (number, big_endian) = number_of(&name).ok_or_else(|| {
            let known = "Float32LE, Float32BE, Float64LE and Float64BE";
            Trouble::in_line(line, format!("the datatype `{name}` is none of {known}"))
        })?;
        let (line, file) = file.ok_or_else(|| missing("file"))?;
        let offset = file.strip_prefix('.').and_then(|rest| rest.trim().parse::<usize>().ok());
        let offset = offset.ok_or_else(|| {
            Trouble::in_line(line, format!("`file: {file}` is not `file: . OFFSET`: points are in this file"))
        })?;
        if !(end..=length).contains(&offset) {
            let why =
                format!("points are said to begin at byte {offset}, not within bytes {end} to {length}");
            return Err(Trouble::in_line(line, why));
        }
        Ok(Self { number, big_endian, offset, count })
    }
}

/// The tracks of a file.
///
/// # Errors
/// It is not as the format has it, or ends before its end mark.
pub(super) fn parse(bytes: &[u8]) -> Result<Lines, Trouble> {
    let Header { number, big_endian, offset, count } = Header::of(bytes)?;
    let point_bytes = 3 * number.bytes;
    let data = &bytes[offset..];
    let mut lines = Lines::default();
    lines.reserve(data.len() / point_bytes).map_err(Trouble::of_file)?;
    for (place, point) in data.chunks_exact(point_bytes).enumerate() {
        let at = offset + place * point_bytes;
        let [x, y, z] = [0, 1, 2].map(|axis| number.read(&point[axis * number.bytes..], big_endian));
        if x.is_nan() && y.is_nan() && z.is_nan() {
            lines.end()
        } else if x.is_infinite() && y.is_infinite() && z.is_infinite() {
            if lines.is_open() {
                lines.end().map_err(Trouble::of_file)?;
            }
            let left = bytes.len() - at - point_bytes;
            if left > 0 {
                lines.warn(format!("{left} bytes behind the end mark were not read"));
            }
            let found = lines.count();
            if count.is_some_and(|n| n != found as u64) {
                lines.warn(format!("its header counts {} tracks, but {found} are there", count.unwrap_or(0)));
            }
            return Ok(lines);
        } else {
            lines.point(DVec3::new(x, y, z))
        }
        .map_err(|why| Trouble::at_byte(at, why))?;
    }
    Err(Trouble::at_byte(
        bytes.len(),
        "the file ends there, without its end mark (three infinities): it is cut",
    )
    .hint("tckconvert, or tckedit, writes what there is anew"))
}
