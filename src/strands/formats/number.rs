//! Decodes single numbers of binary strand files, such as `.trk` and `.vtk` files.

use crate::volume::Element;

/// Returns the number type for a type name in a legacy VTK file, such as `float` or `vtktypeint64`.
pub(super) fn legacy_vtk_element(name: &str) -> Option<Element> {
    let name = name.to_ascii_lowercase();
    match name.as_str() {
        "vtkidtype" => Some(Element::I32),
        "unsigned_long" => Some(Element::U64),
        "long" => Some(Element::I64),
        other => {
            other.strip_prefix("vtktype").map_or_else(|| Element::from_c_name(other), Element::from_name)
        }
    }
}

/// Decodes the number at the beginning of `bytes`, which come from a binary strand file. Integers up to 2^53 are
/// exact.
///
/// # Panics
/// `bytes` are too few.
pub(super) fn decode(bytes: &[u8], element: Element, big_endian: bool) -> f64 {
    let (mut word, n) = ([0; 8], element.bytes());
    word[..n].copy_from_slice(&bytes[..n]);
    if big_endian {
        word[..n].reverse();
    }
    let bits = u64::from_le_bytes(word);
    match element {
        Element::F32 => f64::from(f32::from_bits(bits as u32)),
        Element::F64 => f64::from_bits(bits),
        Element::U8 | Element::U16 | Element::U32 | Element::U64 => bits as f64,
        Element::I8 | Element::I16 | Element::I32 | Element::I64 => {
            let unused = 64 - 8 * n as u32;
            ((bits << unused) as i64 >> unused) as f64
        }
    }
}
