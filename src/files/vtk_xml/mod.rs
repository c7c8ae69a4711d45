//! What VTK's XML files have in common: their tag, and arrays within the text or appended, in base64 or raw, plain or packed.
//!
//! Source: *VTK XML Format*, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>. Read here and not by
//! the crate `vtkio`, which takes the memory that headers claim; the XML itself by `roxmltree`, which is among what pictures
//! of plots need.

mod array;

pub use array::{ArrayBytes, Coding, array_bytes};

/// Where the tag of the file stands, if it does.
const TAG_WITHIN: usize = 1024;

/// The `type` of the file's tag: `PolyData`, `ImageData`; `None` for what is no such file.
pub fn kind_of(head: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&head[..head.len().min(TAG_WITHIN)]).into_owned();
    let tag = text.split_once("<VTKFile")?.1.split('>').next()?;
    let value = tag.split_once("type=")?.1;
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Some(value[1..].split(quote).next()?.to_owned())
}

/// Whether appended data are raw, by their tag; in base64 otherwise.
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
