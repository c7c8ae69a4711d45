//! Common parts of VTK's XML files: the root tag, and arrays within the text or appended, in base64 or raw, plain or compressed.
//!
//! Source: *VTK XML Format*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>. The crate
//! `vtkio` is not used because it allocates the memory that headers claim. `roxmltree`, which plots need too, parses the XML.

mod array;

pub use array::{ArrayBytes, Coding, array_bytes};

/// Bytes at the beginning of a file that are searched for its root tag.
const TAG_WITHIN: usize = 1024;

/// Attribute `type` of the root tag, e.g. `PolyData` or `ImageData`; `None` for other files.
pub fn kind_of(head: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&head[..head.len().min(TAG_WITHIN)]).into_owned();
    let tag = text.split_once("<VTKFile")?.1.split('>').next()?;
    let value = tag.split_once("type=")?.1;
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Some(value[1..].split(quote).next()?.to_owned())
}

/// Whether the tag of appended data announces raw bytes, not base64.
///
/// # Errors
/// The tag says neither.
pub fn appended_is_raw(tag: &[u8]) -> Result<bool, String> {
    match String::from_utf8_lossy(tag) {
        text if text.contains("base64") => Ok(false),
        text if text.contains("raw") => Ok(true),
        _ => Err("appended data are neither raw nor in base64".into()),
    }
}
