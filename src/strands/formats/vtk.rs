//! Legacy VTK files, `.vtk`: the `LINES` of a `DATASET POLYDATA`, in text or big-endian binary, of versions 1 to 5.1.
//!
//! Coordinates are taken as they stand, world mm, RAS+; a title that says `SPACE=LPS`, as 3D Slicer writes it, turns the first
//! two about. Vertices, polygons and strips are passed over, and reading ends where data of points or cells begin.
//!
//! Source: *VTK File Formats*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html>. Read here and not
//! by the `vtkio` crate, which panics on missing arrays and takes memory for what a header claims.

use super::input::Trouble;
use super::lines::Lines;
use super::number::Number;
use glam::DVec3;

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"# vtk DataFile Version";

/// Whether a beginning is that of a file of another kind: not of polygonal data.
pub(super) fn is_another(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head).to_ascii_uppercase();
    // The fourth line says it.
    let dataset = text.lines().skip(2).find_map(|line| line.trim().strip_prefix("DATASET").map(str::trim));
    head.starts_with(MAGIC) && dataset.is_some_and(|kind| kind != "POLYDATA")
}

/// A place in a file of lines of text and, between them, numbers.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Cursor<'a> {
    /// The next line that is not empty, and where it begins; `None` at the end.
    fn line(&mut self) -> Option<(usize, String)> {
        while self.at < self.bytes.len() {
            let (from, text) = self.any_line();
            if !text.is_empty() {
                return Some((from, text));
            }
        }
        None
    }

    /// The next line, trimmed.
    fn any_line(&mut self) -> (usize, String) {
        let from = self.at;
        let rest = &self.bytes[from..];
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.at = (from + length + 1).min(self.bytes.len());
        (from, String::from_utf8_lossy(&rest[..length]).trim().to_owned())
    }

    /// So many numbers, handed on one by one; none is taken before the file has been seen to be long enough.
    fn numbers(
        &mut self,
        count: u64,
        number: Number,
        mut take: impl FnMut(f64) -> Result<(), String>,
    ) -> Result<(), Trouble> {
        let from = self.at;
        let left = self.bytes.len() - from;
        // A number in text has a digit and, but for the last one, a space behind it.
        let least = if self.binary {
            count.saturating_mul(number.bytes as u64)
        } else {
            count.saturating_mul(2).saturating_sub(1)
        };
        if least > left as u64 {
            let why = format!("{count} numbers take {least} bytes at the least, but {left} are left");
            return Err(Trouble::at_byte(from, why));
        }
        for _ in 0..count {
            let at = self.at;
            let value = if self.binary {
                self.at += number.bytes;
                number.read(&self.bytes[at..self.at], true)
            } else {
                self.word().parse().map_err(|_| Trouble::at_byte(at, "a number was expected there"))?
            };
            take(value).map_err(|why| Trouble::at_byte(at, why))?;
        }
        Ok(())
    }

    /// The next word of text, empty at the end.
    fn word(&mut self) -> &'a str {
        let rest = &self.bytes[self.at..];
        let from = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let word = &rest[from..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at += from + length;
        std::str::from_utf8(&word[..length]).unwrap_or_default()
    }
}

/// The polylines of a file.
///
/// # Errors
/// It is no polygonal data, is cut short, or a polyline goes through a point that there is not.
pub(super) fn parse(bytes: &[u8]) -> Result<Lines, Trouble> {
    let mut cursor = Cursor { bytes, at: 0, binary: false };
    let version = cursor.any_line().1;
    let Some(version) = version.as_bytes().strip_prefix(MAGIC) else {
        return Err(Trouble::at_byte(0, "it does not begin with `# vtk DataFile Version`"));
    };
    let version: f64 = String::from_utf8_lossy(version).trim().parse().unwrap_or(0.0);
    cursor.any_line();
    let (at, form) = cursor.any_line();
    cursor.binary = match form.to_ascii_uppercase().as_str() {
        "ASCII" => false,
        "BINARY" => true,
        _ => return Err(Trouble::at_byte(at, "its third line is neither ASCII nor BINARY")),
    };
    let mut file = Polydata { points: Vec::new(), lines: Lines::of_space(bytes), offsets: version >= 5.0 };
    while let Some((at, line)) = cursor.line() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [keyword, rest @ ..] = &words[..] else { continue };
        match keyword.to_ascii_uppercase().as_str() {
            "DATASET" if rest.first().is_some_and(|kind| kind.eq_ignore_ascii_case("POLYDATA")) => {}
            "DATASET" => {
                let why = format!("its dataset is {}, not POLYDATA", rest.join(" "));
                return Err(Trouble::at_byte(at, why));
            }
            "POINTS" => file.read_points(&mut cursor, at, rest)?,
            "LINES" => file.read_cells(&mut cursor, at, rest, true)?,
            "VERTICES" | "POLYGONS" | "TRIANGLE_STRIPS" => file.read_cells(&mut cursor, at, rest, false)?,
            "METADATA" => while !cursor.any_line().1.is_empty() {},
            "FIELD" => skip_fields(&mut cursor, at, rest)?,
            "POINT_DATA" | "CELL_DATA" => break,
            other => return Err(Trouble::at_byte(at, format!("`{other}` is no part of polygonal data"))),
        }
    }
    match file.lines.count() {
        0 => Err(Trouble::of_file("it has no polylines (LINES)")),
        _ => Ok(file.lines),
    }
}

/// A whole number of a line of text, by its place.
fn whole(words: &[&str], place: usize, at: usize) -> Result<u64, Trouble> {
    let word = words.get(place).copied().unwrap_or_default();
    word.parse().map_err(|_| Trouble::at_byte(at, format!("`{word}` is not how many there are")))
}

