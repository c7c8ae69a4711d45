//! Reader of the polylines of VTK XML PolyData files (`.vtp`): the `Lines` of every `Piece`.
//!
//! Arrays stand in the XML text, as numbers or in base64, or in the appended data, in base64 or raw. They are plain
//! or compressed by zlib, VTK's default. Coordinates are treated in the same way as in `vtk.rs`.
//!
//! Source: *VTK XML Format*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>. The `vtkio`
//! crate is not used: it panics on missing arrays and allocates memory for the sizes that a header claims.
//! `roxmltree` parses the XML.

use super::input::{at_byte, in_file, in_line};
use super::lines::Polylines;
use super::number::decode;
use super::vtk::polylines;
use crate::error::Result;
use crate::files::vtk_xml::{Coding, appended_is_raw, array_bytes, kind_of};
use crate::files::xml;
use crate::volume::Element;
use roxmltree::Node;
use std::io::Read;

/// XML tag of a `.vtp` file that begins its appended data, whose bytes are not XML.
const APPENDED: &[u8] = b"<AppendedData";

/// Largest total number of values in the arrays of a `.vtp` file; these values take 1 GiB of memory.
const MOST_NUMBERS: u64 = 1 << 27;

/// Returns whether a file with these first bytes is VTK XML PolyData (`true`) or other VTK XML data (`false`); `None`
/// for other files.
pub(super) fn recognise(head: &[u8]) -> Option<bool> {
    kind_of(head).map(|kind| kind == "PolyData")
}

/// Parses the polylines of a VTK XML PolyData file (`.vtp`).
///
/// # Errors
/// The file breaks its format, an array is cut short, or a polyline names a missing point.
pub(super) fn parse(bytes: &[u8]) -> Result<Polylines> {
    let (text, appended) = split(bytes)?;
    let document = xml::parse(&text, 1_000_000)
        .map_err(|e| in_line(e.line, format!("it is no XML file of VTK: {}", e.why)))?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || kind != "PolyData" {
        return Err(in_file(format!("its data are {kind}, not PolyData")));
    }
    let coding = Coding::of(root).map_err(in_file)?;
    let mut lines = Polylines::in_space_of(bytes);
    let mut arrays = Arrays { coding, appended, read: 0 };
    for piece in root.descendants().filter(|node| node.has_tag_name("Piece")) {
        read_piece(piece, &mut arrays, &mut lines).map_err(|why| {
            let line = document.text_pos_at(piece.range().start).row;
            in_line(usize::try_from(line).unwrap_or(1), why)
        })?;
    }
    match lines.count() {
        0 => Err(in_file("it has no polylines (Lines)")),
        _ => Ok(lines),
    }
}

/// Appended data of a `.vtp` file, from behind their mark `_` to the end of the file, and whether they are raw bytes
/// instead of base64.
type Appended<'a> = (&'a [u8], bool);

/// Splits a `.vtp` file into its XML text and its appended data.
fn split(bytes: &[u8]) -> Result<(String, Option<Appended<'_>>)> {
    let utf8 = |bytes: &[u8]| {
        let text = String::from_utf8(bytes.to_vec());
        text.map_err(|e| at_byte(e.utf8_error().valid_up_to(), "it is not UTF-8 text there"))
    };
    let Some(tag) = bytes.windows(APPENDED.len()).position(|w| w == APPENDED) else {
        return Ok((utf8(bytes)?, None));
    };
    let rest = &bytes[tag..];
    let close = rest.iter().position(|b| *b == b'>').unwrap_or(rest.len());
    let is_raw = appended_is_raw(&rest[..close]).map_err(|why| at_byte(tag, why))?;
    let mark = rest[close..].iter().position(|b| *b == b'_');
    let from = mark.ok_or_else(|| at_byte(tag, "appended data have no mark `_`"))?;
    Ok((utf8(&bytes[..tag])? + "</VTKFile>", Some((&rest[close + from + 1..], is_raw))))
}

