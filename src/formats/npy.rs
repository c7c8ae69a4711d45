//! Reads NumPy `.npy` arrays as volumes: axes `[k, j, i]` (`i` fastest in C order), `[j, i]`, or `[frame, k, j, i]`.
//!
//! The crate `ndarray-npy` is not used: it needs the element type in advance and allocates as much memory as a
//! damaged file claims. Its header parser `py_literal` takes seconds for nested brackets of a damaged file. Source:
//! NumPy's `numpy.lib.format`, "NPY format".

use super::common::{frame_warning, refusal, with_integer_warning};
use super::head::Head;
use super::raw_layout::Sidecar;
use super::source::{Block, Source};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::{AffineSource, ByteOrder, Element, Provenance, Scaling, Volume, VoxelStorage};
use glam::{DAffine3, DVec3};
use std::io::Read;
use std::path::Path;

/// File extensions of the NumPy array format.
pub const EXTENSIONS: &[&str] = &["npy"];

const MAGIC: &[u8] = b"\x93NUMPY";
/// Largest size of the header of an `.npy` file, in bytes.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// Whether a file is a NumPy `.npy` array.
pub fn is_npy(head: &Head) -> bool {
    head.starts_with(MAGIC)
}

/// Element type and shape of a NumPy `.npy` array.
#[derive(Debug, PartialEq)]
struct Header {
    element: Element,
    byte_order: ByteOrder,
    is_fortran: bool,
    shape: Vec<usize>,
}

/// Reads one frame of an `.npy` array as a volume, selected by its index from 0. `spacing_mm` overrides the affine of
/// the JSON sidecar file.
///
/// # Errors
/// The file cannot be read, ends early, or is no array of numbers with two to four axes.
pub fn read_with(
    path: &Path,
    frame: usize,
    spacing_mm: Option<[f64; 3]>,
    loading: &Loading,
) -> Result<Volume> {
    let refuse = refusal(path);
    let mut source = Source::open(path, loading)?;
    let (header, header_bytes) = header(&mut source).map_err(&refuse)?;
    let mut shape = header.shape.clone();
    // Many programs add leading axes of length 1.
    while shape.len() > 3 && shape[0] == 1 {
        shape.remove(0);
    }
    let (frames, [nz, ny, nx]) = match shape[..] {
        [ny, nx] => (1, [1, ny, nx]),
        [nz, ny, nx] => (1, [nz, ny, nx]),
        [frames, nz, ny, nx] if !header.is_fortran => (frames, [nz, ny, nx]),
        _ => {
            let order = if header.is_fortran { " in Fortran order" } else { "" };
            let why = format!("its shape is {:?}{order}; a volume has three axes", header.shape);
            return Err(refuse(why));
        }
    };
    let frame_warning = frame_warning(path, frame, frames)?;
    let Header { element, byte_order, is_fortran, .. } = header;
    if is_fortran {
        // Transposed voxels are downsampled after reading.
        loading.reduce_to(None);
    }
    let block = Block { dims: [nx, ny, nz], element, byte_order, offset: header_bytes, frame };
    // In Fortran order the first axis runs fastest.
    let storage = match is_fortran {
        true => block.read_transposed(&mut source, header_bytes).map(VoxelStorage::from),
        false => block.open(&mut source, header_bytes),
    };
    let storage = storage.map_err(refuse)?;
    let mut warnings = Vec::new();
    // A sidecar may describe another file, or an earlier version of the array.
    let describes =
        |s: &Sidecar| s.raw_layout().is_ok_and(|l| l.dims == [nx, ny, nz] && l.element == element);
    let sidecar = Sidecar::beside(path).unwrap_or_default().filter(describes);
    if sidecar.is_none() && Sidecar::path_of(path).exists() {
        warnings.push("the .json file beside it does not describe this array: not used".into());
    }
    let (world_from_index, affine_source) = match (&sidecar, spacing_mm) {
        (Some(sidecar), None) => (sidecar.affine(), AffineSource::Axes),
        (_, Some(mm)) => (DAffine3::from_scale(DVec3::from_array(mm)), AffineSource::Spacing),
        (None, None) => {
            warnings.push("no --spacing given: voxels taken as 1 mm".into());
            (DAffine3::IDENTITY, AffineSource::Spacing)
        }
    };
    warnings.extend(frame_warning);
    let scaling = sidecar.map_or(Scaling::IDENTITY, |sidecar| sidecar.scaling());
    let provenance = Provenance {
        affine_source,
        frames,
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "npy", block.stored_type())
    };
    let volume = Volume::from_storage(storage, scaling, world_from_index, provenance, loading)?;
    Ok(with_integer_warning(volume, element))
}