/// A kind of number of a line of text, by its place.
fn kind(words: &[&str], place: usize, at: usize) -> Result<Number, Trouble> {
    let word = words.get(place).copied().unwrap_or_default();
    let refused = || Trouble::at_byte(at, format!("numbers of the kind `{word}` are not read"));
    Number::of_legacy(word).ok_or_else(refused)
}

/// What has been read.
struct Polydata {
    points: Vec<DVec3>,
    lines: Lines,
    /// Cells are offsets and numbers of points, not numbers behind their count.
    offsets: bool,
}

impl Polydata {
    fn read_points(&mut self, cursor: &mut Cursor, at: usize, words: &[&str]) -> Result<(), Trouble> {
        let (count, number) = (whole(words, 0, at)?, kind(words, 1, at)?);
        let (mut point, mut filled) = (DVec3::ZERO, 0);
        self.points.clear();
        let points = &mut self.points;
        cursor.numbers(count.saturating_mul(3), number, |value| {
            point[filled] = value;
            filled += 1;
            if filled == 3 {
                filled = 0;
                points.try_reserve(1).map_err(|_| "there is not enough memory for its points")?;
                points.push(point);
            }
            Ok(())
        })
    }

    /// Reads cells; those that are `wanted` become polylines.
    fn read_cells(
        &mut self,
        cursor: &mut Cursor,
        at: usize,
        words: &[&str],
        wanted: bool,
    ) -> Result<(), Trouble> {
        let (cells, size) = (whole(words, 0, at)?, whole(words, 1, at)?);
        if self.offsets {
            return self.read_offsets(cursor, [cells, size], wanted);
        }
        let (points, lines) = (&self.points, &mut self.lines);
        let (mut open, mut begun) = (0_u64, 0_u64);
        cursor.numbers(size, Number::INT, |value| {
            if open == 0 {
                if value < 0.0 {
                    return Err(format!("a cell of {value} points"));
                }
                open = value as u64;
                begun += 1;
            } else {
                open -= 1;
                if wanted {
                    lines.point(point_of(points, value)?)?;
                }
            }
            if open == 0 && wanted { lines.end() } else { Ok(()) }
        })?;
        if open > 0 || begun != cells {
            let why = format!("{size} numbers do not make {cells} cells");
            return Err(Trouble::at_byte(at, why));
        }
        Ok(())
    }

    /// Cells of version 5: `OFFSETS`, and `CONNECTIVITY`.
    fn read_offsets(
        &mut self,
        cursor: &mut Cursor,
        [offsets, size]: [u64; 2],
        wanted: bool,
    ) -> Result<(), Trouble> {
        let mut array = |name: &str, count: u64, values: &mut Vec<f64>| {
            let (at, line) = cursor.line().unwrap_or((cursor.bytes.len(), String::new()));
            let words: Vec<&str> = line.split_whitespace().collect();
            if !words.first().is_some_and(|word| word.eq_ignore_ascii_case(name)) {
                return Err(Trouble::at_byte(at, format!("{name} was expected there")));
            }
            let number = kind(&words, 1, at)?;
            cursor.numbers(count, number, |value| {
                values.try_reserve(1).map_err(|_| "there is not enough memory for its cells")?;
                values.push(value);
                Ok(())
            })?;
            Ok(at)
        };
        let (mut ends, mut numbers) = (Vec::new(), Vec::new());
        let at = array("OFFSETS", offsets, &mut ends)?;
        array("CONNECTIVITY", size, &mut numbers)?;
        if !wanted {
            return Ok(());
        }
        polylines(&self.points, &ends, &numbers, &mut self.lines).map_err(|why| Trouble::at_byte(at, why))
    }
}

/// Polylines of the numbers of their points, each from one of the offsets to the next.
pub(super) fn polylines(
    points: &[DVec3],
    offsets: &[f64],
    numbers: &[f64],
    lines: &mut Lines,
) -> Result<(), String> {
    for ends in offsets.windows(2) {
        let of = |end: f64| (end >= 0.0 && end <= numbers.len() as f64).then_some(end as usize);
        let part = match ends.iter().map(|end| of(*end)).collect::<Option<Vec<_>>>().as_deref() {
            Some([from, to]) => numbers.get(*from..*to),
            _ => None,
        };
        let why = || format!("a line is numbers {} to {} of {}", ends[0], ends[1], numbers.len());
        for number in part.ok_or_else(why)? {
            lines.point(point_of(points, *number)?)?;
        }
        lines.end()?;
    }
    Ok(())
}

fn point_of(points: &[DVec3], number: f64) -> Result<DVec3, String> {
    let found = (number >= 0.0).then(|| points.get(number as usize)).flatten();
    found
        .copied()
        .ok_or_else(|| format!("a line goes through point {number}, and there are {}", points.len()))
}

/// Passes over `FIELD NAME COUNT` and its arrays of numbers.
fn skip_fields(cursor: &mut Cursor, at: usize, words: &[&str]) -> Result<(), Trouble> {
    for _ in 0..whole(words, 1, at)? {
        let Some((at, line)) = cursor.line() else {
            return Err(Trouble::at_byte(cursor.bytes.len(), "the file ends within its fields"));
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        let count = whole(&words, 1, at)?.saturating_mul(whole(&words, 2, at)?);
        let number = kind(&words, 3, at)?;
        cursor.numbers(count, number, |_| Ok(()))?;
        // What VTK says of an array stands behind it.
        let before = cursor.at;
        match cursor.line() {
            Some((_, next)) if next == "METADATA" => while !cursor.any_line().1.is_empty() {},
            _ => cursor.at = before,
        }
    }
    Ok(())
}
