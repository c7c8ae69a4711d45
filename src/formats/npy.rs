//! NumPy's `.npy`: an array of three axes, `[k, j, i]` (`i` fastest in C order), or `[frame, k, j, i]` of four.
//!
//! Read here and not by a crate: the header's text is a Python literal, of which three keys are wanted, and no memory is
//! taken for what it merely claims. Source: NumPy's `numpy.lib.format`, "NPY format".

use super::frames::picked;
use super::head::Head;
use super::sidecar::Sidecar;
use super::source::{Block, Source, inexact_integers};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::element::{ByteOrder, Element, read_full};
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::Path;

/// File-name endings of the format.
pub const EXTENSIONS: &[&str] = &["npy"];

const MAGIC: &[u8] = b"\x93NUMPY";
const HEADER_MOST_BYTES: usize = 1 << 16;

/// Whether a file is of this format.
pub fn is_npy(head: &Head) -> bool {
    head.starts_with(MAGIC)
}

/// What the header says.
#[derive(Debug, PartialEq)]
struct Header {
    element: Element,
    byte_order: ByteOrder,
    is_fortran: bool,
    shape: Vec<usize>,
}

/// Reads one frame (0 is the first); `spacing_mm` where there is no sidecar, or to win over it.
///
/// # Errors
/// The file cannot be read, is no array of numbers of three or four axes, or ends early.
pub fn read_with(
    path: &Path,
    frame: usize,
    spacing_mm: Option<[f64; 3]>,
    loading: &Loading,
) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let mut source = Source::open(path, loading)?;
    let (header, header_bytes) = header(&mut source).map_err(refuse)?;
    let mut shape = header.shape.clone();
    // Without the axes of length 1 in front, which many programs add.
    while shape.len() > 3 && shape[0] == 1 {
        shape.remove(0);
    }
    let (frames, [nz, ny, nx]) = match shape[..] {
        [ny, nx] => (1, [1, ny, nx]),
        [nz, ny, nx] => (1, [nz, ny, nx]),
        [frames, nz, ny, nx] if !header.is_fortran => (frames, [nz, ny, nx]),
        _ => {
            let order = if header.is_fortran { " in Fortran's order" } else { "" };
            let why = format!("its shape is {:?}{order}; a volume has three axes", header.shape);
            return Err(refuse(why));
        }
    };
    let of_several = picked(path, frame, frames)?;
    let Header { element, byte_order, is_fortran, .. } = header;
    if is_fortran {
        // Turned about while it is read: reduced afterwards.
        loading.reduce_to(None);
    }
    let block = Block { dims: [nx, ny, nz], element, byte_order, offset: header_bytes, frame };
    // In Fortran's order the first axis runs fastest.
    let voxels = match is_fortran {
        true => block.read_turned(&mut source, header_bytes),
        false => block.read(&mut source, header_bytes),
    };
    let voxels = voxels.map_err(refuse)?;
    let mut warnings: Vec<String> = inexact_integers(&voxels, element).into_iter().collect();
    // What stands beside an array may be about something else, or about what it was before.
    let beside = Sidecar::beside(path).unwrap_or_default();
    let fits =
        |said: &Sidecar| said.raw_layout().is_ok_and(|l| l.dims == [nx, ny, nz] && l.element == element);
    let sidecar = beside.filter(fits);
    if sidecar.is_none() && Sidecar::path_of(path).exists() {
        warnings.push("the .json file beside it is not about this array: not used".into());
    }
    let (world_from_index, affine_source) = match (&sidecar, spacing_mm) {
        (Some(said), None) => (said.affine(), AffineSource::Axes),
        (_, Some(mm)) => (DAffine3::from_scale(DVec3::from_array(mm)), AffineSource::Spacing),
        (None, None) => {
            warnings.push("no --spacing given: voxels taken as 1 mm".into());
            (DAffine3::IDENTITY, AffineSource::Spacing)
        }
    };
    warnings.extend(of_several);
    let scaling = sidecar.map_or(Scaling::IDENTITY, |said| said.scaling());
    let provenance = Provenance {
        affine_source,
        frames,
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "npy", block.stored_type())
    };
    Volume::new_with(voxels, scaling, world_from_index, provenance, loading)
}

fn header(source: &mut Source<'_>) -> Result<(Header, u64), String> {
    use std::io::Read;
    let mut start = [0u8; 12];
    let short = || String::from("its header ends early");
    source.read_exact(&mut start[..8]).map_err(|_| short())?;
    if !start.starts_with(MAGIC) {
        return Err("it is not an .npy file".into());
    }
    let width = if start[6] == 1 { 2 } else { 4 };
    source.read_exact(&mut start[8..8 + width]).map_err(|_| short())?;
    let length = if width == 2 {
        usize::from(u16::from_le_bytes([start[8], start[9]]))
    } else {
        u32::from_le_bytes([start[8], start[9], start[10], start[11]]) as usize
    };
    if length > HEADER_MOST_BYTES {
        return Err(format!("its header is said to have {length} bytes"));
    }
    let mut text = vec![0; length];
    if read_full(source, &mut text).map_err(|e| e.to_string())? < length {
        return Err(short());
    }
    let header = parse(&String::from_utf8_lossy(&text))?;
    Ok((header, (8 + width + length) as u64))
}

/// What stands behind a key of the header's dictionary.
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
    let (element, byte_order) = Element::of_numpy(descr).ok_or_else(|| {
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
    fn headers_are_read_in_either_quotes_and_order() {
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