/// Reads the header of an `.npy` file and returns it with its size in bytes.
fn header(source: &mut Source<'_>) -> Result<(Header, u64), String> {
    let mut take = |count: usize| {
        let mut bytes = vec![0; count];
        source.read_exact(&mut bytes).map_err(|_| "its header ends early".to_string())?;
        Ok::<_, String>(bytes)
    };
    let start = take(8)?;
    if !start.starts_with(MAGIC) {
        return Err("it is not an .npy file".into());
    }
    let width = if start[6] == 1 { 2 } else { 4 };
    let length = take(width)?.iter().rev().fold(0, |length, byte| length << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header claims {length} bytes"));
    }
    let header = parse(&String::from_utf8_lossy(&take(length)?))?;
    Ok((header, (8 + width + length) as u64))
}

/// Returns the text after a key in the Python dictionary of an `.npy` header.
fn value<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let after = quoted.iter().find_map(|q| text.split_once(q.as_str())).map(|(_, after)| after);
    let after = after.and_then(|a| a.trim_start().strip_prefix(':'));
    after.map(str::trim_start).ok_or_else(|| format!("its header has no `{key}`"))
}

fn parse(text: &str) -> Result<Header, String> {
    let descr = value(text, "descr")?;
    let quote = descr.chars().next().filter(|c| ['\'', '"'].contains(c));
    let descr = quote
        .and_then(|q| descr[1..].split_once(q))
        .map(|(inside, _)| inside)
        .ok_or("its elements are records; numbers are needed")?;
    let (element, byte_order) = Element::from_numpy(descr).ok_or_else(|| {
        format!("its elements are of type `{descr}`; integers and 32- or 64-bit floats are read")
    })?;
    let is_fortran = value(text, "fortran_order")?.starts_with("True");
    let shape = value(text, "shape")?;
    let inside = shape.strip_prefix('(').and_then(|s| s.split_once(')')).map(|(inside, _)| inside);
    let sizes = inside.ok_or("its header has no shape")?.split(',').map(str::trim).filter(|n| !n.is_empty());
    let shape: Option<Vec<usize>> = sizes.map(|n| n.parse().ok().filter(|&n| n > 0)).collect();
    let shape = shape.ok_or("its shape has an axis without elements")?;
    Ok(Header { element, byte_order, is_fortran, shape })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_with_either_quotes_and_any_order() {
        let header = parse("{'descr': '<i2', 'fortran_order': False, 'shape': (4, 3, 2), }").unwrap();
        let expected = Header {
            element: Element::I16,
            byte_order: ByteOrder::Little,
            is_fortran: false,
            shape: vec![4, 3, 2],
        };
        assert_eq!(header, expected);
        let header = parse(r#"{"shape": (7,), "descr": ">f8", "fortran_order": True}"#).unwrap();
        assert!(header.is_fortran && header.shape == [7] && header.byte_order == ByteOrder::Big);
        for bad in [
            "{'descr': [('a', '<i2')], 'fortran_order': False, 'shape': (4,)}",
            "{'descr': '<c8', 'fortran_order': False, 'shape': (4, 3, 2)}",
            "{'descr': '<f4', 'shape': (4, 3, 2)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 0, 2)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (4, -3, 2)}",
            "{'descr': '",
            "",
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
