//! Reader of the polylines of legacy VTK files (`.vtk`): `LINES` of a `DATASET POLYDATA`, text or binary, versions 1
//! to 5.1.
//!
//! Coordinates are world mm, RAS+; a title that contains `SPACE=LPS`, 3D Slicer's mark, negates the first two.
//! Vertices, polygons and strips are ignored, and reading ends where data of points or cells begin.
//!
//! Source: *VTK File Formats*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html>. The
//! `vtkio` crate is not used: it panics on missing arrays and allocates what a header claims.

use super::input::{at_byte, in_file};
use super::lines::Polylines;
use super::number::{decode, legacy_vtk_element};
use crate::error::Result;
use crate::volume::Element;
use glam::DVec3;

/// First bytes of every legacy VTK file.
const MAGIC: &[u8] = b"# vtk DataFile Version";

/// Returns whether a legacy VTK file with these first bytes holds polygonal data (`true`) or other data (`false`);
/// `None` if it is no legacy VTK file.
pub(super) fn recognise(head: &[u8]) -> Option<bool> {
    let text = String::from_utf8_lossy(head).to_ascii_uppercase();
    // The fourth line names the kind of data.
    let dataset = text.lines().skip(2).find_map(|line| line.trim().strip_prefix("DATASET").map(str::trim));
    head.starts_with(MAGIC).then(|| dataset.is_none_or(|kind| kind == "POLYDATA"))
}

/// Reading position in the bytes of a legacy VTK file, in which text lines and arrays of numbers alternate.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Cursor<'a> {
    /// Reads the next non-empty line of a legacy VTK file and its byte offset; the line is empty at the end of the
    /// file.
    fn line(&mut self) -> (usize, String) {
        loop {
            let (from, text) = self.any_line();
            if !text.is_empty() || self.at == self.bytes.len() {
                return (from, text);
            }
        }
    }

    /// Reads the next line of a legacy VTK file, trimmed, and its byte offset.
    fn any_line(&mut self) -> (usize, String) {
        let from = self.at;
        let rest = &self.bytes[from..];
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.at = (from + length + 1).min(self.bytes.len());
        (from, String::from_utf8_lossy(&rest[..length]).trim().to_owned())
    }

    /// Skips the lines of a metadata section in a legacy VTK file, up to the next empty line.
    fn skip_metadata(&mut self) {
        while !self.any_line().1.is_empty() {}
    }

    /// Reads `count` numbers of a legacy VTK file. It allocates memory only if the rest of the file can hold so many
    /// numbers.
    fn numbers(&mut self, count: u64, element: Element) -> Result<Vec<f64>> {
        let (from, left) = (self.at, self.bytes.len() - self.at);
        // A number in text has a digit and, but for the last one, a space behind it.
        let least = match self.binary {
            true => count.saturating_mul(element.bytes() as u64),
            false => count.saturating_mul(2).saturating_sub(1),
        };
        if least > left as u64 {
            let why = format!("{count} numbers take {least} bytes at the least, but {left} are left");
            return Err(at_byte(from, why));
        }
        let mut numbers = Vec::new();
        let reserved = numbers.try_reserve_exact(count as usize);
        reserved.map_err(|_| at_byte(from, format!("there is not enough memory for {count} numbers")))?;
        if self.binary {
            self.at += least as usize;
            let words = self.bytes[from..self.at].chunks_exact(element.bytes());
            numbers.extend(words.map(|word| decode(word, element, true)));
            return Ok(numbers);
        }
        for _ in 0..count {
            let at = self.at;
            numbers.push(self.word().parse().map_err(|_| at_byte(at, "a number was expected there"))?);
        }
        Ok(numbers)
    }

    /// Reads the next word of a legacy VTK file; the word is empty at the end of the file.
    fn word(&mut self) -> &'a str {
        let rest = &self.bytes[self.at..];
        let from = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let word = &rest[from..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at += from + length;
        std::str::from_utf8(&word[..length]).unwrap_or_default()
    }

    /// Reads the heading line and the numbers of an `OFFSETS` or `CONNECTIVITY` array (VTK file version 5).
    fn named_array(&mut self, name: &str, count: u64) -> Result<Vec<f64>> {
        let (at, line) = self.line();
        let words: Vec<&str> = line.split_whitespace().collect();
        if !words.first().is_some_and(|word| word.eq_ignore_ascii_case(name)) {
            return Err(at_byte(at, format!("{name} was expected there")));
        }
        self.numbers(count, element(&words, 1, at)?)
    }

    /// Reads the cells of a legacy VTK file, such as its polylines: a list of point indices, and the bounds of each
    /// cell in this list.
    fn cells(&mut self, at: usize, words: &[&str], has_offsets: bool) -> Result<[Vec<f64>; 2]> {
        let (cells, size) = (count(words, 0, at)?, count(words, 1, at)?);
        if has_offsets {
            return Ok([self.named_array("OFFSETS", cells)?, self.named_array("CONNECTIVITY", size)?]);
        }
        // Before version 5 each cell is a count and that many numbers.
        let counted = self.numbers(size, Element::I32)?;
        let (mut bounds, mut numbers, mut rest) = (vec![0.0], Vec::new(), &counted[..]);
        while let [points, after @ ..] = rest {
            if *points < 0.0 {
                return Err(at_byte(at, format!("a cell of {points} points")));
            }
            let Some(cell) = after.get(..*points as usize) else { break };
            numbers.extend_from_slice(cell);
            bounds.push(numbers.len() as f64);
            rest = &after[cell.len()..];
        }
        match rest.is_empty() && bounds.len() as u64 - 1 == cells {
            true => Ok([bounds, numbers]),
            false => Err(at_byte(at, format!("{size} numbers do not make {cells} cells"))),
        }
    }

    /// Skips a `FIELD NAME COUNT` section of a legacy VTK file with its arrays of numbers.
    fn skip_fields(&mut self, at: usize, words: &[&str]) -> Result<()> {
        for _ in 0..count(words, 1, at)? {
            let (at, line) = self.line();
            let words: Vec<&str> = line.split_whitespace().collect();
            if words.is_empty() {
                return Err(at_byte(at, "the file ends within its fields"));
            }
            let numbers = count(&words, 1, at)?.saturating_mul(count(&words, 2, at)?);
            self.numbers(numbers, element(&words, 3, at)?)?;
            // VTK writes the metadata of an array behind it.
            let before = self.at;
            match self.line().1.as_str() {
                "METADATA" => self.skip_metadata(),
                _ => self.at = before,
            }
        }
        Ok(())
    }
}