fn read_piece(piece: Node, arrays: &mut Arrays, lines: &mut Polylines) -> Result<(), String> {
    let count = |name: &str| {
        let text = piece.attribute(name).unwrap_or("0");
        text.trim().parse::<u64>().map_err(|_| format!("{name} is `{text}`"))
    };
    let (points, line_count) = (count("NumberOfPoints")?, count("NumberOfLines")?);
    if line_count == 0 {
        return Ok(());
    }
    let child = |parent: &str, name: Option<&str>| {
        let parents = piece.children().filter(|node| node.has_tag_name(parent)).take(1);
        let mut arrays =
            parents.flat_map(|node| node.children()).filter(|node| node.has_tag_name("DataArray"));
        let found = arrays.find(|node| name.is_none_or(|name| node.attribute("Name") == Some(name)));
        found.ok_or_else(|| format!("its {parent} have no array {}", name.unwrap_or_default()))
    };
    let coordinates = arrays.read(child("Points", None)?, Some(points.saturating_mul(3)))?;
    let mut bounds = arrays.read(child("Lines", Some("offsets"))?, Some(line_count))?;
    let numbers = arrays.read(child("Lines", Some("connectivity"))?, None)?;
    // The file gives the end offset of each polyline; the first one begins at 0.
    bounds.insert(0, 0.0);
    polylines(&coordinates, &bounds, &numbers, lines)
}

/// Reader of the `DataArray` elements of a `.vtp` file.
struct Arrays<'a> {
    coding: Coding,
    appended: Option<Appended<'a>>,
    /// Number of values read so far from all `DataArray` elements of the `.vtp` file.
    read: u64,
}

impl Arrays<'_> {
    /// Reads the numbers of a `DataArray` of a `.vtp` file; `wanted` is their expected count, if known.
    fn read(&mut self, array: Node, wanted: Option<u64>) -> Result<Vec<f64>, String> {
        let name = array.attribute("Name").unwrap_or("Points");
        let values = self.numbers(array).map_err(|why| format!("array {name}: {why}"))?;
        self.read += values.len() as u64;
        match wanted {
            Some(wanted) if wanted != values.len() as u64 => {
                Err(format!("array {name} has {} numbers, not {wanted}", values.len()))
            }
            _ => Ok(values),
        }
    }

    fn numbers(&self, array: Node) -> Result<Vec<f64>, String> {
        let kind = array.attribute("type").unwrap_or_default();
        let element = Element::from_name(&kind.to_ascii_lowercase())
            .ok_or_else(|| format!("numbers of the kind `{kind}`"))?;
        let text = array.text().unwrap_or_default();
        let (input, is_raw) = match array.attribute("format") {
            Some("ascii") => {
                let numbers = text.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>();
                return numbers.map_err(|e| format!("it has a word that is none: {e}"));
            }
            Some("binary") => (text.trim().as_bytes(), false),
            Some("appended") => {
                let offset = array.attribute("offset").unwrap_or_default();
                let (bytes, is_raw) = self.appended.ok_or("the file has no appended data")?;
                let offset =
                    offset.trim().parse::<usize>().map_err(|_| format!("its offset is `{offset}`"))?;
                let bytes =
                    bytes.get(offset..).ok_or_else(|| format!("its offset {offset} is beyond the file"))?;
                (bytes, is_raw)
            }
            other => return Err(format!("its format is {}", other.unwrap_or("not said"))),
        };
        let most = MOST_NUMBERS.saturating_sub(self.read) * element.bytes() as u64;
        let check = |bytes: u64| match bytes > most {
            true => Err(format!(
                "it is of {bytes} bytes; arrays of {MOST_NUMBERS} numbers in all are read, and {most} bytes are left of that"
            )),
            false => Ok(()),
        };
        let mut stream = array_bytes(input, is_raw, &self.coding, check)?;
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        if bytes.len() as u64 != stream.bytes {
            return Err(format!("{} bytes are said to follow, but it ends before", stream.bytes));
        }
        let words = bytes.chunks_exact(element.bytes());
        Ok(words.map(|word| decode(word, element, self.coding.big_endian)).collect())
    }
}
