//! Reader of MRtrix track files (`.tck`).
//!
//! A text header of `key: value` lines stands between `mrtrix tracks` and `END`. It needs the keys `datatype`
//! (`Float32LE`, `Float32BE`, `Float64LE`, `Float64BE`) and `file: . OFFSET`; `count` is optional. The points begin
//! at byte OFFSET, in scanner coordinates, mm, RAS+. A point of three NaN ends a track; a point of three infinities
//! ends the file.
//!
//! Source: <https://mrtrix.readthedocs.io/en/latest/getting_started/image_data.html>, "Tracks file format". No crate
//! was found that reads it.

use super::input::{at_byte, in_file, in_line};
use super::lines::Polylines;
use super::number::decode;
use crate::error::Result;
use crate::volume::Element;
use glam::DVec3;

/// First bytes of every MRtrix track file (`.tck`).
pub(super) const MAGIC: &[u8] = b"mrtrix tracks";

/// Returns the number type of the points in a `.tck` file and whether it is big-endian, from the header's `datatype`.
fn element_of(datatype: &str) -> Option<(Element, bool)> {
    let lower = datatype.to_ascii_lowercase();
    // Without a byte order in the name it is that of the writing machine, which is nearly always little-endian.
    let (kind, big_endian) = match lower.strip_suffix("be") {
        Some(kind) => (kind, true),
        None => (lower.strip_suffix("le").unwrap_or(&lower), false),
    };
    let element = Element::from_name(kind).filter(|e| kind == e.name() && kind.starts_with("float"))?;
    Some((element, big_endian))
}

/// Header of an MRtrix track file (`.tck`).
struct TrackHeader {
    element: Element,
    big_endian: bool,
    /// Byte offset of the first point in the `.tck` file.
    offset: usize,
    count: Option<u64>,
}

impl TrackHeader {
    fn of(bytes: &[u8]) -> Result<Self> {
        // Keys with their lines.
        let (mut datatype, mut file, mut count) = (None, None, None);
        let (mut at, mut has_end) = (0, false);
        for (line, text) in (1..).zip(bytes.split_inclusive(|b| *b == b'\n')) {
            at += text.len();
            let text = String::from_utf8_lossy(text);
            let text = text.trim();
            if line == 1 && text.as_bytes() != MAGIC {
                return Err(at_byte(0, "it does not begin with the line `mrtrix tracks`"));
            }
            has_end = text == "END";
            match text.split_once(':') {
                _ if has_end => break,
                Some(("datatype", value)) => datatype = Some((line, value.trim().to_owned())),
                Some(("file", value)) => file = Some((line, value.trim().to_owned())),
                Some(("count", value)) => count = value.trim().parse().ok(),
                _ => {}
            }
        }
        if !has_end {
            return Err(in_file("its header does not come to the line `END`"));
        }
        let missing = |key: &str| in_file(format!("its header has no key `{key}`"));
        let (line, name) = datatype.ok_or_else(|| missing("datatype"))?;
        let (element, big_endian) = element_of(&name).ok_or_else(|| {
            let known = "Float32LE, Float32BE, Float64LE and Float64BE";
            in_line(line, format!("the datatype `{name}` is none of {known}"))
        })?;
        let (line, file) = file.ok_or_else(|| missing("file"))?;
        let offset = file.strip_prefix('.').and_then(|rest| rest.trim().parse::<usize>().ok());
        let offset = offset.ok_or_else(|| {
            in_line(line, format!("`file: {file}` is not `file: . OFFSET`: points are in this file"))
        })?;
        let length = bytes.len();
        if !(at..=length).contains(&offset) {
            let why = format!("points are said to begin at byte {offset}, not within bytes {at} to {length}");
            return Err(in_line(line, why));
        }
        Ok(Self { element, big_endian, offset, count })
    }
}

/// Parses the tracks of an MRtrix track file (`.tck`).
///
/// # Errors
/// The file breaks its format, or ends before its end mark.
pub(super) fn parse(bytes: &[u8]) -> Result<Polylines> {
    let TrackHeader { element, big_endian, offset, count } = TrackHeader::of(bytes)?;
    let point_bytes = 3 * element.bytes();
    let mut lines = Polylines::default();
    lines.reserve((bytes.len() - offset) / point_bytes)?;
    for (place, point) in bytes[offset..].chunks_exact(point_bytes).enumerate() {
        let at = offset + place * point_bytes;
        let [x, y, z] = [0, 1, 2].map(|axis| decode(&point[axis * element.bytes()..], element, big_endian));
        if x.is_nan() && y.is_nan() && z.is_nan() {
            lines.end();
        } else if x.is_infinite() && y.is_infinite() && z.is_infinite() {
            if lines.is_open() {
                lines.end();
            }
            let left = bytes.len() - at - point_bytes;
            if left > 0 {
                lines.warnings.push(format!("{left} bytes behind the end mark were not read"));
            }
            let found = lines.count();
            if let Some(count) = count.filter(|n| *n != found as u64) {
                lines.warnings.push(format!("its header counts {count} tracks, but {found} are there"));
            }
            return Ok(lines);
        } else {
            lines.point(DVec3::new(x, y, z)).map_err(|why| at_byte(at, why))?;
        }
    }
    Err(at_byte(bytes.len(), "the file ends there, without its end mark (three infinities): it is cut")
        .hint("tckconvert, or tckedit, writes what there is anew"))
}