/// Parses the polylines of a legacy VTK file.
///
/// # Errors
/// The file holds no polygonal data, is cut short, or a polyline names a missing point.
pub(super) fn parse(bytes: &[u8]) -> Result<Polylines> {
    let mut cursor = Cursor { bytes, at: 0, binary: false };
    let version = cursor.any_line().1;
    let Some(version) = version.as_bytes().strip_prefix(MAGIC) else {
        return Err(at_byte(0, "it does not begin with `# vtk DataFile Version`"));
    };
    let version: f64 = String::from_utf8_lossy(version).trim().parse().unwrap_or(0.0);
    cursor.any_line();
    let (at, form) = cursor.any_line();
    cursor.binary = match form.to_ascii_uppercase().as_str() {
        "ASCII" => false,
        "BINARY" => true,
        _ => return Err(at_byte(at, "its third line is neither ASCII nor BINARY")),
    };
    let (mut points, mut lines) = (Vec::new(), Polylines::in_space_of(bytes));
    loop {
        let (at, line) = cursor.line();
        let words: Vec<&str> = line.split_whitespace().collect();
        let [keyword, rest @ ..] = &words[..] else { break };
        match keyword.to_ascii_uppercase().as_str() {
            "DATASET" if rest.first().is_some_and(|kind| kind.eq_ignore_ascii_case("POLYDATA")) => {}
            "DATASET" => return Err(at_byte(at, format!("its dataset is {}, not POLYDATA", rest.join(" ")))),
            "POINTS" => {
                let numbers = count(rest, 0, at)?.saturating_mul(3);
                points = cursor.numbers(numbers, element(rest, 1, at)?)?;
            }
            "LINES" => {
                let [bounds, numbers] = cursor.cells(at, rest, version >= 5.0)?;
                polylines(&points, &bounds, &numbers, &mut lines).map_err(|why| at_byte(at, why))?;
            }
            "VERTICES" | "POLYGONS" | "TRIANGLE_STRIPS" => {
                cursor.cells(at, rest, version >= 5.0)?;
            }
            "METADATA" => cursor.skip_metadata(),
            "FIELD" => cursor.skip_fields(at, rest)?,
            "POINT_DATA" | "CELL_DATA" => break,
            other => return Err(at_byte(at, format!("`{other}` is no part of polygonal data"))),
        }
    }
    match lines.count() {
        0 => Err(in_file("it has no polylines (LINES)")),
        _ => Ok(lines),
    }
}

/// Parses a count from the words of a line in a legacy VTK file; `place` is the index of the word.
fn count(words: &[&str], place: usize, at: usize) -> Result<u64> {
    let word = words.get(place).copied().unwrap_or_default();
    word.parse().map_err(|_| at_byte(at, format!("`{word}` is not how many there are")))
}

/// Parses the type of an array's numbers from the words of a line in a legacy VTK file; `place` is the index of the
/// word.
fn element(words: &[&str], place: usize, at: usize) -> Result<Element> {
    let word = words.get(place).copied().unwrap_or_default();
    legacy_vtk_element(word).ok_or_else(|| at_byte(at, format!("numbers of the kind `{word}` are not read")))
}

/// Appends the polylines of a VTK file to `lines`. Two neighbouring entries of `bounds` delimit the point indices of
/// one polyline in `numbers`.
pub(super) fn polylines(
    coordinates: &[f64],
    bounds: &[f64],
    numbers: &[f64],
    lines: &mut Polylines,
) -> Result<(), String> {
    let points = coordinates.as_chunks::<3>().0;
    let within = |bound: f64| (bound >= 0.0 && bound <= numbers.len() as f64).then_some(bound as usize);
    for ends in bounds.windows(2) {
        let part = within(ends[0]).zip(within(ends[1])).and_then(|(from, to)| numbers.get(from..to));
        let why = || format!("a line is numbers {} to {} of {}", ends[0], ends[1], numbers.len());
        for number in part.ok_or_else(why)? {
            let point = (*number >= 0.0).then(|| points.get(*number as usize)).flatten();
            let missing = || format!("a line goes through point {number}, and there are {}", points.len());
            lines.point(DVec3::from_array(*point.ok_or_else(missing)?))?;
        }
        lines.end();
    }
    Ok(())
}
