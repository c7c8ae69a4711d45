//! Reads the common parts of VTK's XML file formats: root tag and data arrays (inline or appended, base64 or raw,
//! compressed or not).
//!
//! Source: *VTK XML Format*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>. The crate
//! `vtkio` is not used because it allocates as much memory as file headers claim. The crate `roxmltree`, which the
//! plots need too, parses the XML.

mod array;

pub use array::{ArrayBytes, Coding, array_bytes};

/// Number of bytes at the beginning of a file that are searched for the VTK XML root tag.
const TAG_WITHIN: usize = 1024;

/// Returns the attribute `type` of the VTK XML root tag, e.g. `PolyData` or `ImageData`; `None` for other files.
pub fn kind_of(head: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&head[..head.len().min(TAG_WITHIN)]).into_owned();
    let tag = text.split_once("<VTKFile")?.1.split('>').next()?;
    let value = tag.split_once("type=")?.1;
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Some(value[1..].split(quote).next()?.to_owned())
}

/// Returns whether the `AppendedData` tag of a VTK XML file announces raw bytes (true) or base64 (false).
///
/// # Errors
/// The tag announces neither raw bytes nor base64.
pub fn appended_is_raw(tag: &[u8]) -> Result<bool, String> {
    match String::from_utf8_lossy(tag) {
        text if text.contains("base64") => Ok(false),
        text if text.contains("raw") => Ok(true),
        _ => Err("appended data are neither raw nor in base64".into()),
    }
}
