//! VTK XML files of polygonal data, `.vtp`: the `Lines` of every piece.
//!
//! Arrays may stand in the text, as numbers or in base64, or be appended, in base64 or raw; plain or compressed by zlib, which
//! is what VTK writes unless told otherwise. Coordinates are taken as they stand, world mm, RAS+, as in `vtk.rs`.
//!
//! Source: *VTK XML Format*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>. Read here and not by
//! the `vtkio` crate, for the reasons of `vtk.rs`; the XML itself by `roxmltree`, which is among what pictures of plots need.

use super::input::Trouble;
use super::lines::Lines;
use super::number::Number;
use super::vtk::polylines;
use super::vtp_data::{Appended, MOST_NUMBERS, bytes_of};
use crate::files::vtk_xml::{Coding, appended_is_raw, kind_of};
use crate::files::xml;
use glam::DVec3;
use roxmltree::Node;

/// The tag that data without a meaning in XML stand behind.
const APPENDED: &[u8] = b"<AppendedData";

/// Whether a beginning is that of polygonal data.
pub(super) fn begins(head: &[u8]) -> bool {
    kind_of(head).is_some_and(|kind| kind == "PolyData")
}

/// Whether a beginning is that of a VTK file of other data.
pub(super) fn is_another(head: &[u8]) -> bool {
    kind_of(head).is_some_and(|kind| kind != "PolyData")
}

/// The polylines of a file.
///
/// # Errors
/// It is not as the format has it, an array is cut short, or a polyline goes through a point that there is not.
pub(super) fn parse(bytes: &[u8]) -> Result<Lines, Trouble> {
    let (text, appended) = split(bytes)?;
    let document = xml::parse(&text, 1_000_000)
        .map_err(|e| Trouble::in_line(e.line, format!("it is no XML file of VTK: {}", e.why)))?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || kind != "PolyData" {
        return Err(Trouble::of_file(format!("its data are {kind}, not PolyData")));
    }
    let coding = Coding::of(root).map_err(Trouble::of_file)?;
    let mut file = File { coding, appended, lines: Lines::of_space(bytes), read: 0 };
    for piece in root.descendants().filter(|node| node.has_tag_name("Piece")) {
        file.read_piece(piece).map_err(|why| {
            let line = document.text_pos_at(piece.range().start).row;
            Trouble::in_line(usize::try_from(line).unwrap_or(1), why)
        })?;
    }
    match file.lines.count() {
        0 => Err(Trouble::of_file("it has no polylines (Lines)")),
        _ => Ok(file.lines),
    }
}

/// The text without its appended data, and those.
fn split(bytes: &[u8]) -> Result<(String, Option<Appended<'_>>), Trouble> {
    let utf8 = |bytes: &[u8]| {
        let text = String::from_utf8(bytes.to_vec());
        text.map_err(|e| Trouble::at_byte(e.utf8_error().valid_up_to(), "it is not UTF-8 text there"))
    };
    let Some(tag) = bytes.windows(APPENDED.len()).position(|w| w == APPENDED) else {
        return Ok((utf8(bytes)?, None));
    };
    let rest = &bytes[tag..];
    let close = rest.iter().position(|b| *b == b'>').unwrap_or(rest.len());
    let raw = appended_is_raw(&rest[..close]).map_err(|why| Trouble::at_byte(tag, why))?;
    let mark = rest[close..].iter().position(|b| *b == b'_');
    let from = mark.ok_or_else(|| Trouble::at_byte(tag, "appended data have no mark `_`"))?;
    let text = utf8(&bytes[..tag])? + "</VTKFile>";
    Ok((text, Some(Appended { bytes: &rest[close + from + 1..], raw })))
}

/// A file that is being read.
struct File<'a> {
    coding: Coding,
    appended: Option<Appended<'a>>,
    lines: Lines,
    /// Numbers that arrays have had until now.
    read: u64,
}

impl File<'_> {
    fn read_piece(&mut self, piece: Node) -> Result<(), String> {
        let count = |name: &str| {
            let text = piece.attribute(name).unwrap_or("0");
            text.trim().parse::<u64>().map_err(|_| format!("{name} is `{text}`"))
        };
        let (points, lines) = (count("NumberOfPoints")?, count("NumberOfLines")?);
        if lines == 0 {
            return Ok(());
        }
        let child = |parent: &str, name: Option<&str>| {
            let parent_node = piece.children().find(|node| node.has_tag_name(parent));
            let arrays = parent_node.into_iter().flat_map(|node| node.children());
            let mut arrays = arrays.filter(|node| node.has_tag_name("DataArray"));
            let found = arrays.find(|node| name.is_none_or(|name| node.attribute("Name") == Some(name)));
            found.ok_or_else(|| format!("its {parent} have no array {}", name.unwrap_or_default()))
        };
        let coordinates = self.read_array(child("Points", None)?, Some(points.saturating_mul(3)))?;
        let place = |p: &[f64; 3]| DVec3::from_array(*p);
        let places: Vec<DVec3> = coordinates.as_chunks::<3>().0.iter().map(place).collect();
        let mut offsets = self.read_array(child("Lines", Some("offsets"))?, Some(lines))?;
        let numbers = self.read_array(child("Lines", Some("connectivity"))?, None)?;
        // Ends of lines: the first one begins at 0.
        offsets.insert(0, 0.0);
        polylines(&places, &offsets, &numbers, &mut self.lines)
    }

    /// Numbers of an array, as many as are wanted where that is known.
    fn read_array(&mut self, array: Node, wanted: Option<u64>) -> Result<Vec<f64>, String> {
        let name = array.attribute("Name").unwrap_or("Points").to_owned();
        let named = |why: String| format!("array {name}: {why}");
        let kind = array.attribute("type").unwrap_or_default();
        let number = Number::of_xml(kind).ok_or_else(|| named(format!("numbers of the kind `{kind}`")))?;
        let text = array.text().unwrap_or_default();
        let values: Vec<f64> = if array.attribute("format") == Some("ascii") {
            let numbers = text.split_ascii_whitespace().map(str::parse);
            numbers
                .collect::<Result<_, _>>()
                .map_err(|e| named(format!("it has a word that is none: {e}")))?
        } else {
            let most = MOST_NUMBERS.saturating_sub(self.read) * number.bytes as u64;
            let bytes = bytes_of(array, &self.coding, self.appended, most).map_err(named)?;
            let big_endian = self.coding.big_endian;
            let numbers = bytes.chunks_exact(number.bytes).map(|word| number.read(word, big_endian));
            numbers.collect()
        };
        self.read += values.len() as u64;
        match wanted {
            Some(wanted) if wanted != values.len() as u64 => {
                Err(format!("array {name} has {} numbers, not {wanted}", values.len()))
            }
            _ => Ok(values),
        }
    }
}
