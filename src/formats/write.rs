//! Writes volumes as NIfTI, NRRD, MetaImage, VTK, raw or NumPy files, with their physical values and affine.
//!
//! NIfTI and raw files store the voxels with slope and intercept. The other formats have neither: if the mapping is
//! not the identity, physical values are written, as 16- or 32-bit integers if exact and otherwise as 64-bit floats.

use super::nifti::write_nifti;
use super::numbers::Numbers;
use super::raw_layout::Sidecar;
use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use crate::volume::{Element, Volume};
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;
use std::io::{self, Write};
use std::path::Path;

/// File extensions that [`write_volume`] accepts.
pub const VOLUME_EXTENSIONS: &[&str] = &["nii.gz", "nii", "nrrd", "mha", "vti", "raw", "npy"];

/// Writes a volume in the format that the file extension names. A [`Sidecar`] file complements `.raw` and `.npy`. A
/// failed write leaves no partial volume file.
///
/// # Errors
/// The extension is unknown, the format cannot hold the size, or the file cannot be written.
pub fn write_volume(volume: &Volume, path: &Path) -> Result<()> {
    check_output(path, VOLUME_EXTENSIONS)?;
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("nrrd") => write_nrrd(volume, path),
        Some("mha") => write_mha(volume, path),
        Some("vti") => write_vti(volume, path),
        Some("raw") => write_raw(volume, path),
        Some("npy") => write_npy(volume, path),
        _ => write_nifti(volume, path),
    }
}

/// Writes an NRRD file: a header in RAS+ mm and gzipped voxels.
fn write_nrrd(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let affine = volume.world_from_index();
    let vector = |v: glam::DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let m = affine.matrix3;
    let [nx, ny, nz] = volume.dims();
    let name = match numbers.element() {
        Element::F32 => "float",
        Element::F64 => "double",
        other => other.name(),
    };
    let header = format!(
        "NRRD0004\ntype: {name}\ndimension: 3\nspace: right-anterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: {} {} {}\nkinds: domain domain domain\nendian: little\nencoding: gzip\n\
         space origin: {}\n\n",
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(affine.translation),
    );
    write_whole(path, |file| {
        file.write_all(header.as_bytes())?;
        let mut stream = GzEncoder::new(file, Compression::fast());
        numbers.write(&mut stream)?;
        stream.finish().map(|_| ())
    })
}

/// Returns the directions of a volume's index axes (unit vectors), and the spacing along them, mm.
fn directions_and_spacing(volume: &Volume) -> ([DVec3; 3], [f64; 3]) {
    let m = volume.world_from_index().matrix3;
    let axes = [m.x_axis, m.y_axis, m.z_axis];
    (axes.map(|axis| axis / axis.length()), axes.map(DVec3::length))
}

/// Joins numbers to a text, separated by blanks.
fn spaced(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|x| x.to_string()).collect::<Vec<_>>().join(" ")
}

/// Names of a number type in MetaImage and in VTK files.
fn type_names(element: Element) -> (&'static str, &'static str) {
    match element {
        Element::U8 => ("MET_UCHAR", "UInt8"),
        Element::I8 => ("MET_CHAR", "Int8"),
        Element::U16 => ("MET_USHORT", "UInt16"),
        Element::I16 => ("MET_SHORT", "Int16"),
        Element::U32 => ("MET_UINT", "UInt32"),
        Element::I32 => ("MET_INT", "Int32"),
        Element::U64 => ("MET_ULONG_LONG", "UInt64"),
        Element::I64 => ("MET_LONG_LONG", "Int64"),
        Element::F32 => ("MET_FLOAT", "Float32"),
        Element::F64 => ("MET_DOUBLE", "Float64"),
    }
}

/// Writes a MetaImage (`.mha`): a header in LPS mm and uncompressed voxels.
fn write_mha(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let lps = |v: DVec3| [-v.x, -v.y, v.z];
    let (directions, spacing) = directions_and_spacing(volume);
    let [nx, ny, nz] = volume.dims();
    let (kind, _) = type_names(numbers.element());
    let header = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
         TransformMatrix = {}\nOffset = {}\nCenterOfRotation = 0 0 0\nElementSpacing = {}\n\
         DimSize = {nx} {ny} {nz}\nElementType = {kind}\nElementDataFile = LOCAL\n",
        spaced(directions.into_iter().flat_map(lps)),
        spaced(lps(volume.world_from_index().translation)),
        spaced(spacing),
    );
    write_whole(path, |file| {
        file.write_all(header.as_bytes())?;
        numbers.write(file)
    })
}

/// Writes a VTK XML image (`.vti`): the values at the points of the grid, in RAS+ mm and uncompressed.
fn write_vti(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let (directions, spacing) = directions_and_spacing(volume);
    let rows = (0..3).flat_map(|row| directions.map(|axis| axis[row]));
    let origin = volume.world_from_index().translation.to_array();
    let [x, y, z] = volume.dims().map(|n| n - 1);
    let element = numbers.element();
    let (_, kind) = type_names(element);
    let header = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <ImageData WholeExtent=\"0 {x} 0 {y} 0 {z}\" Origin=\"{}\" Spacing=\"{}\" Direction=\"{}\">\n\
         <Piece Extent=\"0 {x} 0 {y} 0 {z}\">\n<PointData Scalars=\"values\">\n\
         <DataArray type=\"{kind}\" Name=\"values\" format=\"appended\" offset=\"0\"/>\n\
         </PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_",
        spaced(origin),
        spaced(spacing),
        spaced(rows),
    );
    let bytes = volume.dims().iter().product::<usize>() as u64 * element.bytes() as u64;
    write_whole(path, |file| {
        file.write_all(header.as_bytes())?;
        file.write_all(&bytes.to_le_bytes())?;
        numbers.write(file)?;
        file.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    })
}

/// Writes a raw volume file of the stored voxels, and its JSON sidecar file.
fn write_raw(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::stored(volume);
    write_with_sidecar(&numbers.sidecar(), path, |file| numbers.write(file))
}

/// Writes a NumPy array `[k, j, i]` of the physical values, and its JSON sidecar file.
fn write_npy(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let element = numbers.element();
    let kind = format!("{}{}", if element.bytes() == 1 { '|' } else { '<' }, element.numpy_name());
    let [nx, ny, nz] = volume.dims();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({nz}, {ny}, {nx}), }}");
    // The header ends with a line end, and the voxels begin at a multiple of 64 bytes.
    let unpadded = 10 + header.len() + 1;
    header.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    write_with_sidecar(&numbers.sidecar(), path, |file| {
        file.write_all(b"\x93NUMPY\x01\x00")?;
        file.write_all(&(header.len() as u16).to_le_bytes())?;
        file.write_all(header.as_bytes())?;
        numbers.write(file)
    })
}

/// Writes a volume file and its JSON sidecar file, both only after the voxels are written. An existing JSON file that
/// is no sidecar file gives an error.
fn write_with_sidecar(
    sidecar: &Sidecar,
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<()> {
    let beside = Sidecar::path_of(path);
    if beside.exists() && Sidecar::beside(path).ok().flatten().is_none() {
        let why = "it is no sidecar, and writing the volume would overwrite it";
        return Err(Error::input("cannot write volume", beside.display(), why)
            .hint("give another name, or move that file away"));
    }
    let text = serde_json::to_string_pretty(sidecar)
        .map_err(|e| Error::runtime("cannot write volume", path.display(), e))?;
    write_whole(path, |file| {
        write(file)?;
        write_whole(&beside, |file| writeln!(file, "{text}")).map_err(io::Error::other)
    })
}
